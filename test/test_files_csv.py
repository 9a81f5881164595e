"""CSV trials: units, delimiters, damage, and the way back."""

from dataclasses import replace

import numpy as np
import pytest
from repository import RECORDS

from swath_sysid.attitude.motion.trial import CHANNELS, FURTHER_CHANNELS, Trial
from swath_sysid.common.errors import InputError
from swath_sysid.formats import text_tables
from swath_sysid.formats.columns import agree, plain_name
from swath_sysid.formats.csv_trials import read_csv, write_csv


def codes(trial):
    return [advice.code for advice in trial.advice]


def written(folder, text, name='trial.csv'):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def lines(header, *columns, mark=','):
    rows = (mark.join(f'{value:.9g}' for value in row) for row in zip(*columns, strict=True))
    return header + '\n' + '\n'.join(rows) + '\n'


TIME = np.arange(20) * 0.1
ROLL = np.round(0.2 * np.sin(TIME), 6)


@pytest.mark.parametrize('name', ['time_ms', 'time_us', 't_s', 'stamp_s', 'Timestamp (ns)', 'Time [ms]'])
def test_time_units(tmp_path, name):
    scale = {'s': 1, 'ms': 1e3, 'us': 1e6, 'ns': 1e9}[plain_name(name).split('_')[-1]]
    trial = read_csv(written(tmp_path, lines(f'{name},roll_rad', scale * TIME, ROLL)))
    assert np.allclose(trial.time, TIME, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize(
    'name,scale,channel',
    [
        ('Roll (°)', 180 / np.pi, 'roll'),
        ('roll_rate_dps', 180 / np.pi, 'roll_rate'),
        ('Pitch rate [rad/s]', 1, 'pitch_rate'),
        ('roll_rad,acc_z (m/s²)', 1, 'accel_z'),
        ('roll_rad,linear_acceleration_z [m/s^2]', 1, 'accel_z'),
        ('roll_rad,accel_z_g', 1 / 9.80665, 'accel_z'),
    ],
)
def test_units_and_spellings_of_channels(tmp_path, name, scale, channel):
    values = 9.81 + ROLL if channel == 'accel_z' else ROLL
    columns = [ROLL] * name.count(',') + [scale * values]
    trial = read_csv(written(tmp_path, lines(f'time_s,{name}', TIME, *columns)))
    assert np.allclose(getattr(trial, channel), values, rtol=1e-7)
    assert trial.advice == ()


def test_quaternions_and_times_of_the_epoch(tmp_path):
    rows = ''.join(f'{t},{x},0,0,{w}\n' for t, x, w in zip(TIME, np.sin(ROLL / 2), np.cos(ROLL / 2), strict=True))
    trial = read_csv(written(tmp_path, 'time_s,orientation.x,orientation.y,orientation.z,orientation.w\n' + rows))
    assert np.allclose(trial.roll, ROLL)
    assert np.allclose(trial.pitch, 0)
    rows = ''.join(f'{1700000000 + at // 10},{at % 10 * 100_000_000},{ROLL[at]}\n' for at in range(20))
    trial = read_csv(written(tmp_path, 'sec,nanosec,roll_rad\n' + rows))
    assert np.allclose(trial.time, TIME, atol=1e-12)
    rows = ''.join(f'{1700000000_000_000_000 + at * 100_000_000},{ROLL[at]}\n' for at in range(20))
    trial = read_csv(written(tmp_path, 'time_ns,roll_rad\n' + rows))
    assert np.allclose(trial.time, TIME, atol=1e-6)


@pytest.mark.parametrize('mark', [',', ' '])
def test_names_in_a_comment_as_savetxt_writes_them(tmp_path, mark):
    np.savetxt(tmp_path / 'saved.txt', np.column_stack([TIME, ROLL]), header=f'time_s{mark}roll_rad')
    assert np.allclose(read_csv(tmp_path / 'saved.txt').roll, ROLL)


def test_remarks(tmp_path):
    head = '# draft_m: 0.154\n# initial_angle_deg: 6\n# frame: frd\n# note: calm\n'
    trial = read_csv(written(tmp_path, head + lines('time_s,pitch_rad', TIME, ROLL)))
    assert trial.draft == 0.154
    assert trial.initial_angle == pytest.approx(np.radians(6))
    assert np.allclose(trial.pitch, -ROLL)
    assert np.allclose(read_csv(trial.source, frame='flu').pitch, ROLL)


@pytest.mark.parametrize('cell,told', [('', []), ('nan', []), ('NA', []), ('ERR', ['text-in-numbers'])])
def test_cells_that_are_no_numbers(tmp_path, cell, told):
    rows = lines('time_s,roll_rad,pitch_rad', TIME, ROLL, ROLL).splitlines()
    rows[5] = f'{TIME[4]},{cell},{ROLL[4]}'
    trial = read_csv(written(tmp_path, '\n'.join(rows)))
    assert np.flatnonzero(np.isnan(trial.roll)).tolist() == [4]
    assert codes(trial) == [*told, 'missing-values']
    if told:
        assert "'ERR' in line 6, column roll_rad" in trial.advice[0].message


def test_cut_off_last_line_repeated_head_and_line_numbers_across_blocks(tmp_path, monkeypatch):
    text = lines('time_s,roll_rad,pitch_rad', TIME, ROLL, ROLL)
    trial = read_csv(written(tmp_path, text + '# again\ntime_s,roll_rad,pitch_rad\n2.0,0.1'))
    assert trial.time[-1] == 2.0 and trial.roll[-1] == 0.1 and np.isnan(trial.pitch[-1])
    assert codes(trial) == ['short-rows', 'missing-values'] and 'line 24' in trial.advice[0].message
    monkeypatch.setattr(text_tables, 'BLOCK_BYTES', 64)
    rows = lines('time_s,roll_rad', TIME, ROLL).splitlines()
    rows[15] = f'{TIME[14]},broken'
    trial = read_csv(written(tmp_path, '\n\n'.join(rows)))
    assert trial.time.size == 20
    assert "'broken' in line 31" in trial.advice[0].message


@pytest.mark.parametrize(
    ('head', 'words'),
    [
        ('# draft_m: deep\ntime_s,roll_rad', 'draft_m: deep'),
        ('# frame: ned\ntime_s,roll_rad', "frame 'ned'"),
        ('# mounting_deg: upside down\ntime_s,roll_rad', 'angles'),
        ('# mounting_deg: 180\ntime_s,roll_rad', 'angles'),
        ('# mounting_deg: 180, 0, nan\ntime_s,roll_rad', 'angles'),
        ('# mounting_deg: 1, 2, 3, 4\ntime_s,roll_rad', 'angles'),
        ('# sample_rate_hz: -100\ntime_samples,roll_rad', "'sample_rate_hz: -100.0'"),
        ('# sample_rate_hz: 0\ntime_samples,roll_rad', 'must be greater than zero'),
        ('time_s,roll', 'without a unit'),
        ('time,roll_rad', 'without a unit'),
        ('hour,roll_rad', '(?s)time_ns.*hour, roll_rad'),
        ('time_s,wave', '(?s)roll_rate_rad_s.*time_s, wave'),
        ('time_s,rol_deg', "'rol_deg': did you mean roll_deg"),
        ('time_s,' + 2_000_000 * 'x', 'longer than 1048576 bytes'),
    ],
)
def test_heads_that_are_refused(tmp_path, head, words):
    with pytest.raises(InputError, match=words):
        read_csv(written(tmp_path, lines(head, TIME, ROLL)))


def test_trial_comes_back_exactly(tmp_path):
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.01, 0.0101, 200)) - 1
    channels = {name: rng.normal(0, 0.3, 200) for name in (*CHANNELS, *FURTHER_CHANNELS)}
    channels['pitch'][17] = np.nan
    trial = Trial(time=time, **channels, draft=0.154, initial_angle=float(np.radians(6)))
    path = tmp_path / 'trial.csv'
    write_csv(path, trial)
    back = read_csv(path)
    assert back.channels.keys() == trial.channels.keys()
    assert np.array_equal(back.time, trial.time)
    assert all(np.array_equal(back.channels[name], channels[name], equal_nan=True) for name in channels)
    assert (back.draft, back.initial_angle) == (trial.draft, trial.initial_angle)
    write_csv(path, replace(trial, pitch=None, accel_x=None, draft=None))
    assert read_csv(path).pitch is None and read_csv(path).draft is None


