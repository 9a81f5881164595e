"""What a sensor's own data say of its installation: each wrong one is named with its cure, no right one is."""

import json
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from imu_stream import NOT_GIVEN, diagonal
from repository import RECORDS
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion import sensor_checks
from swath_sysid.attitude.motion.attitude import TURNS, Installation, angles_of
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import ImuReading, Intake
from swath_sysid.attitude.motion.rate_comparison import compare_rates
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.formats.reading import read_trial

STRAIGHT = Installation()
GRAVITY = 9.80665
OTHER_FRAME = 'other frame'
CODES = sensor_checks.REPEAT_CODES | sensor_checks.GRAVITY_CODES | sensor_checks.RATE_CODES | sensor_checks.OFFSET_CODES


def turned(roll, pitch, yaw, orientation):
    """Mounted so; `orientation`: whether what it says of its orientation is turned with its vectors."""
    sits = Rotation.from_euler('ZYX', [yaw, pitch, roll], degrees=True)

    def wrong(attitude, rates, force):
        return attitude * sits if orientation else attitude, sits.inv().apply(rates), sits.inv().apply(force)

    return wrong


def rates_times(factors):
    return lambda attitude, rates, force: (attitude, rates * factors, force)


WRONG = {
    # name: (what is wrong, code, what the sentence must name)
    OTHER_FRAME: (lambda *all_right: all_right, 'axes-of-sensor', 'set frame to {frame}'),
    'upside down': (turned(180, 0, 0, True), 'sensor-turned', 'set mounting_deg to [180, 0, 0]'),
    'upside down, corrected': (turned(180, 0, 0, False), 'axes-of-sensor', 'set mounting_deg to [180, 0, 0]'),
    'turned by 90 deg': (turned(0, 0, 90, False), 'rates-turned', 'set mounting_deg to [0, 0, {quarter}]'),
    'turned by 180 deg': (turned(0, 0, 180, False), 'rates-turned', 'set mounting_deg to [0, 0, 180]'),
    'turned by 270 deg': (turned(0, 0, -90, False), 'rates-turned', 'set mounting_deg to [0, 0, {back}]'),
    'on its side': (turned(90, 0, 0, True), 'sensor-turned', 'set mounting_deg to [90, 0, 0]'),
    'on its side, corrected': (turned(90, 0, 0, False), 'axes-of-sensor', 'set mounting_deg to [90, 0, 0]'),
    'deg/s': (rates_times(180 / np.pi), 'rate-unit', 'the rate is in deg/s where rad/s is expected'),
    'g': (lambda a, r, f: (a, r, f / GRAVITY), 'accelerations-in-g', 'they are in g'),
    'rates reversed': (rates_times(-1.0), 'rate-sign', 'reverse the signs of the rates'),
    'roll rate reversed': (rates_times([-1.0, 1.0, 1.0]), 'rate-sign', 'the roll rate is the derivative'),
    'gyros exchanged': (lambda a, r, f: (a, r[:, [1, 0, 2]], f), 'rates-swapped', 'exchange the x and y gyroscopes'),
    'rates 0.4 s late': (lambda a, r, f: (a[4:], r[:-4], f[4:]), 'rate-late', 'after the'),
    'frozen after 20 s': (
        lambda *parts: [part[np.minimum(np.arange(len(parts[1])), 200)] for part in parts],
        'sensor-frozen',
        'restart its driver',
    ),
    'gyro 20 deg/s off': (lambda a, r, f: (a, r + np.radians([20, 0, 0]), f), 'rate-offset', 'calibrate the gyroscope'),
    'rates of another sensor': (
        lambda a, r, f: (a, np.random.default_rng(1).normal(0.0, 0.1, r.shape), f),
        'rate-unrelated',
        'does not follow it',
    ),
}
"""All at 10 Hz; corrected is what tells an orientation of the craft, whose rates and forces are the sensor's."""


