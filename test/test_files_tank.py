"""Files of data acquisition: each gives the motion that the CSV file of the same record gives."""

import re
import struct
import subprocess
import sys
import zipfile
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats import text_tables as named_columns
from swath_sysid.formats.cells import kind_of_text, seconds_of_text
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.tank import mat
from swath_sysid.formats.vocabulary import plain_name

STEP = 0.05
TIME = STEP * np.arange(400)
ROLL = 6.0 * np.exp(-0.12 * TIME) * np.cos(2.5 * TIME)
COLUMNS = {'time_s': TIME, 'roll_deg': ROLL, 'wave [m]': 0.1 * np.sin(TIME)}


def write_csv(path, columns):
    rows = zip(*columns.values(), strict=True)
    path.write_text(','.join(columns) + '\n' + '\n'.join(','.join(map(repr, map(float, row))) for row in rows))


def write_iso(path, columns):
    start = datetime(2026, 5, 1, 12, tzinfo=UTC)
    rows = zip(*columns.values(), strict=True)
    lines = [f'{(start + timedelta(seconds=t)).isoformat()},' + ','.join(map(str, others)) for t, *others in rows]
    path.write_text('\n'.join([','.join(columns).replace('time_s', 'time'), *lines]))


def variables(columns):
    return {plain_name(name): values for name, values in columns.items()}


def write_mat(path, columns):
    savemat(path, variables(columns), do_compression=True)


def write_mat_struct(path, columns):
    savemat(path, {'record': variables(columns), 'note': 'calm', 'gains': np.arange(3.0)}, oned_as='column')


def write_hdf5(path, columns):
    h5py = pytest.importorskip('h5py')
    with h5py.File(path, 'w', userblock_size=512) as file:
        for name, values in variables(columns).items():
            file.create_dataset(name, data=np.asarray(values)[None, :])
        file.create_group('#refs#')
    with open(path, 'r+b') as file:
        file.write(b'MATLAB 7.3 MAT-file, Platform: GLNXA64'.ljust(512))


def write_tdms(path, columns):
    nptdms = pytest.importorskip('nptdms')
    channels = []
    for name, values in columns.items():
        plain, _, unit = plain_name(name).rpartition('_')
        channels.append(nptdms.ChannelObject('Run 1', plain, values, properties={'unit_string': unit}))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.GroupObject('Setup'), *channels])


def write_lvm(path, columns, segments=1, x_columns='One'):
    """As LabVIEW's 'Write To Measurement File' does, with decimal commas."""
    (_, time), *signals = columns.items()
    labels = [name.rstrip(']').replace(' [', '_').rpartition('_')[::2] for name, _ in signals]
    lines = ['LabVIEW Measurement\t', 'Writer_Version\t2', 'Separator\tTab', 'Decimal_Separator\t,']
    lines += [f'X_Columns\t{x_columns}', 'Time_Pref\tRelative', 'Date\t2026/05/01', '***End_of_Header***\t', '\t']
    for rows in np.array_split(np.arange(time.size), segments):
        lines += [f'Channels\t{len(signals)}\t', f'Samples\t{rows.size}', f'X0\t{time[rows[0]]}\t{time[rows[0]]}']
        lines += ['\t'.join(('Y_Unit_Label', *(unit for _, unit in labels))), 'X_Dimension\tTime\tTime']
        lines += [f'Delta_X\t{STEP}\t{STEP}', '***Start_Special***\t', 'x\t1', '***End_Special***\t']
        lines += ['***End_of_Header***\t', '\t'.join(('X_Value', *(name for name, _ in labels), 'Comment'))]
        first = time if x_columns == 'One' else [''] * time.size
        for row in rows:
            values = (first[row], *(signal[row] for _, signal in signals))
            lines.append('\t'.join(str(value) for value in values).replace('.', ','))
        lines.append('')
    path.write_text('\r\n'.join(lines) + '\r\n', newline='')


def write_xlsx(path, columns):
    openpyxl = pytest.importorskip('openpyxl')
    book = openpyxl.Workbook()
    book.active.title = 'Notes'
    book.active.append(['A decay, in calm water'])
    sheet = book.create_sheet('Run 1')
    for row in (['Model tank'], ['draft_m', 0.154], [], list(columns), *zip(*columns.values(), strict=True)):
        sheet.append([cell.item() if isinstance(cell, np.generic) else cell for cell in row])
    book.save(path)


