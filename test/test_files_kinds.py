"""Each row of the table of devices and programs in docs/reference/files.md, on a small file of its kind."""

import re
import shlex
import zipfile
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest
from bag_messages import STORE
from rosbags.rosbag2 import StoragePlugin, Writer
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats import messages as layout
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.topics import IMU

PAGE = (Path(__file__).parents[1] / 'docs/reference/files.md').read_text()
TIME = 0.05 * np.arange(160)
ROLL, PITCH = 6.0 * np.exp(-0.1 * TIME) * np.cos(2.5 * TIME) - 0.4, 1.5 * np.sin(2.0 * TIME)
RATE = np.gradient(ROLL, TIME)
START = datetime(2026, 11, 27, 9, 59, 56, tzinfo=UTC)
QUATERNION = Rotation.from_euler('ZYX', np.column_stack([0 * TIME, PITCH, ROLL]), degrees=True).as_quat()


def dated(form, cut=None, ending=''):
    return [(START + timedelta(seconds=t)).strftime(form)[:cut] + ending for t in TIME]


def table(columns, mark=',', head=''):
    cells = [[cell if isinstance(cell, str) else f'{cell:.10g}' for cell in column] for column in columns.values()]
    return head + '\n'.join(mark.join(row) for row in (columns, *zip(*cells, strict=True))) + '\n'


def sentence(said):
    return f'${said}*{reduce(xor, said.encode()):02X}'


def zipped(path, files):
    with zipfile.ZipFile(path, 'w') as archive:
        for name, text in files.items():
            archive.writestr(name, text)


def sensor_logger(path):
    parts = dict(zip(('qz', 'qy', 'qx', 'qw'), QUATERNION[:, [2, 1, 0, 3]].T, strict=True))
    stamps = {'time': [f'{1_700_000_000_000_000_000 + round(1e9 * t)}' for t in TIME], 'seconds_elapsed': TIME}
    # on Android these are angles about other axes
    angles = {'roll': np.radians(PITCH), 'pitch': np.radians(ROLL), 'yaw': 0 * ROLL}
    rates = {'z': 0 * RATE, 'y': 0 * RATE, 'x': np.radians(RATE)}
    files = {'Orientation.csv': {**stamps, **parts, **angles}, 'Gyroscope.csv': {**stamps, **rates}}
    zipped(path, {name: table(columns) for name, columns in files.items()} | {'Metadata.csv': 'version,device\n3,A\n'})


def phyphox(path):
    rates = {f'Gyroscope {axis} (rad/s)': np.radians(RATE) * (axis == 'x') for axis in 'xyz'}
    zipped(
        path, {'Gyroscope.csv': table({'Time (s)': TIME, **rates}), 'meta/device.csv': 'property,value\nversion,1\n'}
    )


def psoncms(path):
    head = 'time,header,q0,q1,q2,q3,ax,ay,az,p,q,r\n'
    rows = zip(TIME, *QUATERNION[:, [3, 0, 1, 2]].T, np.radians(RATE), strict=True)
    lines = (f',actuator\n{t:.4f},$PSONCMS,{w},{x},{y},{z},0,0,9.81,{p},0,0' for t, w, x, y, z, p in rows)
    path.write_text(head + '\n'.join(lines))


def mti(path):
    columns = {'PacketCounter': np.arange(TIME.size), 'Roll': ROLL, 'Pitch': PITCH, 'Yaw': 0 * ROLL}
    path.write_text(table(columns, '\t', '// Update Rate: 20.0Hz\n'))


def ardupilot(path):
    pytest.importorskip('pymavlink')
    heads = (
        'FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns',
        'FMT, 130, 21, ATT, QccC, TimeUS,Roll,Pitch,Yaw',
    )
    rows = (f'ATT, {1e6 * (t + 5.0):.0f}, {a:.2f}, {b:.2f}, 0.00' for t, a, b in zip(TIME, ROLL, -PITCH, strict=True))
    path.write_text('\n'.join((*heads, *rows)) + '\n')


def nmea(path):
    stamps = dated('%H%M%S.%f', -4)
    rows = zip(stamps, ROLL, -PITCH, strict=True)
    path.write_text('\n'.join(sentence(f'PASHR,{t},120.0,T,{a:.4f},{b:.4f},0.0,0.1,0.1,0.1,1') for t, a, b in rows))