@cache
def buoy(path):
    """Attitude, rates and specific force of the moored buoy's sensor, FRD in NED, at 10 Hz."""
    table = np.genfromtxt(path, delimiter=',', names=True, skip_header=path.parent == RECORDS)
    angles = np.column_stack([table[f'{name}_deg'] for name in ('yaw', 'pitch', 'roll')])
    rates = np.radians(np.column_stack([table[f'gyro_{part}_deg_s'] for part in 'xyz']))
    force = np.column_stack([table[f'accel_{part}_m_s2'] for part in 'xyz'])
    whole = np.isfinite(np.column_stack([angles, rates, force])).all(axis=1) & (np.abs(rates) < 35.0).all(axis=1)
    return Rotation.from_euler('ZYX', angles[whole], degrees=True), rates[whole], force[whole]


def readings_of(attitude, rates, force):
    """The messages of a sensor with these values."""
    known = diagonal(1e-6)
    parts = attitude.as_quat().tolist(), rates.tolist(), force.tolist()
    for k, (turn, rate, push) in enumerate(zip(*parts, strict=True)):
        yield ImuReading(10**18 + k * 10**8, turn, known, rate, known, push, known)


def named_by(readings, installation):
    """What a running sensor is found to contradict, judged once a second: code to (s until then, sentence)."""
    intake, check, found = Intake(installation, StampSettings()), InstallationCheck(installation), {}
    for k, reading in enumerate(readings):
        check.add(intake.take(reading))
        if k % 10 == 0:
            for each in check.judge():
                found.setdefault(each.code, (0.1 * k, each.message))
    return found, check


def assert_named(name, frame, measured):
    """A sensor of this frame that is wrong in this way is named within a minute, with its cure."""
    wrong, code, words = WRONG[name]
    declared = {'frd': 'flu', 'flu': 'frd'}[frame] if name == OTHER_FRAME else frame
    found, _ = named_by(readings_of(*wrong(*measured)), Installation(declared))
    assert list(found) == [code]
    # a turn to starboard about an axis that points down is one to port about an axis that points up
    quarter = -90 if frame == 'frd' else 90
    seconds, message = found[code]
    assert seconds <= 60.0 and words.format(frame=frame, quarter=quarter, back=-quarter) in message


def craft_in_waves(duration=70.0, roll=0.06, pitch=0.05):
    """Attitude, body rates and specific force of a craft in waves, FLU in ENU; its rates by scipy's rotations."""
    rng, time = np.random.default_rng(1), np.arange(0.0, duration, 0.1)
    angles, fine, push = (np.tile(mean, (time.size, 1)) for mean in ([0.4, 0.02, -0.01],) * 2 + ([0.0, 0.0, GRAVITY],))
    for column, size in ((0, 0.02), (1, pitch), (2, roll)):
        for _ in range(5):
            w, phase = 2 * np.pi * rng.uniform(0.12, 0.4), rng.uniform(0, 2 * np.pi)
            angles[:, column] += 0.6 * size * np.sin(w * time + phase)
            fine[:, column] += 0.6 * size * np.sin(w * (time + 1e-5) + phase)
            push[:, 2 - column] += 0.3 * np.sin(w * time + rng.uniform(0, 2 * np.pi))
    attitude, just_after = (Rotation.from_euler('ZYX', each) for each in (angles, fine))
    rates = (attitude.inv() * just_after).as_rotvec() / 1e-5
    noise = rng.normal(0.0, 1.0, (2, time.size, 3)) * [[[2e-3]], [[0.03]]]
    return attitude, rates + noise[0], attitude.inv().apply(push) + noise[1]


@pytest.mark.parametrize('name', WRONG)
def test_each_wrong_installation_is_named_with_its_cure(name):
    assert_named(name, 'flu', craft_in_waves())


@pytest.mark.parametrize('start', range(0, 3_000, 600))
@pytest.mark.parametrize('name', WRONG)
def test_each_is_named_on_a_measured_buoy_within_a_minute(name, start):
    assert_named(name, 'frd', [part[start : start + 600] for part in buoy(RECORDS / 'morro_buoy.csv')])


