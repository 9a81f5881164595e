"""Records that hold two devices: each is read alone, by its name, and none is mixed with the other."""

from functools import reduce
from operator import xor

import numpy as np
import pytest

from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.reading import read_trial

TIME = 0.1 * np.arange(300)
ROLL = {'fore': 6.0 * np.sin(2.1 * TIME), 'aft': 2.0 + 3.0 * np.cos(1.7 * TIME)}
PITCH = {'fore': 1.5 * np.cos(2.4 * TIME), 'aft': 2.5 * np.sin(3.1 * TIME)}


def sentence(said):
    return f'${said}*{reduce(xor, said.encode()):02X}'


def nmea():
    for at, t in enumerate(TIME):
        yield sentence(f'GPZDA,12{int(t // 60):02d}{t % 60:05.2f},27,11,2026,00,00')
        for talker, name in (('YX', 'fore'), ('TI', 'aft')):
            yield sentence(f'{talker}XDR,A,{PITCH[name][at]:.6f},D,TRIM,A,{ROLL[name][at]:.6f},D,Fore HEEL')


def influx():
    """As its client exports it: a table for each series, of which the header is repeated."""
    for name in ROLL:
        for field, values in (('roll_deg', ROLL[name]), ('pitch_deg', PITCH[name])):
            yield '#datatype,string,long,dateTime:RFC3339,double,string,string,string'
            yield ',result,table,_time,_value,_field,_measurement,device'
            for t, value in zip(TIME, values, strict=True):
                yield f',,0,2026-05-01T12:00:{t:09.6f}000Z,{value:.6f},{field},attitude,{name}'


def long_rows():
    yield 'time_ms;sensor;quantity;unit;value'
    for at, t in enumerate(TIME):
        for name in ROLL:
            for quantity, values in (('Roll', ROLL[name]), ('Pitch', PITCH[name])):
                yield f'{1e3 * t:.0f};{name};{quantity};deg;{values[at]:.6f}'.replace('.', ',')


def wide(header):
    yield from header
    for at, t in enumerate(TIME):
        yield ','.join(f'{value:.6f}' for value in (t, *(each[name][at] for name in ROLL for each in (ROLL, PITCH))))


def rows_by_sensor():
    """With another device, which has no motion, between them."""
    yield 'time_s,sensor,roll_deg,pitch_deg,depth_m'
    for at, t in enumerate(TIME):
        yield from (f'{t:.3f},{name},{ROLL[name][at]:.6f},{PITCH[name][at]:.6f},' for name in ROLL)
        yield f'{t:.3f},sonar,,,12.5'


SERIES = ('/nav/fore/roll_deg', '/nav/fore/pitch_deg', '/nav/aft/roll_deg', '/nav/aft/pitch_deg')
LABELS = [f'"{reading}_deg{{place={name}}}"' for name in ROLL for reading in ('roll', 'pitch')]
BODIES = (
    ',fore,fore,aft,aft',
    ',Rotation,Rotation,Rotation,Rotation',
    'Time (s),Roll [deg],Pitch [deg]' + ',Roll [deg],Pitch [deg]',
)
KINDS = {
    'nmea.log': (nmea(), {'fore': 'YX', 'aft': 'TI'}),
    'influx.csv': (influx(), {}),
    'long.csv': (long_rows(), {}),
    'rows.csv': (rows_by_sensor(), {}),
    'plotjuggler.csv': (wide([','.join(('__time', *SERIES))]), {'fore': 'nav/fore', 'aft': 'nav/aft'}),
    'prometheus.csv': (wide([','.join(('time_s', *LABELS))]), {'fore': 'place=fore', 'aft': 'place=aft'}),
    'motive.csv': (wide(BODIES), {}),
    'qualisys.csv': (wide(['BODY_NAMES,fore,aft', BODIES[-1]]), {}),
}