def test_morro_buoy_is_turned_to_flu():
    path = RECORDS / 'morro_buoy.csv'
    raw = np.genfromtxt(path, delimiter=',', names=True, skip_header=1)
    trial = read_csv(path, frame='frd')
    assert trial.time.size == raw.size and trial.advice == ()
    assert np.mean(trial.accel_z) == pytest.approx(9.81, abs=0.1)
    assert np.allclose(trial.accel_y, -raw['accel_y_m_s2'])
    assert np.allclose(trial.pitch, -np.radians(raw['pitch_deg']))
    # the Euler rates must be the derivatives of the angles: signs and body-to-Euler conversion at once
    yaw = -np.radians(np.unwrap(raw['yaw_deg'], period=360.0))
    derivatives = [np.gradient(angle, trial.time)[1:-1] for angle in (trial.roll, trial.pitch, yaw)]
    rates = [rate[1:-1] for rate in (trial.roll_rate, trial.pitch_rate, trial.yaw_rate)]
    # the buoy fuses gyro and compass into its yaw, which so moves less than it turns
    for rate, derivative, least in zip(rates, derivatives, (0.97, 0.97, 0.89), strict=True):
        assert np.corrcoef(rate, derivative)[0, 1] > least
    assert 0.7 < np.polyfit(rates[2], derivatives[2], 1)[0] < 1.0