def write_parquet(path, columns):
    pyarrow = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(columns), path, row_group_size=150)


def write_outb(path, columns):
    """As OpenFAST does without compression."""
    step = columns['time_s'][1] - columns['time_s'][0]
    values = np.column_stack([each for name, each in columns.items() if name != 'time_s'])
    units = [f'({plain_name(name).rpartition("_")[2]})' for name in columns]
    head = struct.pack('<hiiddi', 3, values.shape[1], len(values), columns['time_s'][0], step, 4) + b'calm'
    path.write_bytes(head + b''.join(text.encode().ljust(10) for text in (*columns, *units)) + values.tobytes())


WRITERS = {
    'iso.csv': write_iso,
    '5.mat': write_mat,
    'struct.mat': write_mat_struct,
    '73.mat': write_hdf5,
    'a.tdms': write_tdms,
    'a.lvm': write_lvm,
    'a.xlsx': write_xlsx,
    'a.parquet': write_parquet,
    'a.outb': write_outb,
}
PACKED = [name for name in WRITERS if not name.endswith('.csv')]


@pytest.mark.parametrize('name', WRITERS)
def test_a_motion_is_that_of_the_csv_file(tmp_path, name):
    WRITERS[name](tmp_path / name, COLUMNS)
    trial = read_trial(tmp_path / name)
    assert trial.time == pytest.approx(TIME, abs=1e-6) and np.degrees(trial.roll) == pytest.approx(ROLL)


@pytest.mark.parametrize('name', PACKED)
def test_a_truncated_file_is_one_sentence(tmp_path, name, capsys):
    path = tmp_path / name
    WRITERS[name](path, COLUMNS)
    whole = path.read_bytes()
    for share in (0.001, 0.02, 0.1, 0.3, 0.6, 0.9, 0.99):
        path.write_bytes(whole[: int(share * len(whole))])
        if name in ('a.lvm', 'a.outb') and share > 0.05:  # these keep their rows
            trial = read_trial(path)
            assert 0 < trial.time.size < TIME.size and f'of the {TIME.size} rows' in str(trial.advice)
            continue
        assert main(['inspect', str(path)]) == 2
        said = capsys.readouterr().err
        assert said.count('\n') == 1 and str(path) in said and 'Traceback' not in said


@pytest.mark.long
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    kind=st.sampled_from(['5.mat', '73.mat', 'a.tdms', 'a.xlsx', 'a.parquet']),
    quantity=st.sampled_from(['roll', 'pitch', 'roll_rate', 'gyro_y']),
    unit=st.sampled_from(['rad', 'deg']),
    clock=st.sampled_from(['s', 'ms', 'us']),
    written=st.sampled_from(['{}_{}', '{} [{}]', '{} ({})']),
    spelt=st.sampled_from([str.lower, str.upper, str.title]),
)
def test_names_and_units_are_matched_as_in_csv(tmp_path, kind, quantity, unit, clock, written, spelt):
    unit += '/s' if quantity not in ('roll', 'pitch') else ''
    names = written.format(spelt('time'), clock), written.format(spelt(quantity), unit)
    if kind.endswith('mat'):
        names = [plain_name(name) for name in names]
    scale = {'s': 1.0, 'ms': 1e3, 'us': 1e6}[clock]
    columns = {names[0]: scale * TIME, names[1]: np.radians(ROLL) if 'rad' in unit else ROLL, 'remark': 0 * TIME}
    write_csv(tmp_path / 'a.csv', columns)
    WRITERS[kind](tmp_path / kind, columns)
    found, expected = read_trial(tmp_path / kind), read_trial(tmp_path / 'a.csv')
    assert found.channels.keys() == expected.channels.keys()
    assert np.allclose(found.time, expected.time, atol=1e-9)
    for channel, values in expected.channels.items():
        assert np.allclose(found.channels[channel], values, equal_nan=True, atol=1e-9)


