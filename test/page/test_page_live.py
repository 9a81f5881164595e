"""The page's node beside the real nodes and a sensor: what it hears, what it asks of them, and the faults it names."""

import os
import signal
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, decay_stream, reading  # noqa: E402
from live_bench import (  # noqa: E402
    LATCHED,
    PATIENCE,
    Bench,
    Spinning,
    children,
    running,
    settings,
    start_together,
    stop,
    wait_for,
)
from package_process import command_line  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from test_page_bring_up import turned_over  # noqa: E402

from swath_sysid.attitude.prediction.sea_state import SeaReport  # noqa: E402
from swath_sysid.formats.bags import is_bag  # noqa: E402
from swath_sysid.formats.sea_state_yaml import sea_as_yaml  # noqa: E402
from swath_sysid.page.bring_up import JUDGE, KEPT  # noqa: E402
from swath_sysid.page.nodes.page_node import PageNode  # noqa: E402
from swath_sysid.page.state import PageState  # noqa: E402

pytestmark = pytest.mark.dds

RATE = 25.0

SETTINGS = settings('window_timeout_s:=60.0', 'axes:=[pitch]', 'generations:=20', 'population:=30')
"""A search that suffices for a linear hull, since it is not what is tested here."""


class Page:
    def __init__(self, bench, folder):
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.bench, self.folder, self.stamp, self.sent = bench, folder, EPOCH_NS, 0
        self.node = PageNode(lambda line: self.state.answer(line))
        self.state = PageState(self.node, folder, 'pitch')
        self.spinning = Spinning(self.node)

    def close(self):
        self.spinning.close()
        rclpy.shutdown()
        self.state.close()

    def look(self):
        self.state.refresh()
        return self.state.view.guidance

    def connect(self):
        wait_for(lambda: self.bench.imu.get_subscription_count() >= 3, 'the page at the sensor')
        wait_for(lambda: self.node.record._window is not None, "the predictor's parameters at the page")

    def send(self, readings):
        """Publish; the guide looks on all the time, as often as the screens do."""
        readings = list(readings)
        for k in range(0, len(readings), 40):
            self.sent += self.bench.send(readings[k : k + 40])
            self.look()
        self.stamp = readings[-1].stamp_ns
        self.bench.settle('predictor', self.sent)

    def rest(self, seconds=20.0, wrong=lambda each: each):
        self.send(
            wrong(reading(self.stamp + (k + 1) * round(1e9 / RATE), noise(k), noise(k + 1)))
            for k in range(round(RATE * seconds))
        )

    def lie_still_until(self, condition, what, wrong=lambda each: each):
        """The sensor goes on at rest until the guidance is as it should be; that."""

        def found():
            self.rest(0.8, wrong)
            guidance = self.look()
            return condition(guidance) and guidance

        return wait_for(found, what)


def noise(k):
    return 5e-4 * ((k * 7919) % 13 - 6) / 6


@pytest.fixture(scope='module')
def page(tmp_path_factory):
    bench = Bench()
    shown = Page(bench, tmp_path_factory.mktemp('page'))
    with running(bench, start_together(*SETTINGS)):
        shown.connect()
        yield shown
    shown.close()
    bench.close()


@pytest.mark.long
def test_from_rest_to_a_kept_model_without_a_terminal(page):
    page.rest()
    page.lie_still_until(lambda guidance: 'Now push' in guidance.sentence, 'request to push')
    page.state.press('record')
    # what is recorded is subscribed to first
    wait_for(lambda: page.bench.imu.get_subscription_count() >= 4, 'the recorder')
    page.send(decay_stream(RATE, 18.0, release=4.0, hold=1.0, first_ns=page.stamp + 20_000_000))
    guidance = page.lie_still_until(lambda guidance: guidance.step == JUDGE, 'model')
    assert guidance.sentence.startswith('2.6')
    page.state.press('save')
    assert len(list(page.folder.glob('model_*.yaml'))) == 1
    page.state.press('record')
    wait_for(lambda: page.look() and not page.state.view.is_recording, 'the end of the recording')
    (bag,) = page.folder.glob('*.mcap')
    assert is_bag(bag)
    page.state.press('accept')
    wait_for(lambda: page.node.record.is_kept, 'the acceptance')
    page.lie_still_until(lambda guidance: guidance.step == KEPT, 'kept model')
    page.state.press('rollback')
    wait_for(lambda: any('no model before' in line or 'back to' in line for line in page.state.answers), 'an answer')


@pytest.mark.long
def test_a_wrong_sensor_is_named_through_the_nodes(page):
    page.rest(15.0, turned_over)
    guidance = page.lie_still_until(lambda guidance: guidance.fault == 'sensor-turned', 'fault', turned_over)
    assert 'set mounting_deg to [180, 0, 0]' in guidance.cure


@pytest.mark.long
def test_the_sea_state_and_the_sensors_own_topic_reach_the_page(page):
    said = page.bench.publisher(String, 'sea/state', LATCHED)
    said.publish(String(data='is_known: maybe'))
    wait_for(lambda: any('sea/state: ' in line for line in page.state.answers), 'an answer to a wrong text')
    said.publish(String(data=sea_as_yaml(SeaReport(None, 'only 20 s so far'), page.stamp)))
    wait_for(lambda: page.look() and page.state.view.sea == 'No sea state: only 20 s so far.', 'the sea state')
    assert page.node.sensor == '/imu/data'


@pytest.mark.long
def test_a_page_that_stands_still_holds_nobody_up(page):
    page.spinning.pause()
    page.rest(10.0)
    assert page.bench.counts('predictor')['received'] == page.sent


def page_of(process):
    """The process of the page that a run has started."""

    def found():
        return [pid for pid in children(process.pid) if b'\0page\0' in Path(f'/proc/{pid}/cmdline').read_bytes()]

    wait_for(found, 'the page')
    return found()[0]


@pytest.mark.long
def test_run_starts_the_page_once_more_where_it_ends_and_ends_it():
    pytest.importorskip('nicegui', reason='the page needs nicegui: pip install swath_sysid[page]')
    process = command_line('run', '--page', '--port', '0', '--namespace', 'paged')
    deadline = time.monotonic() + PATIENCE

    def read_until(words):
        lines = []
        while not any(words in line for line in lines):
            assert time.monotonic() < deadline and process.poll() is None, lines
            lines.append(process.stdout.readline())
        return lines

    read_until('the page is at http://localhost:')
    os.kill(page_of(process), signal.SIGKILL)
    assert 'the nodes go on: it is started again' in read_until('the page has ended with code -9')[-1]
    read_until('the page is at http://localhost:')
    again = page_of(process)
    code, output = stop(process, signal.SIGINT)
    assert code == 0 and 'has ended' not in output and not Path(f'/proc/{again}').exists(), output