@pytest.mark.parametrize('kind', KINDS)
def test_two_devices_are_named_and_each_can_be_chosen(tmp_path, capsys, kind):
    lines, names = KINDS[kind]
    path = tmp_path / kind
    path.write_text('\n'.join(lines) + '\n')
    columns = {'time': '__time:s'} if 'plot' in kind else {}
    with pytest.raises(InputError, match='holds 2 tables') as refused:
        read_trial(path, columns=columns)
    side = -1 if kind.startswith('nmea') else 1
    for device in ROLL:
        name = names.get(device, device)
        assert name in str(refused.value)
        trial = read_trial(path, columns={**columns, 'device': name})
        assert trial.time - trial.time[0] == pytest.approx(TIME, abs=1e-4)
        assert np.degrees(trial.roll) == pytest.approx(ROLL[device], abs=1e-5)
        assert np.degrees(trial.pitch) == pytest.approx(side * PITCH[device], abs=1e-5)
    if kind == 'long.csv':
        assert main(['inspect', str(path), '--device', name]) == 0
        assert main(['inspect', str(path), '--device', 'mid']) == 2
        assert 'choose from fore, aft' in capsys.readouterr().err


@pytest.mark.parametrize('other', [0.004, 0.1 / 3])
def test_two_sensors_joined_with_empty_cells_keep_their_own_stamps(tmp_path, other):
    """As pandas merges them: with every stamp of either."""
    sent = [(t, f'{6 * np.sin(2 * t):.9f},') for t in TIME]
    sent += [(t + other, f',{12 * np.cos(2 * (t + other)):.9f}') for t in np.arange(0.0, 30.0, 0.05)]
    rows = [f'{t:.9f},{cells}' for t, cells in sorted(sent)]
    (tmp_path / 'joined.csv').write_text('\n'.join(['time_s,roll_deg,roll_rate_deg_s', *rows]))
    trial = read_trial(tmp_path / 'joined.csv')
    assert trial.time == pytest.approx(TIME) and np.degrees(trial.roll) == pytest.approx(6 * np.sin(2 * TIME))
    known = np.isfinite(trial.roll_rate)
    assert known.sum() > 297
    assert np.degrees(trial.roll_rate[known]) == pytest.approx(12 * np.cos(2 * TIME[known]), abs=0.02)
    assert [each.code for each in trial.advice][0] == 'joined-sensors'


def test_a_name_that_two_columns_bear_chooses_neither(tmp_path):
    rows = [f'{t:.2f},{6 * np.sin(t):.4f},{2 * np.cos(t):.4f}' for t in TIME]
    (tmp_path / 'twice.csv').write_text('\n'.join(['time_s,X,X', *rows]))
    with pytest.raises(InputError, match="2 columns 'X'"):
        read_trial(tmp_path / 'twice.csv', columns={'roll': 'X:deg'})


@pytest.mark.parametrize('later', [0.0, 0.01])
def test_two_times_are_one_only_if_they_are_equal(tmp_path, later):
    rows = zip(TIME, ROLL['fore'], TIME + later, PITCH['fore'], strict=True)
    path = tmp_path / 'twice.csv'
    path.write_text('\n'.join(['time_s,roll_deg,time_s.1,pitch_deg', *(','.join(map(str, row)) for row in rows)]))
    if later:
        with pytest.raises(InputError, match=r'2 tables that can be read \(time_s, time_s.1\)'):
            read_trial(path)
        trial = read_trial(path, columns={'device': 'time_s.1'})
        assert trial.roll is None and trial.time == pytest.approx(TIME + later)
        return
    trial = read_trial(path)
    assert np.degrees(trial.roll) == pytest.approx(ROLL['fore']) and np.degrees(trial.pitch) == pytest.approx(
        PITCH['fore']
    )


@pytest.mark.parametrize('parts,unit', [('123', 'deg'), ('123', ''), ('0123', '')])
def test_numbered_parts_of_three_are_angles_and_without_a_sign_of_their_unit_are_refused(tmp_path, parts, unit):
    """The yaw goes beyond two pi, which a yaw in radians may too; roll and pitch only in degrees."""
    scale = 1.0 if unit else np.pi / 180.0
    angles = [ROLL['fore'] * scale, PITCH['fore'] * scale, 30.0 + 100.0 * np.sin(0.2 * TIME), 0 * TIME][: len(parts)]
    rows = zip(TIME, *angles, strict=True)
    path = tmp_path / 'vector.csv'
    names = ','.join(f'attitude_{part}' for part in parts)
    path.write_text('\n'.join([f'time_s,{names}', *(','.join(map(str, row)) for row in rows)]))
    if not unit:
        with pytest.raises(InputError):
            read_trial(path)
        return
    trial = read_trial(path)
    assert np.degrees(trial.roll) == pytest.approx(ROLL['fore']) and np.degrees(trial.pitch) == pytest.approx(
        PITCH['fore']
    )