@pytest.mark.parametrize(
    'content',
    [
        {'fs': 1 / STEP, 'roll_deg': ROLL},
        {'dt': STEP, 'record': {'roll_deg': ROLL, 'counts': np.arange(9)}},
        {'run': {'sample_rate': 1 / STEP, 'roll_deg': ROLL[:, None]}},
        {'time_s': TIME, 'record': {'roll_deg': ROLL, 'pitch_deg': 0 * ROLL}},
    ],
)
def test_variables_and_structs_with_a_time_or_a_rate(tmp_path, content):
    savemat(tmp_path / 'a.mat', content)
    trial = read_trial(tmp_path / 'a.mat')
    assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(ROLL)


@pytest.mark.parametrize('layout', [{'segments': 3}, {'x_columns': 'No'}])
def test_segments_of_labview_and_channels_without_a_time(tmp_path, layout):
    write_lvm(tmp_path / 'a.lvm', COLUMNS, **layout)
    trial = read_trial(tmp_path / 'a.lvm')
    assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(ROLL) and trial.advice == ()
    write_lvm(tmp_path / 'a.lvm', {**COLUMNS, 'time_s': 0 * TIME}, segments=2)
    with pytest.raises(InputError, match="2 tables that can be read .segment 1, segment 2.*'roll=segment 1/roll"):
        read_trial(tmp_path / 'a.lvm')


def test_a_waveform_states_its_interval_and_a_group_can_be_chosen(tmp_path):
    nptdms = pytest.importorskip('nptdms')
    path = tmp_path / 'a.tdms'
    units = {'wf_increment': STEP, 'unit_string': 'deg'}
    with nptdms.TdmsWriter(path) as writer:
        for group, sign in (('Run 1', 1.0), ('Run 2', -1.0)):
            writer.write_segment([nptdms.ChannelObject(group, 'Roll', sign * ROLL, properties=units)])
    with pytest.raises(InputError, match='2 tables that can be read .Run 1, Run 2.'):
        read_trial(path)
    # the unit may be left out where the column states it, or the column's unit where it is given
    for source in ('Run 2/Roll [deg]:deg', 'Run 2/Roll [deg]', 'Run 2/Roll:deg', 'Run 2/Roll'):
        trial = read_trial(path, columns={'roll': source})
        assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(-ROLL)


def test_dates_and_units_in_a_row_of_their_own(tmp_path):
    openpyxl = pytest.importorskip('openpyxl')
    book = openpyxl.Workbook()
    start = datetime(2026, 5, 1, 12)
    rows = [[start + timedelta(milliseconds=1000 * t), float(r), None] for t, r in zip(TIME, ROLL, strict=True)]
    # the unit of a column that is not read need not be known
    for row in (['Decay'], ['Time', 'Roll', 'Remark'], ['', 'deg', 'mm'], rows[0][:2] + ['release'], *rows[1:], []):
        book.active.append(row)
    book.save(tmp_path / 'a.xlsx')
    trial = read_trial(tmp_path / 'a.xlsx')
    assert trial.time == pytest.approx(TIME, abs=1e-6) and np.degrees(trial.roll) == pytest.approx(ROLL)


@pytest.mark.long
def test_assigned_columns_on_the_command_line(tmp_path, capsys):
    path = tmp_path / 'a.mat'
    savemat(path, {'t': TIME, 'Phi': ROLL, 'data': np.column_stack([TIME, ROLL, ROLL / 2]), 'roll_deg': 0 * ROLL})
    assert main(['inspect', str(path)]) == 2
    assert "column 't' without a unit" in (said := capsys.readouterr().err) and "as in 'time=t:s' (--column" in said
    assert main(['inspect', str(path), '--column', 'time=t:s', '--column', 'roll=Phi:deg', '--json']) == 0
    capsys.readouterr()
    trial = read_trial(path, columns={'time': 't:s', 'roll': 'data(:,3):deg'})
    assert np.degrees(trial.roll) == pytest.approx(ROLL / 2)
    for assigned, words in (
        ({'roll': 'Phy:deg'}, 'no column .Phy. .did you mean Phi.*t, Phi, data'),
        ({'roll': 'Phi:mm'}, "'roll=Phi:mm' states no unit of roll: end it with :rad or :deg"),
        ({'roll': 'Phi:rad'}, "'Phi' goes to 6, .* if it is in degrees, assign it with that unit"),
        ({'roll': 'Phi'}, "'roll=Phi' states no unit of roll"),
        ({'rol': 'Phi:deg'}, "no quantity 'rol' .did you mean roll..: choose from time, roll, pitch"),
    ):
        with pytest.raises(InputError, match=words):
            read_trial(path, columns={'time': 't:s', **assigned})
    assert main(['inspect', str(path), '--column', 'Phi']) == 2
    assert "'Phi' is not QUANTITY=NAME:UNIT" in capsys.readouterr().err