@pytest.mark.long
@pytest.mark.parametrize('record', ['waves/morro_buoy.csv', 'faults/oahu_static_bad_packets.csv'])
def test_nothing_is_named_of_a_running_sensor_that_sits_right(data_folder, record):
    found, check = named_by(readings_of(*buoy(data_folder / record)), Installation('frd'))
    assert found == {} and check.contradictions == ()
    assert check.judgements > 300


@pytest.mark.long
def test_nothing_is_named_of_any_measured_record(data_folder):
    paths = sorted(data_folder.rglob('*.csv'))
    assert len(paths) == 14
    for path in paths:
        trial = read_trial(path, frame='frd' if 'morro' in path.name or 'oahu' in path.name else None)
        assert [each for each in trial.advice if isinstance(each, sensor_checks.Contradiction)] == [], path
        assert 'other-unit-likely' not in {each.code for each in trial.advice}, path


@pytest.mark.long
@pytest.mark.parametrize('first', [0, *(pytest.param(k, marks=pytest.mark.long) for k in range(10, 60, 10))])
def test_nothing_is_named_of_sound_sensors_whatever_they_leave_out(first, benchmark_module):
    sensor_records = benchmark_module('sensor_checks')
    for seed in range(first, first + 10):
        sound = sensor_records.record(seed)
        found = sensor_records.faults_of(sound)
        found += sensor_records.faults_live(sound) if seed % 6 == 0 else []
        assert found == [], (seed, sound.kind)


@pytest.mark.parametrize('name,reversed_,code', [('deg', 180 / np.pi, 'rate-unit'), ('sign', -1.0, 'rate-sign')])
def test_rates_are_held_against_measured_decays(name, reversed_, code):
    """A tanker in a towing tank, whose rates are the differences of its angle."""
    trial = read_trial(RECORDS / 'kvlcc2_roll_decay.csv')
    rate = np.gradient(trial.roll, trial.time)
    right, wrong = ({'roll': trial.roll, 'roll_rate': factor * rate} for factor in (1.0, reversed_))
    assert sensor_checks.contradictions_in(trial.time, right, STRAIGHT) == ()
    (found,) = sensor_checks.contradictions_in(trial.time, wrong, STRAIGHT)
    assert (found.code, found.axis) == (code, 'roll')


@pytest.mark.parametrize('step', [1e9, 1e12])
def test_absurd_stamps_size_no_array(step):
    time = 0.02 * np.arange(3000)
    time[1500:] += step
    channels = {'roll': np.sin(time), 'roll_rate': np.cos(time)}
    assert sensor_checks.contradictions_in(time, channels, STRAIGHT) == ()


@pytest.mark.parametrize('turn', TURNS)
def test_a_turn_is_the_mounting_that_undoes_it(turn):
    assert Rotation.from_euler('ZYX', angles_of(turn)[::-1]).as_matrix() == pytest.approx(turn, abs=1e-9)


@pytest.mark.parametrize('roll', [180, 90, -90])
def test_the_mounting_that_is_named_mends_it(roll):
    sensor = turned(roll, 0, 0, True)(*craft_in_waves(30.0))
    found, _ = named_by(readings_of(*sensor), STRAIGHT)
    named = json.loads(found['sensor-turned'][1].split('mounting_deg to ')[1].partition(' (')[0])
    mended, check = named_by(readings_of(*sensor), Installation('flu', tuple(np.radians(named).tolist())))
    assert mended == {} and check.judgements >= 3


def test_a_consistent_turn_is_not_seen_and_at_rest_only_gravity_is_judged():
    found, check = named_by(readings_of(*turned(0, 0, 90, True)(*craft_in_waves())), STRAIGHT)
    assert found == {} and check.described == 'gravity and rates agree with the attitude'
    still = craft_in_waves(40.0, roll=1e-5, pitch=1e-5)
    found, check = named_by(readings_of(still[0], -still[1], still[2]), STRAIGHT)
    assert found == {} and check.described == 'gravity agrees with the attitude; the rates show when the craft moves'
    found, _ = named_by(readings_of(*still), Installation('frd'))
    assert list(found) == ['axes-of-sensor'] and 'set frame to flu' in found['axes-of-sensor'][1]


