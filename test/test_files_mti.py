"""MTi exports in the forms in which MT Manager writes them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion.attitude import euler_rates, quaternion
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

COUNT = 60
TIME = 0.01 * np.arange(COUNT)
ROLL, PITCH, YAW = 0.2 * np.sin(9 * TIME), 0.1 * np.cos(5 * TIME), 0.5 + 0.1 * TIME
GYRO = np.column_stack([np.cos(9 * TIME), np.sin(5 * TIME), 0.1 + 0 * TIME])
FORCE = np.column_stack([0 * TIME, 0.5 * np.sin(TIME), 9.81 + 0 * TIME])

HEAD = '// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Option Flags: AHS Disabled ICC Disabled\n'
EULER = {'Roll': np.degrees(ROLL), 'Pitch': np.degrees(PITCH), 'Yaw': np.degrees(YAW)}
QUATERNION = dict(zip(('Quat_q1', 'Quat_q2', 'Quat_q3', 'Quat_q0'), quaternion(ROLL, PITCH, YAW), strict=True))
INERTIAL = dict(zip(('Acc_X', 'Acc_Y', 'Acc_Z', 'Gyr_X', 'Gyr_Y', 'Gyr_Z'), [*FORCE.T, *GYRO.T], strict=True))
COUNTER = {'PacketCounter': np.arange(100, 100 + COUNT)}
TICKS = {'SampleTimeFine': 5000 + 100 * np.arange(COUNT)}
TURNS = Rotation.from_euler('ZYX', np.column_stack([YAW, PITCH, ROLL])).as_matrix()
MATRIX = {f'Mat[{row + 1}][{column + 1}]': TURNS[:, row, column] for column in range(3) for row in range(3)}


def export(folder, columns, head=HEAD, mark='\t'):
    """A file as MT Manager writes it; a column of None is empty, as for what the sensor did not send."""
    cells = [[''] * COUNT if each is None else [f'{value:.12g}' for value in each] for each in columns.values()]
    path = folder / 'MT_0370.txt'
    path.write_text(head + '\n'.join(mark.join(row) for row in (columns, *zip(*cells, strict=True))) + '\n')
    return path


@pytest.mark.parametrize('mark', ['\t', ',', ';', ' '])
@pytest.mark.parametrize('orientation', ['euler', 'quaternion', 'matrix'])
def test_export_is_read(tmp_path, mark, orientation):
    angles = {'euler': EULER, 'quaternion': QUATERNION, 'matrix': MATRIX}[orientation]
    trial = read_trial(export(tmp_path, {**COUNTER, **TICKS, **INERTIAL, **angles}, mark=mark))
    assert [each.code for each in trial.advice] == ['columns-understood'] * (orientation != 'euler')
    assert np.allclose(trial.time, TIME)
    assert np.allclose(trial.roll, ROLL) and np.allclose(trial.pitch, PITCH)
    expected = euler_rates(ROLL, PITCH, *GYRO.T)
    assert np.allclose(trial.roll_rate, expected[0]) and np.allclose(trial.pitch_rate, expected[1])
    assert np.allclose(trial.accel_y, FORCE[:, 1]) and np.allclose(trial.accel_z, FORCE[:, 2])


@pytest.mark.parametrize('line', ['// Update Rate: 50.0Hz', '// Sample rate: 50 Hz', '// Output Rate: 50,0Hz'])
def test_counter_uses_the_update_rate(tmp_path, line):
    # columns never sent are empty
    unsent = dict.fromkeys(['SampleTimeFine', 'Year', 'Month', 'Day', 'Second', 'UTC_Nano', 'UTC_Year', 'UTC_Valid'])
    trial = read_trial(export(tmp_path, {**COUNTER, **unsent, **EULER}, head=line + '\n'))
    assert np.allclose(trial.time - trial.time[0], 2 * TIME)


def test_counters_wrap_and_lost_packets_are_gaps(tmp_path):
    counter = {'PacketCounter': (65536 - 20 + np.arange(COUNT)) % 65536}
    trial = read_trial(export(tmp_path, {**counter, **EULER}))
    assert np.allclose(trial.time - trial.time[0], TIME)
    ticks = {'SampleTimeFine': (2**32 - 3000 + 100 * np.arange(COUNT)) % 2**32}
    trial = read_trial(export(tmp_path, {**counter, **ticks, **EULER}))
    assert np.allclose(trial.time, TIME) and [each.code for each in trial.advice] == ['time-unwrapped']
    counter = COUNTER['PacketCounter'].copy()
    counter[30:] += 7
    trial = read_trial(export(tmp_path, {'PacketCounter': counter, **EULER}))
    assert [advice.code for advice in trial.advice] == ['gaps']
    assert '0.08 s' in trial.advice[0].message


def test_rates_alone_and_frd(tmp_path):
    trial = read_trial(export(tmp_path, {**TICKS, **INERTIAL}), frame='frd')
    assert set(trial.channels) == {'roll_rate', 'pitch_rate', 'yaw_rate', 'accel_x', 'accel_y', 'accel_z'}
    assert np.allclose(trial.yaw_rate, -GYRO[:, 2])
    assert np.allclose(trial.pitch_rate, -GYRO[:, 1]) and np.allclose(trial.accel_z, -FORCE[:, 2])


@pytest.mark.parametrize(
    'columns,head,said',
    [
        (EULER, '// Start Time: Unknown\n', 'no time column'),
        ({**COUNTER, **EULER}, '// Start Time: Unknown\n', 'state the rate'),
        ({**COUNTER, 'Mag_X': TIME}, HEAD, 'no roll or pitch motion'),
        ({**COUNTER, **dict.fromkeys(EULER)}, HEAD, 'at least 8'),
    ],
)
def test_what_is_missing_is_named(tmp_path, columns, head, said):
    with pytest.raises(InputError, match=said):
        read_trial(export(tmp_path, columns, head))