def test_what_is_missing_or_too_large_is_one_sentence(tmp_path, monkeypatch):
    for name in ('a.xlsx', '73.mat', 'a.tdms', 'a.parquet', '5.mat', 'a.lvm', 'a.outb'):
        path = tmp_path / name
        WRITERS[name](path, COLUMNS)
        with monkeypatch.context() as changed:
            changed.setattr(named_columns, 'LARGEST_UNPACKED', 1000)
            with pytest.raises(InputError, match='more than 1e.03'):
                read_trial(path)
    assert named_columns.LARGEST_UNPACKED > 200e6
    monkeypatch.setitem(sys.modules, 'openpyxl', None)
    with pytest.raises(InputError, match='pip install openpyxl'):
        read_trial(tmp_path / 'a.xlsx')
    savemat(tmp_path / 'empty.mat', {'note': 'nothing'})
    with pytest.raises(InputError, match='without columns of numbers'):
        read_trial(tmp_path / 'empty.mat')
    for content in (bytes(range(256)), b'not a record\n1 2\n3 4\n5 6\n'):
        (tmp_path / 'other.tdms').write_bytes(content)
        with pytest.raises(InputError, match='named .tdms but is no such file'):
            read_trial(tmp_path / 'other.tdms')
    savemat(tmp_path / 'two.mat', {'one': {'x': TIME, 'y': TIME}, 'other': {'z': ROLL, 'w': ROLL}})
    with pytest.raises(InputError, match='2 tables, one/x, one/y, other/z, other/w; of the first: .* no time column'):
        read_trial(tmp_path / 'two.mat')


def sentence(body):
    checksum = 0
    for byte in body.encode():
        checksum ^= byte
    return f'${body}*{checksum:02X}'


@pytest.mark.parametrize(
    'form',
    [
        'PASHR,{clock},90.00,T,{roll:.4f},{pitch:.4f},0.1,0.1,0.1,0.1,1,1',
        'GPZDA,{clock},01,05,2026,00,00|IIXDR,A,{pitch:.4f},D,PTCH,A,{roll:.4f},D,ROLL',
        'GPRMC,{clock},A,5000.0,N,00100.0,E,1.0,90.0,010526,,|PRDID,{pitch:.4f},{roll:.4f},90.0',
    ],
)
def test_sentences_of_nmea_hold_the_attitude_in_forward_right_down(tmp_path, form):
    clocks = [f'{2359 if t < 10 else 0:04d}{50 + t if t < 10 else t - 10:05.2f}' for t in TIME]
    told = [form.format(clock=clock, roll=angle, pitch=0.5 * angle) for clock, angle in zip(clocks, ROLL, strict=True)]
    lines = [sentence(body) for line in told for body in line.split('|')]
    damaged = lines[-1].replace('*', '1*')
    (tmp_path / 'a.log').write_text('\r\n'.join([*lines, damaged]))
    trial = read_trial(tmp_path / 'a.log')
    assert trial.time - trial.time[0] == pytest.approx(TIME, abs=1e-6)
    assert np.degrees(trial.roll) == pytest.approx(ROLL, abs=1e-4)
    assert np.degrees(trial.pitch) == pytest.approx(-0.5 * ROLL, abs=1e-4)
    (tmp_path / 'a.log').write_text(sentence('GPGGA,120000,5000.0,N,00100.0,E,1,08,0.9,1,M,1,M,,'))
    with pytest.raises(InputError, match='without a sentence of the attitude'):
        read_trial(tmp_path / 'a.log')


