"""Texts that are not models, over DDS: no node ends or grows, forecasts go on, diagnostics say what was wrong."""

import re
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from hostile_manoeuvring_models import manoeuvring_text, manoeuvring_texts  # noqa: E402
from hostile_models import attitude_text, attitude_texts, of_any_kind  # noqa: E402
from live_bench import LATCHED, Bench, stamp_ns, start, start_node, start_together, stop, wait_for  # noqa: E402
from std_msgs.msg import String  # noqa: E402

pytestmark = pytest.mark.dds

LARGEST_GAP = 0.5
LARGEST_GROWTH_MB = 50.0
WARN = 1

TOPICS = {
    # status, count of refusals, a model, and texts that are none
    'model/description': ('predictor: forecast', attitude_text(), of_any_kind(attitude_text())),
    'manoeuvring/model': ('manoeuvring_predictor: manoeuvre', manoeuvring_text(), of_any_kind(manoeuvring_text())),
}


def resident_mb(process):
    status = Path(f'/proc/{process.pid}/status').read_text()
    return int(re.search(r'VmRSS:\s*(\d+) kB', status)[1]) / 1024


def status_of(bench, topic):
    return bench.statuses.get(TOPICS[topic][0], (0, '', {}))


def refusals(bench, topic):
    if topic == 'model/description':
        return int(bench.counts('predictor').get('bad-model', 0))
    return int(status_of(bench, topic)[2].get('bad_models', 0))


@pytest.fixture(scope='module')
def nodes():
    """The nodes, started while texts that are not models lie on both topics."""
    bench = Bench()
    publishers = {topic: bench.publisher(String, topic, LATCHED) for topic in TOPICS}
    for topic, publisher in publishers.items():
        publisher.publish(String(data=TOPICS[topic][2]['nested brackets'][0]))
    # in a process of its own, so that it goes on whatever this one does
    sensor = start('-m', 'swath_sysid.nodes', 'simulated_craft', '--ros-args', '-p', 'hull:=swath-pitch')
    processes = start_together(), start_node('manoeuvring_predictor')
    try:
        wait_for(lambda: all(TOPICS[topic][0] in bench.statuses for topic in TOPICS), 'diagnostics')
        yield bench, publishers, processes
    finally:
        ends = [stop(process) for process in (sensor, *processes)]
        bench.close()
    assert [code for code, _ in ends] == [0, 0, 0], ends
    assert not any('Traceback' in output for _, output in ends)


@pytest.mark.parametrize('topic', TOPICS)
def test_each_text_is_refused_while_forecasts_go_on(nodes, topic):
    bench, publishers, processes = nodes
    _, model, texts = TOPICS[topic]
    # what was latched before the node started
    wait_for(lambda: 'deep' in status_of(bench, topic)[2].get('refused_model', ''), 'refusal')
    assert refusals(bench, topic) == 1 and status_of(bench, topic)[0] >= WARN
    wait_for(lambda: bench.heard['forecast/next'], 'forecast')
    # what the first model and the first forecasts take is theirs
    publishers[topic].publish(String(data=model))
    wait_for(lambda: status_of(bench, topic)[2].get('refused_model') == '', 'model')
    before, count = [resident_mb(process) for process in processes], refusals(bench, topic)
    heard = len(bench.heard['forecast/next'])
    for name, (text, words) in texts.items():
        if name == 'twenty megabytes':
            # the middleware alone keeps two copies of it
            continue
        publishers[topic].publish(String(data=text))
        count += 1
        wait_for(lambda count=count: refusals(bench, topic) == count, f'refusal of {name}')
        level, _, values = status_of(bench, topic)
        assert level >= WARN
        assert re.search(words, values['refused_model']), (name, values['refused_model'])
    if topic == 'model/description':
        # the model before stays, and a good one ends the warning
        assert values['has_model_pitch'] == 'True'
    publishers[topic].publish(String(data=model))
    wait_for(lambda: status_of(bench, topic)[2]['refused_model'] == '', 'end of the warning')
    assert refusals(bench, topic) == count
    growth = [resident_mb(process) - mb for process, mb in zip(processes, before, strict=True)]
    assert max(growth) < LARGEST_GROWTH_MB
    assert [process.poll() for process in processes] == [None, None]
    stamps = [stamp_ns(message) for message in bench.heard['forecast/next'][heard:]]
    assert max(b - a for a, b in zip(stamps, stamps[1:], strict=False)) * 1e-9 < LARGEST_GAP


@pytest.mark.parametrize(
    ('node', 'parameter', 'text', 'report'),
    [
        ('identifier', 'model_path', attitude_texts()['nested brackets'][0], 'identification'),
        ('manoeuvring_predictor', 'model_file', manoeuvring_texts()['mass NaN'][0], 'manoeuvre'),
    ],
)
def test_a_model_file_that_cannot_be_used_does_not_end_the_node(node, parameter, text, report, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(text)
    bench = Bench()
    process = start_node(node, '-r', '__ns:=/refusing', '-p', f'{parameter}:={path}')

    def told():
        level, message, values = bench.statuses.get(f'refusing/{node}: {report}', (0, '', {}))
        if node == 'identifier':
            return level == WARN and str(path) in message and values['bad-model-file'] == '1'
        return str(path) in values.get('refused_model', '')

    try:
        wait_for(told, 'refusal')
        reports = bench.reports
        wait_for(lambda: bench.reports > reports + 10, 'further diagnostics')
        assert told()
    finally:
        code, output = stop(process)
        bench.close()
    assert code == 0 and 'Traceback' not in output, output
    assert path.read_text() == text
