"""Upstream channels of tables and bags, and on the command line; which topics are recorded, and when replayed."""

import numpy as np
import pytest

from swath_sysid.attitude.motion.attitude import quaternion
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats import topics
from swath_sysid.formats.bag_replay import ReplaySettings, Timeline
from swath_sysid.formats.bags import imu_values
from swath_sysid.formats.messages import ImuMessage, header, make, serialised
from swath_sysid.formats.output_bag import is_ours, writing_bag
from swath_sysid.formats.text_tables import write_table
from swath_sysid.formats.topics import IMU
from swath_sysid.formats.upstream_channels import channels_of, field_value, kind_of, read_upstream

FLOAT, RANGE, POINT = 'std_msgs/msg/Float64', 'sensor_msgs/msg/Range', 'geometry_msgs/msg/PointStamped'
TIME = 100.0 + 0.1 * np.arange(1200)
ROLL = 0.1 * np.sin(1.3 * TIME) + 0.04 * np.sin(1.9 * TIME)
PROBE = np.where(np.arange(TIME.size) % 2, np.nan, 2.0 * np.sin(1.3 * TIME + 5.0))


@pytest.fixture
def table(tmp_path):
    path = tmp_path / 'trial.csv'
    write_table(path, {}, {'time_s': TIME, 'roll_rad': ROLL, 'Bow sonar [m]': PROBE, 'empty': np.nan * TIME})
    return path


@pytest.fixture
def bag(tmp_path):
    """An IMU, and half a second late a wave probe without stamps and another craft's IMU with stamps."""
    path, sender = tmp_path / 'trial.mcap', ImuMessage('imu_link')
    force = dict(accel_x=0 * ROLL, accel_y=0 * ROLL, accel_z=9.0 + 0 * ROLL)
    trial = Trial(TIME - TIME[0], roll=ROLL, pitch=0.5 * ROLL, **force)
    start = 1_700_000_000_000_000_000
    with writing_bag(path) as add:
        for time, values in zip(trial.time.tolist(), imu_values(trial), strict=True):
            stamp = start + round(1e9 * time)
            # the recorder's clock is an hour ahead
            received = stamp + 3_600_000_000_000
            add('/imu/data', IMU, received, sender.of_values(stamp, values))
            add('/leader/imu', IMU, received, sender.of_values(stamp - 500_000_000, values))
            add('/wave', FLOAT, received, serialised(make(FLOAT, time)))
    return path


def test_any_column_is_read_at_its_own_times(table):
    series = read_upstream(table, ['Bow sonar [m]'])['Bow sonar [m]']
    np.testing.assert_allclose(series.stamps, TIME[::2])
    np.testing.assert_array_equal(series.values, PROBE[::2])
    assert read_upstream(table, ['bow_sonar_m'])['bow_sonar_m'].values.size == 600
    assert read_upstream(table, []) == {}


@pytest.mark.parametrize(
    ('names', 'said'),
    [
        (
            ['sonar'],
            "no column 'sonar' for an upstream channel; found time_s, roll_rad, Bow sonar.*: choose one of these$",
        ),
        (['roll_rad', 'roll_rad'], "'roll_rad' is given twice"),
        (['empty'], "holds no number in its column 'empty'"),
    ],
)
def test_a_column_that_is_not_there_is_one_sentence_and_exit_code_2(table, capsys, names, said):
    with pytest.raises(InputError, match=said) as refused:
        read_upstream(table, names)
    assert '--column' not in str(refused.value)
    flags = [word for name in names for word in ('--upstream', name)]
    assert main(['play-through', str(table), *flags, '--output', str(table.with_suffix('.mcap'))]) == 2
    assert said.partition(';')[0].replace('\\', '') in ' '.join(capsys.readouterr().err.split())


