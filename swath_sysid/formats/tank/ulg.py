"""PX4 logs.

The orientation is that of ``vehicle_attitude`` (forward-right-down), with the rates and accelerations of the vehicle,
or those of ``sensor_combined``, at its times.
"""

from pathlib import Path

import numpy as np

from swath_sysid.common.advice import counted
from swath_sysid.common.errors import InputError
from swath_sysid.formats.text_tables import NamedColumns, check_size, damage, of_arrays

#: Topic, names of its fields, and the columns that they are: of each kind the first topic that a log holds.
FURTHER = (
    (('vehicle_angular_velocity', 'xyz[{}]'), ('sensor_combined', 'gyro_rad[{}]'), 'gyro_{}_rad_s'),
    (('vehicle_acceleration', 'xyz[{}]'), ('sensor_combined', 'accelerometer_m_s2[{}]'), 'accel_{}_m_s2'),
)


def tables(path: str | Path) -> list[NamedColumns]:
    """The one table of the attitude."""
    from pyulog import ULog

    wanted = ['vehicle_attitude', *dict.fromkeys(topic for *topics, _ in FURTHER for topic, _ in topics)]
    log = ULog(str(path), wanted)
    found = {each.name: each.data for each in reversed(log.data_list)}
    if 'vehicle_attitude' not in found:
        raise InputError(f'{path} is a PX4 log without the topic vehicle_attitude: log it (SDLOG_PROFILE)')
    attitude = found['vehicle_attitude']
    stamps = attitude['timestamp'].astype(float)
    check_size(path, 11 * stamps.size)
    columns = {'time_us': stamps, **{f'q{part}': attitude[f'q[{k}]'].astype(float) for k, part in enumerate('wxyz')}}
    for *topics, column in FURTHER:
        topic, field = next(((topic, field) for topic, field in topics if topic in found), ('', ''))
        for k, part in enumerate('xyz' if topic else ''):
            at, values = found[topic]['timestamp'].astype(float), found[topic][field.format(k)].astype(float)
            columns[column.format(part)] = np.interp(stamps, at, values, left=np.nan, right=np.nan)
    said = ['parts of it cannot be read'] if getattr(log, 'file_corruption', False) else []
    if dropouts := getattr(log, 'dropouts', ()):
        said.append(f'the logger dropped messages {counted(len(dropouts), "time")}')
    return [of_arrays(columns, {'frame': 'frd'}, '', damage(', '.join(said)))]