def test_yaw_rate_and_heave_of_a_ship_without_gyro_are_read(tmp_path):
    time, angle = np.arange(720.0), 2.0 * np.sin(np.arange(720.0))
    heading, heave = np.round(88.0 + 5.0 * np.sin(0.05 * time), 3), np.round(1.5 * np.cos(0.7 * time), 3)
    table = lines('time_s,roll_deg,pitch_deg,heading_deg,heave_m', time, angle, 0.5 * angle, heading, heave)
    trial = read_csv(written(tmp_path, table))
    assert list(trial.channels) == ['roll', 'pitch', 'yaw_rate', 'heave']
    assert np.array_equal(trial.heave, heave)
    assert np.allclose(trial.yaw_rate[1:], -np.radians(np.diff(heading)))


def test_corrupt_packet_of_a_buoy_is_left_out_and_told(tmp_path):
    packet = '360.1,-9.06778,-1.05882,-572900.5,-572900.5,-572900.5,-572900.5,,,\n'
    trial = read_csv(written(tmp_path, (RECORDS / 'morro_buoy.csv').read_text() + packet), frame='frd')
    assert np.isnan(trial.roll_rate[-1]) and np.isfinite(trial.roll_rate[:-1]).all()
    assert codes(trial) == ['absurd-values', 'missing-values']


def test_a_file_says_how_its_sensor_is_mounted(tmp_path):
    time = np.arange(0.0, 30.0, 0.05)
    roll, pitch = 0.1 * np.sin(time), 0.05 * np.sin(1.3 * time)
    table = lines('time_s,roll_rad,pitch_rad', time, (roll + 2 * np.pi) % (2 * np.pi) - np.pi, pitch)
    path = written(tmp_path, table)
    (told,) = read_csv(path).advice
    assert told.code == 'sensor-turned' and 'mounting_deg to [180, 0, 0]' in told.message
    path.write_text('# mounting_deg: [180, 0, 0]\n' + table)
    trial = read_csv(path)
    assert trial.advice == () and np.allclose(trial.roll, roll) and np.allclose(trial.pitch, pitch)