def test_sentences_behind_the_time_of_a_logger_and_with_wrong_checksums(tmp_path):
    start = datetime(2026, 5, 1, 23, 59, 50, tzinfo=UTC)
    lines = [
        f'{(start + timedelta(seconds=t)).isoformat()} {sentence(f"PSXN,23,{angle:.4f},0.0000,90.0,0.0")}'
        for t, angle in zip(TIME, ROLL, strict=True)
    ]
    lines[5::40] = [line.replace('PSXN,23,', 'PSXN,23,9') for line in lines[5::40]]
    (tmp_path / 'a.txt').write_text('\n'.join(['!AIVDM,1,1,,A,15M,0*00', *lines]))
    trial = read_trial(tmp_path / 'a.txt')
    kept = np.delete(np.arange(TIME.size), np.s_[5::40])
    assert trial.time - trial.time[0] == pytest.approx(TIME[kept]) and trial.advice[0].code == 'damaged-sentences'
    assert np.degrees(trial.roll) == pytest.approx(ROLL[kept], abs=1e-4)
    (tmp_path / 'a.txt').write_text('\n'.join(line.replace('.0*', '.1*') for line in lines[::3]) + '\n' + lines[0])
    with pytest.raises(InputError, match='134 of 135 sentences of the attitude .99%. are cut or have a wrong checksum'):
        read_trial(tmp_path / 'a.txt')


def test_a_px4_log_holds_the_attitude_and_the_rates_at_its_times(tmp_path, monkeypatch):
    (tmp_path / 'a.ulg').write_bytes(b'ULog\x01\x12\x35' + bytes(20))
    half, stamps = np.radians(ROLL) / 2.0, 1e6 * TIME.astype('float64') + 5e6
    angle = {'timestamp': stamps, 'q[0]': np.cos(half), 'q[1]': np.sin(half), 'q[2]': 0 * half, 'q[3]': 0 * half}
    rate = np.radians(np.gradient(ROLL, TIME))
    topics = {
        'vehicle_attitude': angle,
        'sensor_combined': {'timestamp': stamps, **{f'gyro_rad[{k}]': rate * (k == 0) for k in range(3)}}
        | {f'accelerometer_m_s2[{k}]': -9.81 * (k == 2) + 0 * half for k in range(3)},
    }
    log = SimpleNamespace(data_list=[SimpleNamespace(name=name, data=data) for name, data in topics.items()])
    monkeypatch.setitem(sys.modules, 'pyulog', SimpleNamespace(ULog=lambda path, wanted: log))
    trial = read_trial(tmp_path / 'a.ulg')
    assert trial.time - trial.time[0] == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(ROLL)
    assert trial.roll_rate == pytest.approx(rate) and np.mean(trial.accel_z) == pytest.approx(9.81, abs=0.1)
    monkeypatch.setitem(sys.modules, 'pyulog', None)
    with pytest.raises(InputError, match='pip install pyulog'):
        read_trial(tmp_path / 'a.ulg')


@pytest.mark.parametrize('clock', ['TimeUS', 'TimeMS'])
def test_an_ardupilot_log_holds_the_attitude_and_the_rates_at_its_times(tmp_path, monkeypatch, clock):
    path, rate = tmp_path / 'a.bin', np.radians(np.gradient(ROLL, TIME))
    path.write_bytes(b'\xa3\x95\x80')
    with monkeypatch.context() as absent:
        absent.setitem(sys.modules, 'pymavlink.DFReader', None)
        with pytest.raises(InputError, match='is an ArduPilot log, and pymavlink, .*: pip install pymavlink'):
            read_trial(path)
    reader = pytest.importorskip('pymavlink.DFReader')
    known = {
        'ATT': (1, 'Qccc', f'{clock},Roll,Pitch,Yaw'),
        'IMU': (2, 'QBffffff', f'{clock},I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ'),
    }
    log = b''
    for name, (number, fields, names) in known.items():
        size = 3 + struct.calcsize(f'<{fields.replace("c", "h")}')
        log += struct.pack('<3s2B4s16s64s', b'\xa3\x95\x80', number, size, *map(str.encode, (name, fields, names)))
        known[name] = reader.DFFormat(number, name, size, fields, names)
    for t, angle, turn in zip(TIME, 100.0 * ROLL, rate, strict=True):
        at = round((1e6 if clock == 'TimeUS' else 1e3) * (t + 5.0))
        imu = [[at, sensor, turn if sensor == 0 else 9.0, 0.0, 0.0, 0.0, 0.0, -9.81] for sensor in (0, 1)]
        for name, values in (*(('IMU', each) for each in imu), ('ATT', [at, round(angle), 0, 0])):
            log += reader.DFMessage(known[name], values, True, None).get_msgbuf()
    for content in (log, log + bytes(100) + log[:50]):
        path.write_bytes(content)
        trial = read_trial(path)
        assert trial.time - trial.time[0] == pytest.approx(TIME) and trial.yaw_rate == pytest.approx(0.0)
        assert np.degrees(trial.roll) == pytest.approx(ROLL, abs=0.0051) and trial.roll_rate == pytest.approx(rate)
    path.write_bytes(log[:300])
    with pytest.raises(InputError, match='at least 8 are needed'):
        read_trial(path)


