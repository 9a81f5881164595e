"""Manoeuvring model, thrusters, simulation, prime system, standard tests."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manoeuvring_runs import OLD
from scipy.integrate import solve_ivp
from scipy.optimize import approx_fprime, fsolve

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import Region, check_stability
from swath_sysid.manoeuvring.hull.measurement import deviation, recorded_heading, recorded_speeds, through_water
from swath_sysid.manoeuvring.hull.model import (
    PARAMETER_RANGES,
    PRESETS,
    ManoeuvringModel,
    check_physical,
    parameter_values,
    preset,
)
from swath_sysid.manoeuvring.hull.simulation import SteeredCraft, simulate, steady_speed
from swath_sysid.manoeuvring.hull.standard_tests import RECIPE, TESTS, DriveSettings, run_test, trial_programme
from swath_sysid.manoeuvring.hull.terms import CROSS, DAMPING, INDEX, NAMES, OFFSET, PARAMETERS, PrimeUnits
from swath_sysid.manoeuvring.hull.thrust import delayed, lagged, thrust_curve

RICH = dict(
    m=180.0, Iz=446.0, Xu_dot=-20.0, Yv_dot=-90.0, Yr_dot=5.0, Nv_dot=-7.0, Nr_dot=-100.0, x_G=0.15, Xu=-50.0,
    Xuu=-70.0, Yv=-40.0, Yvvv=-30.0, Yr=12.0, Nr=-400.0, Nv=-15.0, Nvvv=-9.0, lever=1.0, deduction=0.25,
    moment_factor=0.25,
)  # fmt: skip
"""The terms of the paper's printed equations, and a centre of gravity ahead of the origin."""


def printed_equations(u, v, r, port, starboard, p):
    """PAPERS E, written out and solved as a linear system: an independent oracle."""
    moment = p['m'] * p['x_G']
    mass = [
        [p['m'] - p['Xu_dot'], 0, 0],
        [0, p['m'] - p['Yv_dot'], moment - p['Yr_dot']],
        [0, moment - p['Nv_dot'], p['Iz'] - p['Nr_dot']],
    ]
    hull = [
        p['Xu'] * u + p['Xuu'] * abs(u) * u + (p['m'] * v + moment * r) * r,
        p['Yv'] * v + p['Yr'] * r + p['Yvvv'] * v**3 - p['m'] * u * r,
        p['Nv'] * v + p['Nr'] * r + p['Nvvv'] * v**3 - moment * u * r,
    ]
    turning = (1 + p['moment_factor']) * (starboard - port) * p['lever']
    return np.linalg.solve(mass, np.add(hull, [(1 - p['deduction']) * (starboard + port), 0.0, turning]))


@given(*[st.floats(-2.0, 2.0)] * 3, *[st.floats(-100.0, 100.0)] * 2)
@settings(max_examples=60, deadline=None)
def test_accelerations_are_the_printed_equations(u, v, r, port, starboard):
    model = ManoeuvringModel(parameter_values(RICH))
    found = model.accelerations(u, v, r, port, starboard)
    assert np.allclose(found, printed_equations(u, v, r, port, starboard, RICH), rtol=1e-12, atol=1e-12)


def test_every_hull_term_acts_in_its_own_row_only():
    rows = {'X': 0, 'Y': 1, 'N': 2}
    plain = ManoeuvringModel(parameter_values({'m': 2.0, 'Iz': 3.0}))
    for parameter in PARAMETERS:
        if parameter.kind not in (DAMPING, CROSS, OFFSET):
            continue
        change = np.subtract(
            plain.with_values(**{parameter.name: 1.5}).accelerations(0.7, 0.4, -0.3, 0.0, 0.0),
            plain.accelerations(0.7, 0.4, -0.3, 0.0, 0.0),
        )
        assert change[rows[parameter.row]] != 0.0
        assert np.count_nonzero(change) == 1