@pytest.mark.parametrize(
    ('name', 'form'),
    [
        ('time', '2026-05-01T12:00:{:06.3f}'),
        ('timestamp', '2026-05-01 12:00:{:06.3f}'),
        ('time_s', '2026-05-01T14:00:{:06.3f}+02:00'),
        ('datetime', '20260501T1200{:06.3f}Z'),
        ('time', '"2026-05-01T12:00:{:06.3f}Z"'),
    ],
)
def test_dates_are_a_time(tmp_path, form, name):
    seconds = 0.02 * np.arange(500)
    roll = 5.0 * np.sin(2.0 * seconds)
    rows = [f'{angle:.6f},{form.format(second)},1' for second, angle in zip(seconds, roll, strict=True)]
    path = written(tmp_path, '\n'.join([f'roll_deg,{name},count', *rows]))
    trial = read_csv(path)
    assert trial.time == pytest.approx(seconds, abs=1e-6)
    assert np.degrees(trial.roll) == pytest.approx(roll, abs=1e-6) and trial.advice == ()
    # one that is damaged costs its row
    path.write_text(path.read_text().replace(rows[250], rows[250].replace('05', 'xx', 1)))
    trial = read_csv(path)
    assert trial.time.size == 499 and [each.code for each in trial.advice][:2] == ['text-in-numbers', 'missing-stamps']


def test_a_slip_in_a_name_a_column_without_a_unit_and_a_time_that_runs_backwards_are_reported(tmp_path):
    for name, meant in (('rol_rate_deg_s', 'roll_rate_deg_s'), ('gyro_x_rads', 'gyro_x_rad_s'), ('roll_deg_raw', None)):
        trial = read_csv(written(tmp_path, lines(f'time_s,roll_deg,{name}', TIME, 50 * ROLL, ROLL)))
        assert codes(trial) == (['columns-misspelt'] if meant else [])
        assert meant is None or f"'{name}': did you mean {meant}?" in trial.advice[0].message
    trial = read_csv(written(tmp_path, lines('time_s,roll_rad,pitch', TIME, ROLL, ROLL)))
    assert trial.pitch is None and codes(trial) == ['unit-missing']
    with pytest.raises(InputError, match='backwards, from 1.9 to 0 s'):
        read_csv(written(tmp_path, lines('time_s,roll_rad', TIME[::-1], ROLL)))


@pytest.mark.parametrize(
    'apart, size, is_same', [(0.015, 1.0, True), (0.025, 1.0, False), (9e-4, 1e-3, True), (1.2e-3, 1e-3, False)]
)
def test_two_columns_of_a_quantity_agree_within_two_hundredths_or_a_thousandth_in_si(apart, size, is_same):
    values = size * np.sin(np.linspace(0.0, 60.0, 1000))
    assert agree(values, values + apart) == is_same


@pytest.mark.parametrize('broken, is_read', [(40, True), (60, False)])
def test_degrees_called_rad_are_refused_but_not_for_a_few_broken_packets(tmp_path, broken, is_read):
    roll = 0.1 * np.sin(np.linspace(0.0, 60.0, 1000))
    roll[:: 1000 // broken][:broken] = 500.0
    path = tmp_path / 'a.csv'
    path.write_text('time_s,roll_rad\n' + ''.join(f'{0.1 * k},{value}\n' for k, value in enumerate(roll)))
    if is_read:
        read_csv(path)
    else:
        with pytest.raises(InputError, match='more than an angle in rad'):
            read_csv(path)


@pytest.mark.parametrize('samples, is_told', [(10, True), (6, False)])
def test_the_other_unit_is_likely_only_of_a_motion_that_turns_slowly(tmp_path, samples, is_told):
    rows = ''.join(f'{0.1 * k:.1f},{0.1 * np.sin(2.0 * np.pi * k / samples)}\n' for k in range(600))
    (tmp_path / 'a.csv').write_text('time_s,roll_deg\n' + rows)
    assert ('other-unit-likely' in [a.code for a in read_csv(tmp_path / 'a.csv').advice]) == is_told
