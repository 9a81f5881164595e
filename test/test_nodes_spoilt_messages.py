"""The nodes' subscriptions take messages of which any field is spoilt, and good ones after them as before."""

from itertools import count
from math import sin

import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import imu_message, take  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from sensor_msgs.msg import PointCloud2  # noqa: E402
from spoilt_messages import spoilt  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

from swath_sysid.formats.messages import window_message  # noqa: E402
from swath_sysid.nodes.identifier import Identifier  # noqa: E402
from swath_sysid.nodes.imu_buffer import ImuBuffer  # noqa: E402
from swath_sysid.nodes.predictor import Predictor  # noqa: E402

STEP_NS = 10_000_000
SAMPLES = 300
LAST_NS = 2**31 * 10**9 - 1  #: That a message can state, unlike what is forecast from it.


@pytest.fixture
def made():
    """Makes nodes that are destroyed at the end."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    nodes = []

    def make(kind):
        nodes.append(kind())
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.shutdown()


def sensor():
    """Good samples, one after the other."""
    return (imu_message(reading(EPOCH_NS + k * STEP_NS, 0.01)) for k in count())


def used(node):
    return next(report.values['used'] for report in node._reports() if report.name == 'imu')


@pytest.mark.parametrize('kind', [ImuBuffer, Predictor])
def test_a_sensor_of_which_any_field_is_spoilt_is_used_again_when_it_is_well(made, kind):
    node, samples = made(kind), sensor()
    for _ in range(SAMPLES):
        take(node, next(samples))
    for _, message in spoilt(next(samples)):
        take(node, message)
    for k in range(SAMPLES):
        take(node, imu_message(reading(LAST_NS - (SAMPLES - 1 - k) * STEP_NS, 0.05 * sin(0.02 * k))))
    before = used(node)
    for _ in range(SAMPLES):
        take(node, next(samples))
    assert used(node) - before > 0.9 * SAMPLES


def test_loadings_and_models_of_which_any_field_is_spoilt_are_refused_in_a_sentence(made):
    node = made(Predictor)
    for _, message in spoilt(Float64(data=1.0)):
        node.models.take_loading(message)
    for _, message in spoilt(String(data='nothing')):
        node.models.intake.submit(message.data)
    assert all(report.message for report in node._reports())


def test_windows_of_which_any_field_is_spoilt_are_refused_and_the_next_is_taken(made):
    buffer, samples = made(ImuBuffer), sensor()
    for _ in range(SAMPLES):
        take(buffer, next(samples))
    good = deserialize_message(window_message(buffer.window.table(), 'base_link'), PointCloud2)
    windows = made(Identifier)._windows
    for _, message in spoilt(good):
        windows._receive(message)
    windows._receive(good)
    assert windows._refused == '' and len(windows.newest.rows) == SAMPLES