def test_decimals_compounds_formulas_and_matlab_4(tmp_path):
    pyarrow, h5py, openpyxl = map(pytest.importorskip, ('pyarrow', 'h5py', 'openpyxl'))
    from pyarrow import parquet

    rounded = [Decimal(f'{angle:.6f}') for angle in ROLL]
    parquet.write_table(pyarrow.table({'time_s': TIME, 'roll_deg': rounded}), tmp_path / 'a.parquet')
    compound = np.rec.fromarrays([TIME, ROLL], names='time_s,roll_deg')
    with h5py.File(tmp_path / 'a.h5', 'w') as file:
        file['run'] = compound
    savemat(tmp_path / '4.mat', {'time_s': TIME, 'roll_deg': ROLL}, format='4')
    book = openpyxl.Workbook()
    book.active.append(['time_s', 'Phi', 'roll_deg', 'lost'])
    for row, (t, angle) in enumerate(zip(TIME, np.radians(ROLL), strict=True), 2):
        book.active.append([float(t), f'={float(angle)!r}/2', f'=DEGREES($B{row}*2^1)+0*PI()', '=Sheet2!A1'])
    book.save(tmp_path / 'a.xlsx')
    for name in ('a.parquet', 'a.h5', '4.mat', 'a.xlsx'):
        trial = read_trial(tmp_path / name)
        assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(ROLL, abs=1e-6)
    with pytest.raises(InputError, match="formulas of 'lost' have no stored values"):
        read_trial(tmp_path / 'a.xlsx', columns={'roll': 'lost:deg'})


STRICT = (
    ('http://schemas.openxmlformats.org/spreadsheetml/2006/', 'http://purl.oclc.org/ooxml/spreadsheetml/'),
    ('http://schemas.openxmlformats.org/officeDocument/2006/', 'http://purl.oclc.org/ooxml/officeDocument/'),
)


def test_links_units_and_packed_values_of_hdf5(tmp_path):
    h5py = pytest.importorskip('h5py')
    with h5py.File(tmp_path / 'a.nc', 'w') as file:
        groups = [file.create_group(f'g{at}') for at in range(12)]
        for at, group in enumerate(groups):
            for other in (at + 1, at + 1 if at % 2 else at):  # twice to the next, or in a circle
                group[f'l{at}{len(group)}'] = groups[other % 12]
        file['gone'] = h5py.SoftLink('/nowhere')
        run = groups[11].create_group('run')
        run['time'], run['roll'] = TIME + 8e8, np.round(ROLL / 0.01).astype(int)
        run['roll'][3] = -9999
        run['time'].attrs['units'], run['roll'].attrs['units'] = 'seconds since 2000-01-01', 'degrees'
        run['roll'].attrs['scale_factor'], run['roll'].attrs['_FillValue'] = 0.01, -9999
    trial = read_trial(tmp_path / 'a.nc')
    known = np.arange(TIME.size) != 3
    assert trial.time - trial.time[0] == pytest.approx(TIME, abs=1e-6)
    assert np.degrees(trial.roll[known]) == pytest.approx(ROLL[known], abs=0.0051) and np.isnan(trial.roll[3])
    assert '/gone' in next(each.message for each in trial.advice if each.code == 'dangling-links')
    # another process writes it
    write = "import h5py, sys; file = h5py.File(sys.argv[1], 'a'); print('open', flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, '-c', write, tmp_path / 'a.nc'], stdin=-1, stdout=-1) as other:
        assert other.stdout.readline() == b'open\n'
        with pytest.raises(InputError, match='is open in another program'):
            read_trial(tmp_path / 'a.nc')
        other.stdin.close()


