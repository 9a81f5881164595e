"""Which topics a recording takes, whatever their namespace."""

import pytest

from swath_sysid.formats.recording import is_ours
from swath_sysid.formats.topics import (
    ACCELERATION,
    IMU,
    ODOMETRY,
    TRAJECTORY,
    point_acceleration_topic,
    point_lead_topic,
)


@pytest.mark.parametrize('namespace', ['', '/fleet/boat_2'])
@pytest.mark.parametrize(
    'topic, kind, taken',
    [
        ('imu/data', IMU, True),
        ('forecast/lead_0_5s', IMU, True),
        ('forecast/horizon', TRAJECTORY, True),
        ('forecast/horizon', IMU, False),
        ('identifier/progress', 'std_msgs/msg/Float32', True),
        (point_lead_topic('bow', 2.0), ODOMETRY, True),
        (point_acceleration_topic('bow', 2.0), ACCELERATION, True),
        ('imu/data_raw', IMU, False),
        ('odometry', ODOMETRY, False),
    ],
)
def test_topics_of_the_contract_are_recorded(namespace, topic, kind, taken):
    assert is_ours(f'{namespace}/{topic}', [kind]) == taken
    assert not is_ours(f'{namespace}/{topic}', [kind, 'std_msgs/msg/String'])
