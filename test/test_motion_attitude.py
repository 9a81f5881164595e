"""Attitude, rates and vertical acceleration, against scipy, finite differences and sines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Installation, is_orientation
from swath_sysid.attitude.motion.cleaning import assemble_trial, turn_rate
from swath_sysid.attitude.motion.intake import LARGEST_PITCH, ImuReading, convert
from swath_sysid.attitude.motion.vertical import (
    ACCELERATION,
    EDGE,
    HEAVE,
    VELOCITY,
    LeakyIntegrals,
    vertical_acceleration,
    zero_phase_integral,
)
from swath_sysid.common.errors import InputError

angle = st.floats(-np.pi, np.pi)
pitch_angle = st.floats(-1.55, 1.55)
component = st.floats(-20, 20)


def rotation_of(roll, pitch, yaw):
    return Rotation.from_euler('ZYX', [yaw, pitch, roll])


def same_rotation(quaternion, rotation):
    return (Rotation.from_quat(quaternion) * rotation.inv()).magnitude() < 1e-7


@given(roll=angle, pitch=pitch_angle, yaw=angle, rates=st.tuples(component, component, component))
def test_quaternion_and_euler_angles_are_those_of_scipy_and_body_rates_invert_euler_rates(roll, pitch, yaw, rates):
    there = attitude.euler_rates(roll, pitch, *rates)
    assert attitude.body_rates(roll, pitch, *there) == pytest.approx(rates, abs=1e-8)
    rotation = rotation_of(roll, pitch, yaw)
    assert same_rotation(attitude.quaternion(roll, pitch, yaw), rotation)
    found = attitude.euler_angles(*(1.02 * rotation.as_quat()))
    assert found[1] == pytest.approx(pitch, abs=1e-9)
    assert same_rotation(rotation_of(*found).as_quat(), rotation)


@given(roll=angle, yaw=angle, pitch=st.sampled_from([-np.pi / 2, np.pi / 2]))
def test_vertical_orientation_is_kept_with_roll_zero(roll, pitch, yaw):
    rotation = rotation_of(roll, pitch, yaw)
    found = attitude.euler_angles(*rotation.as_quat())
    assert np.all(np.isfinite(found))
    assert found[1] == pytest.approx(pitch, abs=1e-7)
    assert (rotation_of(*found) * rotation.inv()).magnitude() < 1e-6


@pytest.mark.parametrize('broken', [(0, 0, 0, 5e-324), (1e-160, 0, 0, 1e-160), (0, 0, 0, np.inf), (0, 0, 0, 1e200)])
def test_what_is_no_orientation_is_flagged(broken):
    assert not attitude.is_orientation(*broken) and np.isnan(attitude.euler_angles(*broken)).all()
    many = np.array([broken, (0, 0, 0, 1)]).T
    assert attitude.is_orientation(*many).tolist() == [False, True]
    assert np.isnan(attitude.euler_angles(*many)[0]).tolist() == [True, False]


def test_numbers_and_arrays_give_the_same():
    def of(roll, pitch, yaw, x, y, z):
        turn = attitude.quaternion(roll, pitch, yaw)
        rates = attitude.euler_rates(roll, pitch, x, y, z), attitude.body_rates(roll, pitch, x, y, z)
        return [value for part in (turn, attitude.euler_angles(*turn), *rates) for value in part]

    values = np.random.default_rng(1).uniform(-1, 1, (6, 20))
    many = of(*values)
    for at in range(20):
        found = of(*values[:, at].tolist())
        assert all(type(value) is float for value in found)
        assert found == pytest.approx([part[at] for part in many], rel=1e-13, abs=1e-15)


def test_euler_rates_are_the_derivatives_of_the_angles():
    time = np.linspace(0, 10, 20001)
    roll, pitch, yaw = 0.6 * np.sin(time), 0.4 * np.cos(1.3 * time), 0.5 * time
    rotations = Rotation.from_euler('ZYX', np.column_stack([yaw, pitch, roll]))
    turns = (rotations[:-1].inv() * rotations[1:]).as_rotvec() / np.diff(time)[:, None]
    middle = (roll[:-1] + roll[1:]) / 2, (pitch[:-1] + pitch[1:]) / 2
    found = attitude.euler_rates(*middle, *turns.T)
    for rate, angles in zip(found, (roll, pitch, yaw), strict=True):
        assert np.allclose(rate, np.diff(angles) / np.diff(time), atol=1e-6)
    assert np.all(np.isnan(attitude.euler_rates(0.1, np.pi / 2, 1.0, 2.0, 3.0)[::2]))


@given(*[st.tuples(angle, angle, angle)] * 2, st.tuples(component, component, component))
def test_product_inverse_and_rotation_are_those_of_scipy(first, second, vector):
    one, two = attitude.quaternion(*first), attitude.quaternion(*second)
    assert same_rotation(attitude.multiply(one, two), rotation_of(*first) * rotation_of(*second))
    assert same_rotation(attitude.conjugate(*one), rotation_of(*first).inv())
    assert attitude.rotate(one, *vector) == pytest.approx(tuple(rotation_of(*first).apply(vector)), abs=1e-9)


@given(mounting=st.tuples(angle, angle, angle), craft=st.tuples(angle, pitch_angle, angle))
def test_mounted_sensor_tells_the_motion_of_the_craft(mounting, craft):
    craft_in_world = rotation_of(*craft)
    sensor_in_world = craft_in_world * rotation_of(*mounting)
    force = sensor_in_world.inv().apply([0, 0, 9.81])
    rates = rotation_of(*mounting).inv().apply([0.1, 0.2, 0.3])
    unknown, parts = (0.0,) * 9, (sensor_in_world.as_quat(), rates, force)
    reading = ImuReading(0, *(item for part in parts for item in (part.tolist(), unknown)))
    motion = convert(reading, Installation('flu', mounting)).sample
    if abs(craft_in_world.as_euler('ZYX')[1]) > LARGEST_PITCH - 1e-6:
        return
    assert same_rotation(rotation_of(motion.roll, motion.pitch, motion.yaw).as_quat(), craft_in_world)
    assert motion[5:8] == pytest.approx(craft_in_world.inv().apply([0, 0, 9.81]), abs=1e-8)
    assert motion[3:5] == pytest.approx(attitude.euler_rates(motion.roll, motion.pitch, 0.1, 0.2, 0.3)[:2], abs=1e-6)


def columns(name, axes, values):
    """Readings of a vector by the names of their columns."""
    return {f'{name}_{axis}': part for axis, part in zip(axes, values, strict=True)}


def readings(count=50):
    time = np.linspace(0, 5, count)
    roll, pitch = 0.3 * np.sin(time), 0.2 * np.cos(time)
    gyro = attitude.body_rates(roll, pitch, 0.3 * np.cos(time), -0.2 * np.sin(time), 0.1)
    force = columns('accel', 'xyz', (0 * time, 0 * time, 9.81 + 0 * time))
    return time, {'roll': roll, 'pitch': pitch, **columns('gyro', 'xyz', gyro), **force}


def test_assembled_trial_keeps_angles_exactly_and_turns_rates():
    time, given_readings = readings()
    trial = assemble_trial(time, given_readings, source='here', draft=0.15)
    assert np.array_equal(trial.roll, given_readings['roll'])
    expected = attitude.euler_rates(trial.roll, trial.pitch, *(given_readings[f'gyro_{part}'] for part in 'xyz'))
    assert np.array_equal([trial.roll_rate, trial.pitch_rate, trial.yaw_rate], expected)
    assert (trial.advice, trial.source, trial.draft) == ((), 'here', 0.15)
    # Euler rates measured as such win over the gyroscope
    trial = assemble_trial(time, {**given_readings, 'roll_rate': 7 + 0 * time})
    assert np.all(trial.roll_rate == 7) and np.array_equal(trial.pitch_rate, expected[1])


@pytest.mark.parametrize('absent', ['roll', 'pitch', 'gyro_z'])
def test_body_rates_in_place_of_euler_rates_are_named(absent):
    time, given_readings = readings()
    del given_readings[absent]
    trial = assemble_trial(time, given_readings)
    assert [advice.code for advice in trial.advice] == ['body-rates']
    assert np.array_equal(trial.roll_rate, given_readings['gyro_x'])


def test_readings_and_installations_that_cannot_be_used_are_refused():
    time, given_readings = readings()
    given_readings['roll_rate'] = 0 * time
    for kept in ('roll', 'roll pitch roll_rate', 'roll pitch gyro_x', 'roll pitch accel_z'):
        with pytest.raises(InputError, match='mounting'):
            assemble_trial(time, {n: given_readings[n] for n in kept.split()}, Installation('flu', (0.0, 0.0, 1.0)))
    with pytest.raises(InputError, match='no usable roll or pitch'):
        assemble_trial(time, {'accel_z': given_readings['accel_z']})
    for arguments in (('ned',), ('flu', (0.0, np.nan, 0.0)), ('flu', (0.0, 1.0))):
        with pytest.raises(InputError):
            Installation(*arguments)


def test_broken_quaternions_cost_their_samples_only_and_zeros_mean_none():
    time, given_readings = readings()
    given = np.array(attitude.quaternion(given_readings['roll'], given_readings['pitch'], 0 * time))
    given[:, 7] = 0
    trial = assemble_trial(time, columns('quaternion', 'xyzw', given))
    assert np.flatnonzero(np.isnan(trial.roll)).tolist() == [7]
    assert np.allclose(np.delete(trial.roll, 7), np.delete(given_readings['roll'], 7))
    assert '1 of 50' in trial.advice[0].message
    rates = {name: given_readings[name] for name in ('gyro_x', 'gyro_y')}
    trial = assemble_trial(time, {**columns('quaternion', 'xyzw', 0 * given), **rates})
    assert set(trial.channels) == {'roll_rate', 'pitch_rate'}
    assert {advice.code for advice in trial.advice} == {'invalid-orientation', 'body-rates'}


def test_yaw_rate_of_a_heading_is_its_difference_the_shorter_way_round_and_unknown_across_a_loss():
    time = np.array([0.0, 1.0, 2.0, 3.0, 7.0, 8.0, 9.0])
    heading = np.radians([358.0, 359.0, 1.0, 0.0, 90.0, 89.0, np.nan])
    expected = np.radians([np.nan, 1.0, 2.0, -1.0, np.nan, -1.0, np.nan])
    assert np.allclose(turn_rate(time, heading), expected, equal_nan=True)
    trial = assemble_trial(np.append(time, 10.0), {'roll': np.zeros(8), 'heading': np.append(heading, 1.0)})
    # a heading counts clockwise, the yaw of a craft in ENU the other way
    assert np.allclose(trial.yaw_rate, -np.append(expected, np.nan), equal_nan=True)


@given(later=st.floats(-0.5, 0.5), place=st.integers(2, 49))
def test_yaw_rate_of_a_heading_sees_only_the_past(later, place):
    time, yaw = np.arange(50.0), np.cumsum(0.1 * np.sin(np.arange(50.0)))
    changed = np.where(np.arange(50) >= place, yaw + later, yaw)
    assert np.array_equal(turn_rate(time, changed)[:place], turn_rate(time, yaw)[:place], equal_nan=True)


@pytest.mark.parametrize('kept', [('quaternion', 'gyro'), ('quaternion',), ('euler', 'gyro'), ('heading',), ('rate',)])
@pytest.mark.parametrize('mounting', [(0.0, 0.0, 0.0), (0.1, -0.2, 2.5)])
@pytest.mark.parametrize('frame', ['flu', 'frd'])
def test_attitude_and_yaw_rate_are_those_of_the_craft_whatever_frame_they_were_measured_in(frame, mounting, kept):
    time = np.linspace(0.0, 5.0, 5001)
    roll, pitch, yaw = 0.2 * np.sin(time), 0.1 * np.cos(2.0 * time), 3.0 + 0.5 * np.sin(1.5 * time)
    yaw_rate = 0.75 * np.cos(1.5 * time)
    body = np.stack(attitude.body_rates(roll, pitch, 0.2 * np.cos(time), -0.2 * np.sin(2.0 * time), yaw_rate), axis=1)
    craft, mount = Rotation.from_euler('ZYX', np.column_stack([yaw, pitch, roll])), rotation_of(*mounting)
    sensor, rates = craft * mount, mount.inv().apply(body)
    if frame == 'frd':
        to_ned, half_turn = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), Rotation.from_euler('X', np.pi)
        sensor, rates = to_ned * sensor * half_turn, half_turn.apply(rates)
    seen_yaw, seen_pitch, seen_roll = sensor.as_euler('ZYX').T
    seen, sign = {'roll': seen_roll, 'pitch': seen_pitch}, -1.0 if frame == 'frd' else 1.0
    known = {
        'quaternion': columns('quaternion', 'xyzw', sensor.as_quat().T),
        'gyro': columns('gyro', 'xyz', rates.T),
        'euler': {**seen, 'yaw': seen_yaw},
        'heading': {**seen, 'heading': seen_yaw if frame == 'frd' else np.pi / 2 - seen_yaw},
        'rate': {**seen, 'yaw_rate': sign * yaw_rate},
    }
    trial = assemble_trial(time, {k: v for name in kept for k, v in known[name].items()}, Installation(frame, mounting))
    if any(mounting) and kept == ('rate',):
        assert trial.yaw_rate is None  # a mounting turns no single Euler rate
    else:
        assert np.allclose([trial.roll, trial.pitch], [roll, pitch])
        assert np.allclose(trial.yaw_rate[1:], yaw_rate[1:], atol=1e-9 if kept[-1] in ('gyro', 'rate') else 1e-3)


def test_heave_is_upward_whatever_the_frame_and_a_heading_only_filled_in_is_none():
    time, given_readings = readings()
    angles = {'roll': given_readings['roll'], 'pitch': given_readings['pitch'], 'yaw': 0 * time, 'heave': time}
    trial = assemble_trial(time, angles)
    assert np.array_equal(trial.heave, time) and trial.yaw_rate is None
    assert np.array_equal(assemble_trial(time, angles, Installation('frd')).heave, -time)


STEP = 0.1
TIME = np.arange(0.0, 600.0, STEP)
INNER = slice(round(EDGE / STEP), -round(EDGE / STEP))


def test_gravity_is_removed_by_the_orientation():
    rng = np.random.default_rng(3)
    roll, pitch, yaw = rng.uniform(-1.2, 1.2, (3, 50))
    world = rng.normal(size=(50, 3))
    craft_to_world = Rotation.from_euler('ZYX', np.stack([yaw, pitch, roll], axis=1))
    force = craft_to_world.inv().apply(world + [0.0, 0.0, STANDARD_GRAVITY])
    np.testing.assert_allclose(vertical_acceleration(roll, pitch, force), world[:, 2], atol=1e-12)


@pytest.mark.parametrize('delay', [0.0, 0.07])
@pytest.mark.parametrize('frequency', [0.05, 0.2, 1.4])
def test_a_sine_is_integrated_without_phase_error(frequency, delay):
    w = 2.0 * np.pi * frequency
    signal = -(w**2) * np.sin(w * (TIME - delay))
    expected = np.sin(w * TIME), w * np.cos(w * TIME), -(w**3) * np.cos(w * TIME)
    for times, motion in zip((HEAVE, VELOCITY, -1), expected, strict=True):
        found = zero_phase_integral(signal, STEP, times, delay)
        np.testing.assert_allclose(found[INNER], motion[INNER], atol=0.03 * np.abs(motion).max())
    # drift and a bias are no motion
    found = zero_phase_integral(0.3 + 0.1 * np.sin(2.0 * np.pi * 0.002 * TIME), STEP, HEAVE)
    assert np.abs(found[INNER]).max() < 0.2
    for outside in (0.03, 2.0):
        assert np.abs(zero_phase_integral(np.sin(2.0 * np.pi * outside * TIME), STEP, ACCELERATION)).max() < 0.02


@pytest.mark.parametrize('number', [float, np.float64, lambda value: np.full(3, value)])
def test_an_orientation_is_a_quaternion_of_nearly_unit_length(number):
    sizes = np.sqrt([0.87, 0.92, 1.08, 1.13])
    valid = [np.all(is_orientation(*map(number, (0.6 * size, 0.0, 0.0, 0.8 * size)))) for size in sizes]
    assert valid == [False, True, True, False]


def test_leaky_integrals_level_off_at_their_time_constant_and_are_the_same_row_by_row():
    integrals = LeakyIntegrals(0.004)
    for _ in range(50_000):
        integrals.take(1.0)
    np.testing.assert_allclose(integrals.values, (1.5, 4.0, 12.0, 9.0, 24.0), rtol=3e-3)
    acceleration = np.random.default_rng(1).normal(size=300)
    integrals = LeakyIntegrals(STEP)
    for value in acceleration:
        integrals.take(float(value))
    np.testing.assert_allclose(integrals.values, LeakyIntegrals(STEP).of(acceleration)[-1], rtol=1e-12)
    integrals.take(np.nan)
    assert np.isfinite(integrals.values).all()