def test_without_orientation_gravity_alone_says_how_it_sits():
    for roll, words in ((180, 'set frame to frd'), (90, 'mounting_deg to [90, 0, 0]')):
        readings = readings_of(*turned(roll, 0, 0, False)(*craft_in_waves(30.0)))
        found, _ = named_by((each._replace(orientation_covariance=NOT_GIVEN) for each in readings), STRAIGHT)
        assert list(found) == ['axes-of-sensor'] and words in found['axes-of-sensor'][1]


def test_a_frozen_orientation_is_named_and_what_is_mended_no_longer():
    attitude, rates, force = craft_in_waves(120.0)
    found, _ = named_by(readings_of(attitude[np.zeros(400, dtype=int)], rates[:400], force[:400]), STRAIGHT)
    assert 'angles-frozen' in found
    rates[:400] *= -1.0
    found, check = named_by(readings_of(attitude, rates, force), STRAIGHT)
    assert list(found) == ['rate-sign'] and check.contradictions == ()


numbers = st.one_of(st.floats(-10.0, 10.0), st.sampled_from([np.nan, 0.0, 1e200, -np.pi, np.pi]))


@settings(max_examples=60)
@given(arrays(float, (60, 9), elements=numbers), st.sampled_from(['flu', 'frd']))
def test_any_values_are_judged_without_an_error(values, frame):
    time = np.arange(60) * 0.1
    with np.errstate(all='ignore'):
        judgement = sensor_checks.judge(
            time, values[:, :3], values[:, 3:6], values[:, 6:], installation=Installation(frame), interval=0.1
        )
    assert all(each.code in CODES for each in judgement.contradictions)
    assert sensor_checks.DOUBTFUL_CODES < CODES
    assert not any('nan' in each.message or 'inf' in each.message for each in judgement.contradictions)


STEP = 0.05


