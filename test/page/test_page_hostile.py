"""The page among other people's nodes: it lives with every message and reports each kind once."""

from time import monotonic

import pytest

rclpy = pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # noqa: E402
from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import Spinning, imu_message, wait_for  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from spoilt_messages import spoilt  # noqa: E402
from std_msgs.msg import Float32, String  # noqa: E402
from test_nodes_network import assert_does_what_is_allowed, watcher  # noqa: E402, F401
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from swath_sysid.attitude.hull.catalogue import hull_named  # noqa: E402
from swath_sysid.attitude.hull.identified_model import IdentifiedModel  # noqa: E402
from swath_sysid.attitude.prediction.sea_state import SeaReport  # noqa: E402
from swath_sysid.formats.messages import NANOSECOND, SECOND_NS  # noqa: E402
from swath_sysid.formats.model_file import model_to_yaml  # noqa: E402
from swath_sysid.formats.sea_state_yaml import sea_as_yaml  # noqa: E402
from swath_sysid.nodes.parameters.table import defaults  # noqa: E402
from swath_sysid.page.nodes.page_node import ASKED, PageNode  # noqa: E402
from swath_sysid.page.state import PageState  # noqa: E402

SENTENCE = 'another node is called predictor'


class Shown:
    """The page without browsers, and what it has said."""

    def __init__(self, folder):
        self.said = []
        self.node = PageNode(self.said.append)
        self.state = PageState(self.node, folder, 'roll')
        self.node._on_parameters(*(defaults('predictor')[name] for name in ASKED))

    def view(self):
        self.state.refresh()
        return self.state.view

    def health(self):
        return {name: sentence for name, _, sentence in self.view().health}


@pytest.fixture
def page(tmp_path):
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    shown = Shown(tmp_path)
    yield shown
    shown.node.destroy_node()
    rclpy.shutdown()


def trajectory(names, rows, step_s=1):
    message = JointTrajectory(joint_names=names)
    message.header.stamp.sec = EPOCH_NS // SECOND_NS
    for k, row in enumerate(rows):
        message.points.append(JointTrajectoryPoint(positions=row))
        message.points[-1].time_from_start.sec = k * step_s
    return message


def statuses():
    message = DiagnosticArray()
    for name in ('predictor: imu', 'predictor: forecast', 'identifier: identification', 'imu_buffer: window'):
        keys = 'rate_hz received published samples valid_lead_roll_s progress'.split()
        values = [KeyValue(key=key, value='3.5') for key in keys]
        message.status.append(DiagnosticStatus(level=b'\x00', name=name, message='receiving', values=values))
    return message


