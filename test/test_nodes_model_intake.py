"""Texts that are not models, over DDS: no node ends or grows, forecasts go on, diagnostics say what was wrong."""

import re
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from hostile_models import attitude_text, attitude_texts, of_any_kind  # noqa: E402
from live_bench import LATCHED, Bench, stamp_ns, start, start_node, start_together, stop, wait_for  # noqa: E402
from std_msgs.msg import String  # noqa: E402

pytestmark = pytest.mark.dds

LARGEST_GROWTH_MB = 50.0
WARN = 1


def resident_mb(process):
    status = Path(f'/proc/{process.pid}/status').read_text()
    return int(re.search(r'VmRSS:\s*(\d+) kB', status)[1]) / 1024


class Intake:
    """Of a node that takes models from a topic, beside the nodes of the attitude, while a text that is none lies there.

    ``status`` is what the node reports, ``refusals`` how many texts it has refused as of what the bench has heard.
    """

    def __init__(self, topic, text, status, refusals, *nodes):
        self.text, self.texts, self._status = text, of_any_kind(text), status
        self.bench = Bench()
        self._publisher = self.bench.publisher(String, topic, LATCHED)
        self.publish(self.texts['nested brackets'][0])
        # in a process of its own, so that it goes on whatever this one does
        self._sensor = start('-m', 'swath_sysid.nodes', 'simulated_craft', '--ros-args', '-p', 'hull:=swath-pitch')
        self.processes = [start_together(), *map(start_node, nodes)]
        self.refusals = lambda: int(refusals(self.bench))

    def publish(self, text):
        self._publisher.publish(String(data=text))

    @property
    def status(self):
        return self.bench.statuses.get(self._status, (0, '', {}))

    def close(self):
        ends = [stop(process) for process in (self._sensor, *self.processes)]
        self.bench.close()
        assert not any(code for code, _ in ends) and not any('Traceback' in output for _, output in ends), ends


def assert_each_text_is_refused_while_forecasts_go_on(intake):
    """The model before stays, and a good one ends the warning."""
    heard = intake.bench.heard['forecast/next']
    # what was latched before the node started
    wait_for(lambda: 'deep' in intake.status[2].get('refused_model', ''), 'refusal')
    assert intake.refusals() == 1 and intake.status[0] >= WARN
    wait_for(lambda: heard, 'forecast')
    # what the first model and the first forecasts take is theirs
    intake.publish(intake.text)
    wait_for(lambda: intake.status[2].get('refused_model') == '', 'model')
    before, count = list(map(resident_mb, intake.processes)), intake.refusals()
    for name, (text, words) in intake.texts.items():
        if name == 'twenty megabytes':
            # the middleware alone keeps two copies of it
            continue
        intake.publish(text)
        count += 1
        wait_for(lambda count=count: intake.refusals() == count, f'refusal of {name}')
        newest = stamp_ns(heard[-1])
        wait_for(lambda newest=newest: stamp_ns(heard[-1]) > newest, f'forecast after {name}')
        level, _, values = intake.status
        assert level >= WARN
        assert re.search(words, values['refused_model']), (name, values['refused_model'])
    assert intake.status[2].get('has_model_pitch', 'True') == 'True'
    intake.publish(intake.text)
    wait_for(lambda: intake.status[2]['refused_model'] == '', 'end of the warning')
    assert intake.refusals() == count
    growth = [resident_mb(process) - mb for process, mb in zip(intake.processes, before, strict=True)]
    assert max(growth) < LARGEST_GROWTH_MB
    assert not any(process.poll() is not None for process in intake.processes)


@pytest.mark.long
def test_each_text_is_refused_while_forecasts_go_on():
    def refusals(bench):
        return bench.counts('predictor').get('bad-model', 0)

    with closing(Intake('model/description', attitude_text(), 'predictor: forecast', refusals)) as intake:
        assert_each_text_is_refused_while_forecasts_go_on(intake)
        assert intake.status[2]['has_model_pitch'] == 'True'


def assert_a_bad_model_file_does_not_end(node, given, path, told):
    """``told`` says of a status of the bench whether it names the file."""
    bench = Bench()
    process = start_node(node, '-r', '__ns:=/refusing', '-p', f'{given}:={path}')
    text = path.read_text()
    try:
        wait_for(lambda: told(bench.statuses), 'refusal')
        reports = bench.reports
        wait_for(lambda: bench.reports > reports + 10, 'further diagnostics')
        assert told(bench.statuses)
    finally:
        code, output = stop(process)
        bench.close()
    assert code == 0 and 'Traceback' not in output, output
    assert path.read_text() == text


@pytest.mark.long
def test_a_model_file_that_cannot_be_used_does_not_end_the_node(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(attitude_texts()['nested brackets'][0])

    def told(statuses):
        level, message, values = statuses.get('refusing/identifier: identification', (0, '', {}))
        return level == WARN and str(path) in message and values['bad-model-file'] == '1'

    assert_a_bad_model_file_does_not_end('identifier', 'model_path', path, told)