def rolling(seed, duration=30.0, delay=0.0):
    """Roll and pitch of a few waves, shape (N, 2), and the derivatives of roll, pitch, yaw some time ago, (N, 3)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, STEP)
    angles, rates = np.zeros((2, time.size, 3))
    for axis in range(3):
        for _ in range(6):
            w, phase = 2 * np.pi * rng.uniform(0.1, 0.5), rng.uniform(0, 2 * np.pi)
            angles[:, axis] += 0.03 * np.sin(w * time + phase)
            rates[:, axis] += 0.03 * w * np.cos(w * (time - delay) + phase)
    return angles[:, :2], rates


@pytest.mark.long
@given(st.integers(0, 10_000), st.floats(-0.5, 0.5))
def test_a_delay_is_found_with_its_sign(seed, delay):
    found = compare_rates(STEP, *rolling(seed, delay=delay))
    assert [slope.axis for slope in found] == [0, 1]
    assert [slope.lag for slope in found] == pytest.approx([delay] * 2, abs=0.02)
    assert all(slope.lagged > 0.99 and slope.gain == pytest.approx(1.0, abs=0.1) for slope in found)


@pytest.mark.long
@given(st.integers(0, 10_000), st.floats(0.01, 100.0), st.floats(-2.0, 2.0))
def test_a_gain_is_found_whatever_the_offset(seed, gain, offset):
    angles, rates = rolling(seed)
    found = compare_rates(STEP, angles, gain * rates + offset)
    assert [slope.gain for slope in found] == pytest.approx([gain] * 2, rel=0.02)


@pytest.mark.long
def test_the_standard_deviation_of_a_delay_is_that_of_repeats():
    lags, told = [], []
    for seed in range(200):
        angles, rates = rolling(7)
        noise = np.random.default_rng(seed).normal(0.0, 0.15, rates.shape)
        found = compare_rates(STEP, angles, rates + noise)[0]
        lags.append(found.lag)
        told.append(found.lag_std)
    assert 0.3 < np.std(lags) / np.mean(told) < 1.5


def faults_of_roll(angles, rates, interval):
    """The codes of the contradictions between angles and rates of a sensor of this interval, s."""
    unknown = np.full(rates.shape, np.nan)
    whole = np.column_stack([angles, unknown[:, 0]])
    time = STEP * np.arange(len(rates))
    found = sensor_checks.judge(time, whole, rates, unknown, installation=STRAIGHT, interval=interval)
    return [each.code for each in found.contradictions if each.axis == 'roll']


def test_small_delays_and_offsets_are_not_reported():
    for intervals, codes in ((2.0, []), (3.0, ['rate-late'])):
        assert faults_of_roll(*rolling(3, delay=intervals * STEP), STEP) == codes
    frequency = compare_rates(STEP, *rolling(3))[0].frequency
    for phase, codes in ((0.12, []), (0.2, ['rate-late'])):
        assert faults_of_roll(*rolling(3, delay=phase / frequency), 0.1 * STEP) == codes
    angles, rates = rolling(3)
    for offset, codes in ((1.6, []), (2.6, ['rate-offset'])):
        assert faults_of_roll(angles, rates + np.radians(offset), STEP) == codes


def test_angles_too_coarse_to_be_differentiated_are_not_compared():
    time = np.arange(0.0, 30.0, STEP)
    for part_of_nyquist, count in ((0.25, 1), (0.35, 0)):
        w = np.pi * part_of_nyquist / STEP
        angles, rates = np.zeros((time.size, 2)), np.zeros((time.size, 3))
        angles[:, 0], rates[:, 0] = 0.1 * np.sin(w * time), 0.1 * w * np.cos(w * time)
        assert len(compare_rates(STEP, angles, rates)) == count


def test_a_contradiction_is_reported_when_a_second_judgement_confirms_it():
    random = np.random.default_rng(1)
    attitude = Rotation.from_euler('ZYX', random.normal(0.0, 0.01, (400, 3)))
    in_g = random.normal(0.0, 1e-3, (400, 3)) + [0.0, 0.0, 1.0]
    found, _ = named_by(readings_of(attitude, random.normal(0.0, 0.01, (400, 3)), in_g), STRAIGHT)
    since, _ = found['accelerations-in-g']
    assert since == pytest.approx(3.0 * sensor_checks.FROZEN, abs=1.0)


def test_a_little_more_than_a_tolerance_shows_and_a_little_less_does_not():
    angles, rates = rolling(3)
    size = np.radians(1.0) / angles.std(axis=0)
    assert [len(compare_rates(STEP, degrees * size * angles, rates)) for degrees in (0.2, 0.3)] == [0, 2]
    for gain, differs in ((1 / 1.4, True), (1 / 1.2, False), (1.2, False), (1.4, True)):
        assert [slope.differs for slope in compare_rates(STEP, angles, gain * rates)] == [differs] * 2
    time, noise = np.arange(60) * 0.1, np.random.default_rng(1).normal(0.0, 1e-3, (60, 3))
    for force, code in ((0.75, 'gravity-missing'), (0.85, 'accelerations-in-g'), (1.25, 'gravity-missing')):
        measured = time, noise, noise * np.nan, noise + [0, 0, force]
        found = sensor_checks.judge(*measured, installation=STRAIGHT, interval=0.1)
        assert [each.code for each in found.contradictions] == [code]
    for rows, codes in ((35, []), (45, ['accelerations-in-g'])):
        found = sensor_checks.judge(
            time[:rows],
            noise[:rows],
            noise[:rows] * np.nan,
            noise[:rows] + [0, 0, 1],
            installation=STRAIGHT,
            interval=0.1,
        )
        assert [each.code for each in found.contradictions] == codes
    time, still = np.arange(100) * 0.1, np.full((100, 3), np.nan)
    for turned, codes in ((2.4, []), (3.6, ['angles-frozen'])):
        rates = np.radians(0.5 * turned) * 2.5 * np.cos(2.5 * time)[:, None] * [1.0, 0.0, 0.0]
        found = sensor_checks.judge(time, 0.0 * rates, rates, still, installation=STRAIGHT, interval=0.1)
        assert [each.code for each in found.contradictions] == codes