def test_jacobian_against_finite_differences():
    model = ManoeuvringModel(parameter_values(RICH | {'Nuv': -20.0, 'Yuv': -9.0, 'Nur': -11.0, 'advance': 0.1}))
    state = np.array([1.1, -0.2, 0.3])
    found = model.jacobian(*state, 20.0, 35.0)
    for row in range(3):
        expected = approx_fprime(state, lambda s, row=row: model.accelerations(*s, 20.0, 35.0)[row], 1e-7)
        assert np.allclose(found[row], expected, rtol=1e-4, atol=1e-5)


def test_simulation_against_an_adaptive_integrator():
    model = replace(preset('wamv-vrx-new'), current=(0.25, -0.1))
    found = simulate(model, np.full(200, 80.0), np.full(200, 140.0), 0.1, state=(0.3, 0.1, -0.05), heading=0.4)

    def slope(_, s):
        u, v, r, psi = s[:4]
        return [
            *model.accelerations(u, v, r, 80.0, 140.0),
            r,
            u * np.cos(psi) - v * np.sin(psi) + 0.25,
            u * np.sin(psi) + v * np.cos(psi) - 0.1,
        ]

    exact = solve_ivp(slope, (0, 20), [0.3, 0.1, -0.05, 0.4, 0, 0], rtol=1e-10, atol=1e-12, t_eval=found.time).y
    assert np.allclose([found.u, found.v, found.yaw_rate], exact[:3], atol=2e-5)
    assert np.allclose([found.heading, found.x, found.y], exact[3:], atol=5e-3)
    carried = 0.25 * np.cos(found.heading) - 0.1 * np.sin(found.heading)
    assert np.allclose(found.surge, found.u + carried)


SHAPES = {
    'gain': st.floats(10.0, 500.0),
    'reverse_ratio': st.floats(0.2, 1.5),
    'dead_band': st.floats(0.0, 0.5),
    'exponent': st.floats(0.5, 2.5),
    'reverse_exponent_ratio': st.floats(0.7, 1.4),
    'full_input': st.sampled_from([1.0, 120.0]),
}


@given(st.floats(-1.0, 1.0), st.fixed_dictionaries(SHAPES))
@settings(max_examples=80, deadline=None)
def test_thrust_curve_is_its_printed_formula(share, shape):
    gain, reverse, dead_band, exponent, ratio, full = (shape[name] for name in SHAPES)
    p = parameter_values(shape)
    thrust = float(thrust_curve(share * full, p))
    beyond = (abs(share) - dead_band) / (1.0 - dead_band)
    if beyond <= 1e-9:
        assert abs(thrust) < 1e-3 * gain * full
    elif share > 0.0:
        assert thrust == pytest.approx(gain * full * beyond**exponent, rel=1e-9)
    else:
        assert thrust == pytest.approx(-gain * full * reverse * beyond ** (exponent * ratio), rel=1e-9)
    assert thrust_curve(full, p) == pytest.approx(gain * full)