def two_talkers(path):
    rows = zip(dated('%H%M%S.%f', -4), ROLL, -PITCH, strict=True)
    xdr = '{}XDR,A,{:.4f},D,PTCH,A,{:.4f},D,ROLL'
    said = ((f'GPZDA,{t},27,11,2026,00,00', xdr.format('YX', b, a), xdr.format('TI', b, 2 * a)) for t, a, b in rows)
    path.write_text('\n'.join(sentence(each) for row in said for each in row))


def long_form(path):
    head = '#datatype,dateTime:RFC3339,double,string,string\n,_time,_value,_field,device\n'
    stamps = dated('%Y-%m-%dT%H:%M:%S.%f', ending='Z')
    values = {'bow': {'roll_deg': ROLL, 'pitch_deg': PITCH}, 'stern': {'roll_deg': 2 * ROLL, 'pitch_deg': PITCH}}
    rows = (
        f',{t},{values[device][field][at]:.6f},{field},{device}\n'
        for at, t in enumerate(stamps) for device in values for field in values[device]
    )  # fmt: skip
    path.write_text(head + ''.join(rows))


def bodies(path):
    heads = ',bow,bow,stern,stern\n,Rotation,Rotation,Rotation,Rotation\n'
    names = 'Time (Seconds),Roll [deg],Pitch [deg],Roll [deg],Pitch [deg]\n'
    rows = zip(TIME, ROLL, PITCH, 2 * ROLL, PITCH, strict=True)
    path.write_text(heads + names + '\n'.join(','.join(f'{value:.6f}' for value in row) for row in rows))


def two_times(path):
    columns = {'Time [s]': TIME, 'Roll [deg]': ROLL, 'Pitch [deg]': PITCH}
    path.write_text(table(columns | {'Time [s].1': TIME + 0.01, 'Roll [deg].1': 2 * ROLL, 'Pitch [deg].1': PITCH}))


def spreadsheet(path):
    openpyxl = pytest.importorskip('openpyxl')
    book = openpyxl.Workbook()
    book.active.append(['Zeit\n[s]', 'Krängung\n[°]', 'Trimm\n[°]'])
    for row in zip(TIME, ROLL, PITCH, strict=True):
        book.active.append([f'{value:.6f}'.replace('.', ',') for value in row])
    book.save(path)


def netcdf(path):
    h5py = pytest.importorskip('h5py')
    with h5py.File(path, 'w') as file:
        units = 'seconds since 2026-01-01', 'degrees', 'degrees'
        for (name, values), unit in zip({'time': TIME, 'roll': ROLL, 'pitch': PITCH}.items(), units, strict=True):
            file.create_dataset(name, data=values).attrs['units'] = unit


def parquet(path):
    pyarrow, written = pytest.importorskip('pyarrow'), pytest.importorskip('pyarrow.parquet')
    stamps = pyarrow.array([START + timedelta(seconds=t) for t in TIME])
    written.write_table(pyarrow.table({'ts': stamps, 'roll_deg': ROLL, 'pitch_deg': PITCH}), path)


def nortek(path):
    columns = {'Burst_MatlabTimeStamp': 740000.25 + TIME / 86400.0, 'Burst_Roll': ROLL, 'Burst_Pitch': PITCH}
    savemat(path, columns)


def bag(path, *topics):
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, IMU, typestore=STORE)
            for t, parts in zip(TIME, QUATERNION, strict=True):
                stamp = 1_700_000_000_000_000_000 + round(1e9 * t)
                none = np.array([-1.0, *8 * [0.0]])
                zeros = 3 * (0.0,), none
                sent = layout.make(
                    IMU, layout.header(stamp, 'imu'), tuple(map(float, parts)), np.zeros(9), *zeros, *zeros
                )
                writer.write(connection, stamp, STORE.serialize_cdr(sent, IMU))