@pytest.mark.long
def test_topics_are_read_by_header_stamps_or_by_arrival(bag, tmp_path, capsys):
    found = read_upstream(bag, ['/wave', 'leader/imu'], topic='/imu/data')
    assert list(found) == ['/wave', *(f'leader/imu:{each}' for each in ('roll', 'pitch', 'vertical_acceleration'))]
    wave, roll = found['/wave'], found['leader/imu:roll']
    np.testing.assert_allclose(wave.stamps, wave.values, atol=1e-6)
    np.testing.assert_allclose(roll.stamps, TIME - TIME[0] - 0.5, atol=1e-6)
    np.testing.assert_allclose(roll.arrivals, TIME - TIME[0], atol=1e-6)
    np.testing.assert_allclose(roll.values, ROLL, atol=1e-9)
    assert (found['leader/imu:vertical_acceleration'].values < -0.7).all()
    with pytest.raises(InputError, match='holds no topic /waves .did you mean /wave'):
        read_upstream(bag, ['/waves'], topic='/imu/data')
    output = tmp_path / 'out.mcap'
    words = ['play-through', str(bag), '--topic', '/imu/data', '--upstream', '/wave', '--output', str(output)]
    assert main(words) == 0 and output.exists()


def test_the_fields_and_types_of_messages_and_an_imu_without_orientation_is_lost():
    with pytest.raises(InputError, match="'a:y' is no upstream channel"):
        channels_of('a:y', FLOAT)
    turned = tuple(float(part) for part in quaternion(0.2, -0.1, 1.0))
    vector, nine = (0.0, 0.0, 9.0), np.zeros(9)
    imu = make(IMU, header(1, ''), turned, nine, vector, nine, vector, nine)
    assert [field_value(imu, IMU, field) for field in ('roll', 'pitch')] == pytest.approx([0.2, -0.1])
    assert field_value(imu, IMU, 'vertical_acceleration') == pytest.approx(9.0 * np.cos(0.2) * np.cos(0.1) - 9.80665)
    assert [kind_of(f'a:{field}', []) for field in ('data', 'range', 'x', 'pitch')] == [FLOAT, RANGE, POINT, IMU]
    with pytest.raises(InputError, match='no type has a field depth: choose of data, range'):
        kind_of('a:depth', [])
    vector, nine = (0.0, 0.0, 9.8), np.zeros(9)
    for unknown, turned in ((-1.0, (0.0, 0.0, 0.0, 1.0)), (0.0, (np.nan, 0.0, 0.0, 1.0))):
        imu = make(IMU, header(1, ''), turned, np.array([unknown, *nine[1:]]), vector, nine, vector, nine)
        assert all(np.isnan(field_value(imu, IMU, field)) for field in ('roll', 'pitch', 'vertical_acceleration'))


@pytest.mark.parametrize('namespace', ['', '/fleet/boat_2'])
@pytest.mark.parametrize(
    'topic, kind, taken',
    [
        ('imu/data', IMU, True),
        ('forecast/lead_0_5s', IMU, True),
        ('forecast/horizon', topics.TRAJECTORY, True),
        ('forecast/horizon', IMU, False),
        ('identifier/progress', 'std_msgs/msg/Float32', True),
        (topics.point_lead_topic('bow', 2.0), topics.ODOMETRY, True),
        (topics.point_acceleration_topic('bow', 2.0), topics.ACCELERATION, True),
        ('imu/data_raw', IMU, False),
        ('odometry', topics.ODOMETRY, False),
    ],
)
def test_topics_of_the_contract_are_recorded(namespace, topic, kind, taken):
    assert is_ours(f'{namespace}/{topic}', [kind]) == taken
    assert not is_ours(f'{namespace}/{topic}', [kind, 'std_msgs/msg/String'])


@pytest.mark.parametrize('rate', [0.5, 1.0, 20.0])
def test_bag_time_is_the_inverse_of_wall_time(rate):
    timeline = Timeline(begun=100.0, first_ns=1_700_000_000_000_000_000, rate=rate)
    later = timeline.first_ns + 3_000_000_000
    assert timeline.wall_time(timeline.first_ns) == 100.0
    assert timeline.wall_time(later) == pytest.approx(100.0 + 3.0 / rate)
    assert timeline.bag_time(timeline.wall_time(later)) == pytest.approx(later, abs=2000)


@pytest.mark.parametrize('settings', [{'rate': 0.0}, {'rate': float('nan')}, {'wait': -1.0}, {'listeners': -1}])
def test_settings_that_cannot_be_are_refused(settings):
    with pytest.raises(InputError, match='must'):
        ReplaySettings(**settings)