@given(st.floats(-3.0, 3.0), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_measurement_is_the_motion_of_the_sensor_seen_by_its_compass(heading, b, c, x, y):
    p = parameter_values(dict(deviation_B=b, deviation_C=c, sensor_x=x, sensor_y=y))
    u, v, r, current = 1.3, -0.2, 0.4, (0.3, -0.1)
    compass = float(recorded_heading(heading, p))
    assert compass == pytest.approx(heading + b * np.sin(compass) + c * np.cos(compass), abs=2e-3)
    heading = compass - b * np.sin(compass) - c * np.cos(compass)

    def place(time):
        psi = heading + r * time
        return complex(*current) * time + (u + 1j * v) * np.exp(1j * heading) * time + (x + 1j * y) * np.exp(1j * psi)

    velocity = (place(1e-5) - place(-1e-5)) / 2e-5 * np.exp(-1j * compass)
    surge, sway = recorded_speeds(u, v, r, compass, current, p)
    assert (surge, sway) == pytest.approx((velocity.real, velocity.imag), abs=1e-8)
    assert through_water(surge, sway, r, compass, current, p) == pytest.approx((u, v), abs=1e-12)


def test_lag_and_delay_are_the_exact_responses():
    values = np.concatenate([np.zeros(5), np.full(40, 10.0)])
    mean = lagged(values, 0.3, 0.1)
    time = 0.1 * np.arange(40)
    exact = 10.0 * (1 - 0.3 / 0.1 * (np.exp(-time / 0.3) - np.exp(-(time + 0.1) / 0.3)))
    assert np.allclose(mean[5:], exact, atol=1e-12)
    values = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    assert np.allclose(delayed(values, 0.15, 0.1), [0, 0, 0, 0.5, 1.0, 0.5])


def test_steered_and_given_inputs_move_the_same_craft():
    thrusters = dict(gain=150.0, dead_band=0.05, lag=0.3, delay=0.13, reverse_ratio=0.7, balance=0.05, exponent=1.4)
    model = preset('wamv-vrx-old').with_values(**thrusters)
    model = replace(model, thrust_input='command', largest_input=1.0)
    craft = SteeredCraft(model)
    for port, starboard in ((0.0, 0.0), (0.5, 0.2), (-0.5, 0.7)):
        craft.hold(port, starboard, 3.0)
    steered = craft.manoeuvre()
    given_inputs = simulate(model, steered.port[:-1], steered.starboard[:-1], 0.1)
    assert np.allclose(steered.u, given_inputs.u, atol=1e-10)
    assert np.allclose(steered.y, given_inputs.y, atol=1e-10)


def test_prime_units_of_the_literature():
    units = PrimeUnits(length=4.0, speed=2.0, density=1000.0)
    half = 0.5 * 1000.0
    powers = {
        'm Xu_dot': (3, 0), 'Yr_dot': (4, 0), 'Iz Nr_dot': (5, 0), 'Xuu': (2, 0), 'Xu Yv': (2, 1), 'Yr Nv': (3, 1),
        'Nr': (4, 1), 'Yvvv': (2, -1), 'Nvvv': (3, -1),
    }  # fmt: skip
    expected = {name: half * 4.0**a * 2.0**b for names, (a, b) in powers.items() for name in names.split()}
    expected['x_G'] = 4.0
    assert units.to_prime('Nr', expected['Nr']) == pytest.approx(1.0)
    assert units.from_prime('Nr', 1.0) == pytest.approx(expected['Nr'])
    assert {name: units.unit(name) for name in expected} == pytest.approx(expected)


def test_speeds_and_crash_stop_against_the_straight_line_equation():
    model = preset('wamv-vrx-old')
    speed = (-51.3 + np.sqrt(51.3**2 + 4 * 72.4 * 200.0)) / (2 * 72.4)
    assert steady_speed(model, 200.0) == pytest.approx(speed, rel=1e-9)
    with pytest.raises(InputError, match='wamv-vrx-old'):
        preset('titanic')
    stop = run_test('crash-stop', model).numbers

    def slope(_, s):
        return [(-300.0 - 51.3 * s[0] - 72.4 * s[0] * abs(s[0])) / 180.0, s[0]]

    def halted(_, s):
        return s[0]

    halted.terminal = True
    exact = solve_ivp(slope, (0, 10), [stop['initial_speed_m_s'], 0], events=halted, rtol=1e-10, atol=1e-12)
    assert stop['stopping_time_s'] == pytest.approx(exact.t[-1], abs=0.11)
    assert stop['head_reach_m'] == pytest.approx(exact.y[1, -1], abs=0.02)
    curve = run_test('speed', model).curve
    resistance = 51.3 * curve['speed_m_s'] + 72.4 * curve['speed_m_s'] ** 2
    assert np.allclose(resistance, 2 * curve['input'], rtol=5e-3)


def test_turning_circle_zigzag_and_spiral():
    model = preset('wamv-vrx-new')
    settings_ = DriveSettings(base=0.6, difference=0.3)
    port, starboard = 0.9 * model.largest_input, 0.3 * model.largest_input
    u, v, r = fsolve(lambda s: model.accelerations(*s, port, starboard), [1.0, 0.2, -0.2])
    numbers = run_test('turning-circle', model, settings_).numbers
    assert numbers['steady_diameter_m'] == pytest.approx(2 * np.hypot(u, v) / abs(r), rel=2e-3)
    assert numbers['steady_yaw_rate_deg_s'] == pytest.approx(np.degrees(r), rel=2e-3)
    assert 0 < numbers['transfer_m'] < numbers['tactical_diameter_m']
    zigzag = run_test('zigzag', model)
    assert 0 < zigzag.numbers['first_overshoot_deg'] < 20
    assert np.degrees(np.max(zigzag.manoeuvre.heading)) > 20
    assert run_test('spiral', model).numbers['loop_height_deg_s'] < 0.05
    assert set(TESTS) == {'turning-circle', 'zigzag', 'speed', 'crash-stop', 'spiral'}


def test_stability_check_knows_the_unstable_craft():
    stable, region = preset('wamv-vrx-old'), Region(0.0, 1.5, 0.5, 0.4, 0.0, 150.0, 100.0)
    assert check_stability(stable, region).stable
    # the criterion of straight-line stability: Yv Nr - Nv (Yr - m u) > 0
    critical = 40.0 * 400.0 / (180.0 * 1.5)
    for share, expected in ((0.9, True), (1.1, False)):
        found = check_stability(stable.with_values(Nv=-share * critical), region)
        assert (found.largest_growth < 0) == expected
        assert check_stability(stable.with_values(Nv=-share * critical), region).stable == expected


def test_numbers_of_the_public_craft_of_the_sea_and_of_what_is_to_be_driven():
    assert (OLD.length, OLD['lever']) == (4.88, 1.027135)
    assert PrimeUnits(2.0, 1.0).unit('m') == pytest.approx(4.0 * 1025.0)
    runs = trial_programme(OLD).values()
    assert [duration for _, _, duration in RECIPE] == pytest.approx([run.time[-1] for run in runs], abs=0.2)
    assert max(np.max(np.abs(run.port)) for run in runs) <= OLD.largest_input
    check_physical(OLD.with_values(Xuu=-0.9e12))
    with pytest.raises(InputError, match='Xuu'):
        check_physical(OLD.with_values(Xuu=-1.2e12))


def test_a_compass_reading_is_found_from_the_heading_to_a_thousandth():
    p = OLD.with_values(deviation_B=0.2, deviation_C=-0.15).values
    heading = np.linspace(-3.0, 3.0, 100)
    reading = recorded_heading(heading, p)
    assert np.max(np.abs(reading - deviation(reading, p) - heading)) < 1e-3


def test_a_motion_that_dies_within_a_step_is_stepped_through_finely_enough():
    """The scheme diverges at 2.78 of damping rate times step."""
    stiff = OLD.with_values(Nr=-29.0 * OLD['Iz'], Nrr=0.0)
    found = simulate(stiff, np.zeros(100), np.zeros(100), 0.1, (0.0, 0.0, 0.01))
    assert abs(found.yaw_rate[-1]) < 1e-6


def test_a_test_begins_at_the_steady_speed_and_ends_after_fifteen_minutes():
    run = run_test('turning-circle', OLD, DriveSettings(difference=1e-5)).manoeuvre
    assert run.time[-1] == pytest.approx(900.0, abs=0.2)
    assert run.u[50] == pytest.approx(run.u[0], rel=1e-6) and run.heading[1] != 0.0


@pytest.mark.parametrize('name', NAMES)
def test_every_parameter_has_both_ends(name):
    for end, side in zip(PARAMETER_RANGES[name], (-1, 1), strict=True):
        values = OLD.values.copy()
        values[INDEX[name]] = math.nextafter(end, side * math.inf)
        # past what the model itself refuses, such as a mass below zero
        wrong = object.__new__(ManoeuvringModel)
        object.__setattr__(wrong, 'values', values)
        with pytest.raises(InputError, match=f'the parameter {name} '):
            check_physical(wrong)


def test_presets_are_craft_and_masses_that_are_not_positive_are_none():
    for name in PRESETS:
        check_physical(preset(name))
    for coupling in (0.0, 100.0, 280.0, 290.0, 1e4):
        matrix = np.array([[OLD['m'], -coupling], [-coupling, OLD['Iz']]])
        coupled = OLD.with_values(Yr_dot=coupling, Nv_dot=coupling)
        if np.linalg.eigvalsh(matrix)[0] > 0.0:
            check_physical(coupled)
        else:
            with pytest.raises(InputError, match='Yr_dot'):
                check_physical(coupled)