HORIZON = trajectory(['roll', 'roll_std', 'pitch', 'pitch_std'], [[0.1, 0.01, 0.2, 0.02]] * 3)
MODEL = model_to_yaml({'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)})
#: Callback, a good message, and what the page shows after it.
GOOD = {
    'imu': (imu_message(reading(EPOCH_NS, 0.1)), lambda page: page.node.record.stamp == EPOCH_NS * NANOSECOND),
    'horizon': (HORIZON, lambda page: len(page.view().motion['roll']['series'][-2]['data']) == 3),
    'calm': (trajectory(['probability'], [[0.9]] * 2), lambda page: page.node.record.calm[2] == 0.9),
    'quiescence': (Float32(data=0.25), lambda page: page.node.record.quiescence == 0.25),
    'sea': (String(data=sea_as_yaml(SeaReport(None, 'too short'), 5)), lambda page: 'too short' in page.view().sea),
    'description': (String(data=MODEL), lambda page: 'roll' in page.node.record.models),
    'diagnostics': (statuses(), lambda page: 'Valid lead: roll 3.5 s.' == page.view().valid),
}


@pytest.mark.parametrize('name', GOOD)
def test_whatever_field_is_spoilt_the_page_lives_and_shows_the_next_good_message(page, name):
    good, is_shown = GOOD[name]
    page.node._on_imu(serialize_message(imu_message(reading(EPOCH_NS))))
    take = getattr(page.node, f'_on_{name}')
    for _, message in spoilt(good):
        take(serialize_message(message) if name == 'imu' else message)
        page.view()
    if name == 'imu':
        for raw in (b'', b'\x00\x01\x00\x00', serialize_message(good)[:40]):
            take(raw)
        for k in range(300):
            take(serialize_message(imu_message(reading(EPOCH_NS + k * 10**7))))
    assert len(page.said) == len(set(page.said))
    take(serialize_message(good) if name == 'imu' else good)
    assert is_shown(page) and not page.node.record.unreadable


def test_a_kind_is_reported_once_in_its_place_until_a_good_message_comes(page):
    ragged = trajectory(['roll', 'pitch'], [[0.1, 0.2], [0.1]])
    for message in (ragged, ragged, trajectory(['<b>'], [[1.0]])):
        page.node._on_horizon(message)
    assert [said.partition(':')[0] for said in page.said] == ['forecast/horizon'] * 2
    assert page.said[0].startswith('forecast/horizon: a time has 1 positions for 2 names')
    assert page.health()['forecast/horizon'].startswith('not shown: the forecast has no roll or pitch')
    page.node._on_horizon(HORIZON)
    assert 'forecast/horizon' not in page.health()


def test_texts_in_place_of_numbers_are_shown_as_what_they_are(page):
    message = statuses()
    for status in message.status:
        for pair in status.values:
            pair.value = 'zzz'
    page.node._on_diagnostics(message)
    assert (
        page.health()['Sensor'] == '(no number) Hz, receiving'
        and page.view().valid == 'Valid lead: roll (no number) s.'
    )


def test_statuses_of_others_take_no_room_from_those_that_are_read_and_long_texts_are_cut(page):
    long = 'x' * 10**5
    others = [DiagnosticStatus(name=f'predictor: {k}', message=long) for k in range(300)]
    page.node._on_diagnostics(DiagnosticArray(status=others))
    ours = DiagnosticStatus(name='predictor: imu', message=long, values=[KeyValue(key=long, value=long)])
    page.node._on_diagnostics(DiagnosticArray(status=[ours]))
    (found,) = page.node.record.statuses(monotonic()).values()
    ((key, value),) = found.values.items()
    assert [len(text) for text in (found.message, key, value)] == [1000] * 3
    page.node._on_diagnostics(statuses())
    assert page.health()['Sensor'] == '3.5 Hz, receiving'


@pytest.mark.parametrize('found', [[], [None] * len(ASKED), ['x'] * len(ASKED), [float('nan')] * len(ASKED)])
def test_a_namesake_of_the_predictor_is_reported(page, found):
    page.node._on_parameters(*found)
    page.node._on_parameters(*found)
    (said,) = page.said
    assert SENTENCE in said and SENTENCE in page.health()['predictor']


@pytest.mark.long
@pytest.mark.dds
def test_a_namesake_over_dds_ends_nothing_and_the_predictor_is_heard_after_it(tmp_path):
    """An exception in the answer of a service ended the process by a segmentation fault."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    said = []
    node = PageNode(said.append)
    spinning, other = Spinning(node), rclpy.create_node('predictor')
    other.declare_parameter('rate', 5.0)
    answering = Spinning(other)
    try:
        wait_for(lambda: any(SENTENCE in line for line in said), 'the report of a namesake')
        answering.close()
        real = rclpy.create_node('predictor')
        for name in ASKED:
            real.declare_parameter(name, defaults('predictor')[name])
        answering = Spinning(real)
        wait_for(lambda: node.record.limits is not None and not node.record.unreadable, 'the parameters')
        assert len(said) == 1
    finally:
        answering.close()
        spinning.close()
        rclpy.shutdown()


def pressed(folder):
    node = PageNode(lambda line: None)
    node._requests.get_parameters('predictor', ASKED, lambda *found: None)
    for button in ('identify', 'cancel', 'rollback', 'undo_rollback', 'push', 'accept'):
        node.press(button)
    node._requests.carry_out()
    return node


@pytest.mark.long
@pytest.mark.dds
def test_the_policy_allows_what_the_page_does_and_no_more(watcher, tmp_path):  # noqa: F811
    assert_does_what_is_allowed('page', pressed, watcher, tmp_path)
