"""The mounting of the IMU that gives the yaw rate of a manoeuvre: stated, or missed."""

import numpy as np
import pytest
from manoeuvring_runs import OLD, codes, copy_bag
from scipy.spatial.transform import Rotation
from test_mounting import ROTATIONS, frames_of, matrix_of

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import header, make
from swath_sysid.formats.topics import TRANSFORMS
from swath_sysid.manoeuvring.formats.bags import read_manoeuvring_bag, write_manoeuvring_bag
from swath_sysid.manoeuvring.hull.simulation import simulate


@pytest.fixture(scope='module')
def plain(tmp_path_factory):
    """A bag of a craft that turns to either side, with its yaw rate."""
    path, difference = tmp_path_factory.mktemp('plain') / 'a.mcap', 30.0 * np.sign(np.sin(0.2 * np.arange(400) * 0.1))
    write_manoeuvring_bag(path, simulate(OLD, 60.0 - difference, 60.0 + difference, 0.1))
    return path, read_manoeuvring_bag(path).yaw_rate


def turned_bag(plain, path, mounting):
    """The same with an IMU that is mounted like this."""
    turn = matrix_of(mounting)

    def changed(topic, kind, message):
        if kind.endswith('Imu'):
            rate, pose = message.angular_velocity, message.orientation
            rate.x, rate.y, rate.z = turn.inv().apply([rate.x, rate.y, rate.z]).tolist()
            attitude = Rotation.from_quat([pose.x, pose.y, pose.z, pose.w]) * turn
            pose.x, pose.y, pose.z, pose.w = attitude.as_quat().tolist()
        return [(topic, kind, message)]

    copy_bag(plain[0], path, changed)
    return path


@pytest.mark.parametrize('mounting', [*ROTATIONS, (0, 90, 0)])
def test_the_yaw_rate_of_a_turned_imu_is_that_of_the_craft_where_its_mounting_is_stated(plain, mounting, tmp_path):
    bag, up = turned_bag(plain, tmp_path / 'a', mounting), matrix_of(mounting).as_matrix()[2, 2]
    stated = read_manoeuvring_bag(bag, mounting=tuple(np.radians(mounting)))
    np.testing.assert_allclose(stated.yaw_rate, plain[1], atol=1e-9)
    if up < np.cos(np.radians(45.0)):
        with pytest.raises(InputError, match='set mounting_deg'):
            read_manoeuvring_bag(bag)
    else:
        assert ('sensor-tilted' in codes(read_manoeuvring_bag(bag))) == (up < np.cos(np.radians(5.0)))


def test_static_transforms_and_flags_state_it_and_a_table_takes_none(plain, tmp_path, capsys):
    bag = turned_bag(plain, tmp_path / 'a', (180, 0, 0))
    stated = [
        ('/wamv/tf_static', TRANSFORMS, make(TRANSFORMS, [(header(0, 'wamv/base_link'), 'wamv/imu_link', placed)]))
        for placed in (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)))
    ]
    # that of another craft comes later
    once = [stated[0], ('/other/tf_static', *stated[1][1:])]
    copy_bag(bag, tmp_path / 'b', lambda *each: [each, *([once.pop(0)] if once else [])])
    np.testing.assert_allclose(read_manoeuvring_bag(tmp_path / 'b').yaw_rate, plain[1], atol=1e-9)
    parameters = tmp_path / 'p.yaml'
    parameters.write_text('manoeuvring_predictor: {ros__parameters: {mounting_deg: [180, 0, 0]}}')
    for given in (['--mounting', '180,0,0'], ['--params-file', str(parameters)]):
        assert main(['manoeuvre', 'programme', str(bag), *given]) == 0
    assert main(['manoeuvre', 'programme', str(bag)]) == 2
    assert '(--mounting 180,0,0)' in capsys.readouterr().err
    table = tmp_path / 'a.csv'
    table.write_text('time_s,port_command,starboard_command,surge_m_s\n0,1,1,1\n')
    assert main(['manoeuvre', 'programme', str(table), '--mounting', '180,0,0']) == 2
    assert 'is a table' in capsys.readouterr().err


def test_live_the_yaw_rate_is_turned_by_parameter_and_by_transform(monkeypatch):
    rclpy = pytest.importorskip('rclpy')
    from sensor_msgs.msg import Imu
    from std_msgs.msg import Empty

    from swath_sysid.manoeuvring.nodes.predictor import ManoeuvringPredictor
    from swath_sysid.nodes import transforms

    monkeypatch.setattr(transforms, 'message_class', lambda kind: Empty)
    turn = matrix_of(ROTATIONS[0])
    message = Imu()
    message.header.frame_id = 'wamv/imu_link'
    message.angular_velocity.x, message.angular_velocity.y, message.angular_velocity.z = turn.inv().apply([0, 0, 0.3])
    message.angular_velocity_covariance = np.diag([0.04, 0.09, 0.01]).ravel()
    expected = 0.3, (np.diag([0.04, 0.09, 0.01]) @ turn.as_matrix()[2] @ turn.as_matrix()[2]) ** 0.5
    for given in (['-p', 'mounting_deg:=[15,-10,90]'], []):
        rclpy.init(args=['--ros-args', *given])
        node, found = ManoeuvringPredictor(), []
        monkeypatch.setattr(node.pipeline, 'add_yaw_rate', lambda _, *values, found=found: found.append(values))
        try:
            node._on_imu(message)
            if not given:
                assert not found
                node.transforms.take(frames_of(('wamv/base_link', 'wamv/imu_link', turn)))
                node._on_imu(message)
            np.testing.assert_allclose(found, [expected], rtol=1e-9)
        finally:
            node.destroy_node()
            rclpy.shutdown()