def test_objects_of_matlab_and_sheets_without_names_say_what_to_do(tmp_path, monkeypatch):
    opaque = np.array([(b'run', b'MCOS', b'timeseries', 0)], dtype=[(f's{k}', object) for k in range(4)])
    monkeypatch.setattr(mat, 'loadmat', lambda *_, **__: {'None': mat.MatlabOpaque(opaque)})
    savemat(tmp_path / 'a.mat', {'x': 1.0}, do_compression=True)
    with pytest.raises(InputError, match=r'such as run, a timeseries.*time_s = run.Time; roll_deg = run.Data; save\('):
        read_trial(tmp_path / 'a.mat')
    (tmp_path / 'a.csv').write_text('\n'.join(f'{t:.2f},{angle:.3f}' for t, angle in zip(TIME, ROLL, strict=True)))
    book = pytest.importorskip('openpyxl').Workbook()
    for row in zip(map(float, TIME), map(float, ROLL), strict=True):
        book.active.append(row)
    book.save(tmp_path / 'a.xlsx')
    for name, first in (('a.csv', r'0\.00, 6\.000'), ('a.xlsx', r'0, 6')):
        with pytest.raises(InputError, match=f'no line of column names.*its first row is {first}'):
            read_trial(tmp_path / name)


@pytest.mark.parametrize(
    'written, meant',
    [
        ('27-Nov-2026 10:00:00.250', (2026, 11, 27, 10, 0, 0, 250000)),
        ('27.11.26 10:00:00,250', (2026, 11, 27, 10, 0, 0, 250000)),
        ('27. Dez. 2026 10:00:00', (2026, 12, 27, 10)),
        ('2024-03-22_12:29:38:802127', (2024, 3, 22, 12, 29, 38, 802127)),
        ('2026-11-27 10:00:00.250 UTC', (2026, 11, 27, 10, 0, 0, 250000)),
        ('27/juil./2026 10:00:00', (2026, 7, 27, 10)),
        ('27-Jun-26 10:00:00 PM', (2026, 6, 27, 22)),
    ],
)
def test_dates_as_people_write_them(written, meant):
    assert kind_of_text(written) == 'date'
    assert seconds_of_text(written) == pytest.approx(datetime(*meant, tzinfo=UTC).timestamp(), abs=1e-6)


@pytest.mark.parametrize('habit', ['dimension', 'strict', 'comma'])
def test_sheets_as_other_programs_write_them(tmp_path, habit):
    openpyxl = pytest.importorskip('openpyxl')
    written = [f'{angle:.6f}'.replace('.', ',') if habit == 'comma' else float(angle) for angle in ROLL]
    book = openpyxl.Workbook()
    for row in (('time_s', 'roll_deg'), *zip(map(float, TIME), written, strict=True)):
        book.active.append(row)
    book.save(tmp_path / 'a.xlsx')
    with zipfile.ZipFile(tmp_path / 'a.xlsx') as old, zipfile.ZipFile(tmp_path / 'b.xlsx', 'w') as new:
        for name in old.namelist():
            text = old.read(name).decode()
            if habit == 'dimension':
                # fewer rows, and no second column
                text = re.sub('<dimension ref="[^"]*"', '<dimension ref="A1:A99"', text)
            elif habit == 'strict' and '[Content' not in name:
                for transitional, strict in STRICT:
                    text = text.replace(transitional, strict)
            new.writestr(name, text)
    trial = read_trial(tmp_path / 'b.xlsx')
    assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(ROLL, abs=1e-6)


def test_waveforms_that_start_later_are_shifted(tmp_path):
    nptdms = pytest.importorskip('nptdms')
    said = {'wf_increment': STEP, 'unit_string': 'deg'}
    with nptdms.TdmsWriter(tmp_path / 'a.tdms') as writer:
        first = nptdms.ChannelObject('Run', 'Roll', ROLL[:-3], properties=said | {'wf_start_offset': 0.0})
        later = nptdms.ChannelObject('Run', 'Pitch', ROLL[3:], properties=said | {'wf_start_offset': 3 * STEP})
        writer.write_segment([first, later])
    trial = read_trial(tmp_path / 'a.tdms')
    assert trial.pitch[3:] == pytest.approx(trial.roll[3:]) and np.isnan(trial.pitch[:3]).all()
