"""Manoeuvring records: CSV, bags, reversed channels, gaps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bag_messages import STORE, break_a_chunk
from manoeuvring_runs import OLD, codes, copy_bag, trial_of
from scipy.io import savemat
from scipy.signal import lfilter

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.formats.bags import read_manoeuvring_bag, write_manoeuvring_bag
from swath_sysid.manoeuvring.formats.csv import read_manoeuvring_csv, write_manoeuvring_csv
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.motion.intake import prepare, prepare_runs
from swath_sysid.manoeuvring.motion.polarity import mirrored
from swath_sysid.manoeuvring.motion.resampling import smoothed
from swath_sysid.manoeuvring.motion.trial import ManoeuvringTrial, turned


@pytest.fixture(scope='module')
def manoeuvres():
    runs = trial_programme(OLD)
    return {k: with_noise(runs[k], RunNoise(), seed) for seed, k in enumerate(('mixed', 'speed_up', 'zigzag_20'))}


@pytest.fixture(scope='module')
def trials(manoeuvres):
    return [trial_of(m, name) for name, m in manoeuvres.items()]


def test_csv_round_trip_dates_a_slip_in_a_name_and_pulses(tmp_path, manoeuvres):
    path = tmp_path / 'mixed.csv'
    write_manoeuvring_csv(path, manoeuvres['mixed'], OLD)
    trial = read_manoeuvring_csv(path)
    assert trial.frame == 'enu'
    assert trial.lever == OLD['lever']
    assert np.allclose(trial.surge, manoeuvres['mixed'].surge, atol=1e-8)
    assert np.array_equal(trial.port, manoeuvres['mixed'].port)
    path = tmp_path / 'run.csv'
    rows = ''.join(f'2026-05-01T12:00:0{k}.5Z,1,1,0.1,0\n' for k in range(9))
    path.write_text('time,port_thrust_n,starboard_thrust_n,surge_m_s,headin_deg\n' + rows)
    trial = read_manoeuvring_csv(path)
    assert np.array_equal(trial.time, np.arange(9.0))
    assert [a.code for a in trial.advice] == ['columns-misspelt'] and 'heading_deg' in trial.advice[0].message
    # pulses are commands about their neutral
    rows = ''.join(f'{0.1 * k:.1f},{1520 + k % 300},1320,1.0,0.0\n' for k in range(400))
    names = 'time_s,port_pwm_us,starboard_pwm_us,surge_m_s,yaw_rate_rad_s'
    path.write_text(f'# frame: enu\n# pwm_neutral_us: 1520\n# pwm_full_us: 1920\n{names}\n{rows}')
    trial = read_manoeuvring_csv(path)
    assert trial.thrust_input == 'command'
    assert trial.port[:2].tolist() == pytest.approx([0.0, 1.0 / 400.0])
    assert np.allclose(trial.starboard, -0.5)
    path.write_text(f'{names}\n{rows}')
    assert read_manoeuvring_csv(path).port[:2].tolist() == pytest.approx([0.05, 0.0525])
    # from 1973 on a time counts from an epoch, and commands a little beyond full ones are commands
    for start, first in ((1.2e8, 0.0), (0.8e8, 0.8e8)):
        rows = ''.join(f'{start + k},1.4,1,0.1\n' for k in range(9))
        path.write_text('time_s,port_command,starboard_command,surge_m_s\n' + rows)
        assert read_manoeuvring_csv(path).time[0] == first


@pytest.mark.parametrize('name', ['run.mcap', 'run.db3', 'run'])
def test_bag_round_trip(tmp_path, manoeuvres, name):
    m = manoeuvres['zigzag_20']
    write_manoeuvring_bag(tmp_path / name, m, start_stamp_ns=1_700_000_000_123_456_789)
    run = prepare(read_manoeuvring_bag(tmp_path / name))
    assert run.thrust_input == 'force'
    assert np.allclose(run.surge, m.surge, atol=1e-6)
    assert np.allclose(run.starboard, m.starboard)
    assert np.allclose(np.angle(np.exp(1j * (run.heading - m.heading))), 0.0, atol=1e-6)


def test_a_broken_chunk_in_a_folder_costs_what_follows(tmp_path):
    steps = np.full(2000, 100.0)
    write_manoeuvring_bag(tmp_path / 'run', simulate(OLD, steps, steps, 0.1))
    break_a_chunk(tmp_path / 'run')
    trial = read_manoeuvring_bag(tmp_path / 'run')
    assert trial.time.size > 500 and trial.advice[0].code == 'damaged-bag'


def test_a_manoeuvre_is_read_from_a_table(tmp_path):
    time = 0.05 * np.arange(400)
    columns = {name: np.cos(time) for name in ('port_command', 'starboard_command', 'yaw_rate_rad_s', 'V')}
    savemat(tmp_path / 'a.mat', {'dt': 0.05, **columns})
    trial = read_manoeuvring_csv(tmp_path / 'a.mat', columns={'surge': 'V:kn'})
    assert trial.surge == pytest.approx(1852 / 3600 * np.cos(time)) and trial.time == pytest.approx(time)


def test_bag_with_joint_states_and_a_twist_in_world_axes(tmp_path, manoeuvres):
    m = manoeuvres['mixed']
    rows, joints = zip(m.heading, m.starboard, m.port, strict=True), 'sensor_msgs/msg/JointState'
    write_manoeuvring_bag(tmp_path / 'plain', m)

    def changed(topic, kind, message):
        if not kind.endswith('Odometry'):
            return []
        heading, *efforts = next(rows)
        twist, c, s = message.twist.twist.linear, np.cos(heading), np.sin(heading)
        twist.x, twist.y = twist.x * c - twist.y * s, twist.x * s + twist.y * c
        names, none = ['right_propeller', 'left_propeller'], np.zeros(2)
        joint = STORE.types[joints](message.header, names, none, none, np.array(efforts))
        return [(topic, kind, message), ('/joint_states', joints, joint)]

    copy_bag(tmp_path / 'plain', tmp_path / 'bag', changed)
    trial = read_manoeuvring_bag(tmp_path / 'bag')
    assert trial.thrust_input == 'force'
    assert 'twist-in-world-axes' in codes(trial)
    run = prepare(trial)
    assert np.allclose(run.surge, m.surge, atol=1e-6)
    assert np.allclose(run.port, m.port)


@pytest.mark.parametrize(
    'code, damage',
    [
        (None, lambda t: t),
        (None, lambda t: replace(mirrored(t), frame='ned')),
        ('frame-assumed', lambda t: replace(mirrored(t), frame=None)),
        ('thrusters-swapped', lambda t: replace(t, port=t.starboard, starboard=t.port)),
        ('yaw-rate-reversed', lambda t: replace(t, yaw_rate=-t.yaw_rate)),
        ('surge-reversed', lambda t: replace(t, surge=-t.surge)),
        ('sway-reversed', lambda t: replace(t, sway=-t.sway)),
        ('thrust-reversed', lambda t: replace(t, port=-t.port, starboard=-t.starboard)),
        ('mixed-frames', lambda t: replace(t, heading=np.pi / 2 - t.heading)),
    ],
)
def test_reversed_channels_are_set_right_and_named(trials, code, damage):
    runs = prepare_runs([damage(t) for t in trials])
    assert codes(*runs) == ({code} if code else set())
    for found, trial in zip(runs, trials, strict=True):
        for name in ('port', 'starboard', 'surge', 'sway', 'yaw_rate'):
            assert np.allclose(getattr(found, name), getattr(prepare(trial), name), atol=1e-9), name


@pytest.mark.parametrize('others, code', [(1.2, {'yaw-rate-reversed'}), (2.4, set())])
def test_a_channel_is_reversed_only_by_clear_evidence(trials, others, code):
    """Motion that the heading does not have, in standard deviations of the yaw rate."""
    trial = trials[2]
    unlike = others * math.sqrt(2.0) * np.std(trial.yaw_rate) * np.sin(trial.time * 2.0 * math.pi / 7.0)
    assert codes(prepare(replace(trial, yaw_rate=unlike - trial.yaw_rate))) & {'yaw-rate-reversed'} == code


@pytest.mark.parametrize('share, code', [(0.4, {'surge-reversed'}), (0.22, set())])
def test_thrust_that_turns_a_craft_in_place_says_nothing_of_its_speed(share, code):
    """The total thrust as a share of the difference."""
    time = np.arange(0.0, 200.0, 0.1)
    difference = 50.0 * np.sign(np.sin(time / 3.0))
    moved = lfilter([0.05], [1.0, -0.95], difference / 50.0)
    sides = 0.5 * (share - 1.0) * difference, 0.5 * (share + 1.0) * difference
    run = prepare(ManoeuvringTrial(time, *sides, surge=-0.5 * moved, yaw_rate=0.3 * moved, frame='enu'))
    assert codes(run) & {'surge-reversed', 'thrust-reversed'} == code


@pytest.mark.parametrize('noise, width', [(1.0, 4.0), (0.05, 2.0)])
def test_smoothing_leaves_of_white_noise_what_a_gaussian_window_does(noise, width):
    """Of motion with a twentieth of noise half as wide a window as of noise alone: steps of 0.1 s."""
    motion, white = np.sin(0.02 * np.arange(40_000)) / math.sqrt(0.5), np.random.default_rng(1).standard_normal(40_000)
    left = smoothed(motion + noise * white, 0.1) - motion if noise < 1.0 else smoothed(white, 0.1)
    assert np.var(left) == pytest.approx(noise**2 / (2.0 * math.sqrt(math.pi) * width), rel=0.1)


def test_gap_means_zero_or_nothing(trials):
    trial = trials[0]
    silent = (trial.time > 40) & (trial.time < 50)
    port, starboard = (np.where(silent, np.nan, side) for side in (trial.port, trial.starboard))
    gappy = replace(trial, port=port, starboard=starboard)
    run = prepare(gappy, gap_means_zero=True)
    assert np.all(run.port[(run.time > 40.7) & (run.time < 49.9)] == 0)
    assert run.port[np.abs(run.time - 40.2) < 0.2].all() and run.driven.all()
    run = prepare(gappy)
    assert 'thrust-gaps' in codes(run)
    assert not run.driven[(run.time > 41.2) & (run.time < 49.9)].any()
    assert run.driven[run.time < 40.9].all()


def test_wraps_nans_spikes_disorder_and_held_samples(trials):
    trial = trials[0]
    rng = np.random.default_rng(1)
    holes = rng.random(trial.time.size) < 0.05
    time = trial.time.copy()
    time[100] = time[99]
    surge, struck = np.where(holes, np.nan, trial.surge), [200, 333, 334, 700]
    surge[struck] += 3.0
    surge[500], yaw_rate = 60.0, trial.yaw_rate.copy()
    yaw_rate[500:504] = 12.0
    damaged = replace(
        trial,
        time=time,
        heading=np.angle(np.exp(1j * trial.heading)),
        surge=surge,
        yaw_rate=yaw_rate,
        sway=np.repeat(trial.sway[::10], 10)[: trial.sway.size],
    )
    run = prepare(damaged)
    assert {'time-disorder', 'held-samples', 'spikes', 'absurd-values'} <= codes(run)
    assert np.isnan(run.yaw_rate[500:503]).all()
    assert np.ptp(np.diff(run.heading)) < 0.2
    assert np.isfinite(run.sway).sum() == pytest.approx(trial.time.size / 10, abs=2)
    reference = prepare(trial)
    assert np.allclose(run.smooth[0], reference.smooth[0], atol=0.06)


def test_speeds_and_rate_are_derived_from_the_track(trials):
    run = prepare(replace(trials[2], surge=None, sway=None, yaw_rate=None))
    assert {'speed-derived', 'yaw-rate-derived'} <= codes(run)
    reference = prepare(trials[2])
    assert np.std(run.yaw_rate - reference.smooth[2]) < 0.02
    assert np.corrcoef(run.sway, reference.smooth[1])[0, 1] > 0.8


def test_bad_files_and_too_short_trials_are_refused_in_one_sentence(tmp_path, trials):
    path = tmp_path / 'bad.csv'
    for text, match in (
        ('', 'empty'),
        ('time_s,port_thrust_n\n0,1\n', 'starboard'),
        ('time_s,port_thrust_n,starboard_thrust_n\n0,1,1\n', 'no motion'),
        ('port_thrust_n,starboard_thrust_n,surge_m_s\n0,1,1\n', 'time'),
        ('time_s,port_command,starboard_command,surge_m_s\n0,1.6,1,1\n', 'normalise'),
        ('# frame: foo\ntime_s,port_command,starboard_command,surge_m_s\n0,0.5,1,1\n', 'enu or ned'),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=match):
            read_manoeuvring_csv(path)
    names = ('time', 'port', 'starboard', 'surge', 'sway', 'yaw_rate', 'heading', 'x', 'y')
    with pytest.raises(InputError, match='record 30 s'):
        prepare(replace(trials[0], **{name: getattr(trials[0], name)[:10] for name in names}))
    with pytest.raises(InputError, match='neither speed nor yaw rate'):
        prepare(replace(trials[0], surge=None, sway=None, yaw_rate=None, heading=None))


def test_a_compass_askew_is_turned_along_the_keel():
    """A craft that sails a square with its compass 10 deg off, position and heading only."""
    time = np.arange(0.0, 160.0, 0.1)
    heading = np.interp(time % 40.0, [0.0, 36.0, 40.0], [0.0, 0.0, np.pi / 2]) + np.pi / 2 * np.floor(time / 40.0)
    x, y = (0.1 * np.cumsum(1.2 * f(heading)) for f in (np.cos, np.sin))
    inputs = np.full(time.size, 50.0)
    askew = ManoeuvringTrial(time, inputs, inputs, heading=heading - np.radians(10.0), x=x, y=y, frame='enu')
    run = prepare(askew)
    assert 'compass-misaligned' in codes(run)
    settled = np.abs(np.subtract.outer(run.time, [38.0, 78.0, 118.0, 158.0])).min(axis=1) > 5.0
    expected = np.interp(run.time, time, heading)
    assert np.allclose(run.heading[settled], expected[settled], atol=np.radians(1.0))
    assert np.max(np.abs(run.sway[settled])) < 0.05
    # on one course only it may as well be a current
    one = replace(askew, heading=np.full(time.size, -np.radians(10.0)), x=1.2 * time, y=0.0 * time)
    assert 'compass-misaligned' not in codes(prepare(one))


def zigzag(span):
    """Two courses so far apart, deg, for half a minute each."""
    return lambda t: np.where((t % 80 >= 36) & (t % 80 < 40), span, np.where(t % 80 >= 76, -span, 0.0)) / 4.0


def arcs(rate, share):
    """Turns to port at a rate, deg/s, for a share of the time."""
    return lambda t: np.where(t % 20 < 20 * share, rate, 0.0)


@pytest.mark.parametrize(
    'turns, speed, askew, drift, is_found',
    [
        (zigzag(90), 1.2, 5.0, 0.0, True),
        (zigzag(90), 1.2, 3.0, 0.0, False),  # too small to be sure of
        (zigzag(90), 0.35, 10.0, 0.0, True),
        (zigzag(90), 0.25, 10.0, 0.0, False),  # a craft so slow drifts
        (zigzag(60), 1.2, 10.0, 0.0, True),
        (zigzag(50), 1.2, 10.0, 0.0, False),  # the deviation may do it
        (zigzag(180), 1.2, 10.0, 0.15, False),  # side gusts hide it
        (arcs(3.0, 0.7), 1.2, 10.0, 0.0, True),
        (arcs(3.0, 0.9), 1.2, 10.0, 0.0, False),  # always turning to one side drifts
        (arcs(0.8, 0.9), 1.2, 10.0, 0.0, True),
        (arcs(1.2, 0.9), 1.2, 10.0, 0.0, False),
    ],
)
def test_a_compass_is_corrected_only_where_nothing_else_explains_it(turns, speed, askew, drift, is_found):
    time = np.arange(0.0, 320.0, 0.1)
    heading, gusts = 0.1 * np.cumsum(np.radians(turns(time))), np.random.default_rng(1).standard_normal(time.size)
    side = drift * lfilter([1.0], [1.0, -math.exp(-0.05)], gusts)
    x, y = 0.1 * np.cumsum(turned(np.full(time.size, speed), side, -heading), axis=1)
    inputs = np.full(time.size, 50.0)
    trial = ManoeuvringTrial(time, inputs, inputs, heading=heading - np.radians(askew), x=x, y=y, frame='enu')
    assert ('compass-misaligned' in codes(prepare(trial))) == is_found