#: By the first cell of a row of the page: what writes a file of the kind.
KINDS = {
    'Sensor Logger': sensor_logger,
    'phyphox': phyphox,
    'Vakaros Atlas': lambda path: path.write_text(
        table({'timestamp': dated('%Y-%m-%dT%H:%M:%S.%f', ending='-0500'), 'sog_kts': 0 * ROLL + 5.0,
               'hdg_true': 0 * ROLL + 1.0, 'heel': ROLL, 'trim': PITCH})),
    'Expedition': lambda path: path.write_text(
        table({'Utc': [f'{46353.41 + t / 86400.0:.11f}' for t in TIME], 'BSP': TIME, 'AWA': TIME, 'Heel': ROLL,
               'Trim': PITCH})),
    'Signal K': lambda path: path.write_text(
        table({'timestamp': dated('%Y-%m-%dT%H:%M:%S.%f', ending='Z'), 'navigation.attitude.roll': np.radians(ROLL),
               'navigation.attitude.pitch': np.radians(PITCH)})),
    'Xsens MT Manager': mti,
    'Xsens $PSONCMS': psoncms,
    'ArduPilot, text': ardupilot,
    'NMEA 0183': nmea,
    'NMEA 0183, two talkers': two_talkers,
    'InfluxDB': long_form,
    'Motive, Qualisys': bodies,
    'two times in a table': two_times,
    'MATLAB dates': lambda path: path.write_text(
        table({'Time': dated('%d-%b-%Y %H:%M:%S.%f'), 'roll_deg': ROLL, 'pitch_deg': PITCH})),
    'numbered vectors': lambda path: path.write_text(
        table({'stamp': dated('%Y-%m-%d_%H:%M:%S:%f'), 'euler_1': ROLL,
               'euler_2': PITCH, 'euler_3': np.remainder(90.0 * TIME + 180.0, 360.0) - 180.0}, ';')),
    'GPS week and seconds': lambda path: path.write_text(
        table({'GPS Week': 0 * TIME + 2437.0, 'GPS TOW [s]': 1000.0 + TIME, 'roll_deg': ROLL, 'pitch_deg': PITCH})),
    'Excel': spreadsheet,
    'netCDF-4': netcdf,
    'Parquet': parquet,
    'Nortek': nortek,
    'ROS 2': lambda path: bag(path, '/imu/data'),
    'ROS 2, two sensors': lambda path: bag(path, '/bow/imu', '/stern/imu'),
}  # fmt: skip
ROWS = {
    cells[0]: cells[1:]
    for line in PAGE.splitlines()
    if len(cells := line.strip('| ').split(' | ')) == 4 and '`' in cells[3]
}


def test_the_page_lists_what_is_tested():
    assert [*ROWS] == [*KINDS]


@pytest.mark.parametrize('kind', KINDS)
def test_a_small_file_of_each_kind_is_read_by_its_command(tmp_path, kind):
    file, _, command = ROWS[kind]
    path = tmp_path / file.strip('`').replace('BAG', 'bag')
    KINDS[kind](path)
    verb, given, *flags = shlex.split(command.strip('`').removeprefix('swath-sysid '))
    assert (verb, given) == ('inspect', file.strip('`'))
    options = dict(zip(flags[::2], flags[1::2], strict=True))
    device = {'device': options['--device']} if '--device' in options else {}
    trial = read_trial(path, topic=options.get('--topic'), columns=device)
    assert trial.time - trial.time[0] == pytest.approx(TIME, abs=2e-3)
    if 'PSONCMS' in kind:
        # each of other names is said, and no row of another device is one that was cut off
        codes = [each.code for each in trial.advice]
        assert 'columns-understood' in codes and 'empty-rows' in codes and 'short-rows' not in codes
    if trial.roll is None:
        assert np.degrees(trial.roll_rate) == pytest.approx(RATE, abs=1e-3)
        return
    assert np.degrees(trial.roll) == pytest.approx(ROLL, abs=6e-3)
    assert np.degrees(trial.pitch) == pytest.approx(PITCH, abs=6e-3)


@pytest.mark.parametrize('kind', [kind for kind, row in ROWS.items() if '--device' in row[2] or '--topic' in row[2]])
def test_what_has_to_be_chosen_is_named(tmp_path, capsys, kind):
    path = tmp_path / ROWS[kind][0].strip('`').replace('BAG', 'bag')
    KINDS[kind](path)
    assert main(['inspect', str(path)]) == 2
    chosen = re.split('--(?:device|topic) ', ROWS[kind][2].strip('`'))[1].strip("'")
    assert chosen in capsys.readouterr().err


@pytest.mark.parametrize(
    'name,content,cause',
    [
        ('a.nc', b'CDF\x01' + bytes(400), 'netCDF file of version 3: convert'),
        ('a.json', b'{"roll": [1, 2]}', 'a JSON file'),
        ('a.csv', b'<!DOCTYPE html><html>', 'a web page'),
        ('a.csv', b'0.1,2.5\n0.2,2.4\n' * 20, 'no line of column names.* its first row is 0.1, 2.5'),
    ],
)
def test_what_is_no_record_is_refused_for_what_it_is(tmp_path, name, content, cause):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=cause):
        read_trial(tmp_path / name)
