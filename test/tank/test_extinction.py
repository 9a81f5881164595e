"""Extinction curves and dimensional damping, against closed forms and scipy's integrator."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from repository import RECORDS
from scipy.integrate import solve_ivp

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import AmplitudeCurves, DecayModel
from swath_sysid.attitude.identification.fit_quality import AmplitudeBands
from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.identify_records import identify
from swath_sysid.formats.reading import read_trial
from swath_sysid.report.tables import Column
from swath_sysid.tank.extinction import Particulars, TypeB, extinction_of, tank_quantities
from swath_sysid.tank.report.extinction_tables import curve_rows, curve_table, tank_tables


def decay(b1=0.0, b2=0.0, b3=0.0, w0=3.0, start=0.2, duration=40.0, trim=0.0):
    """A free decay made by scipy, as a motion."""
    time = np.arange(0.0, duration, 0.01)

    def slope(_, state):
        x, w = state
        return w, -(b1 + b2 * abs(w) + b3 * w * w) * w - w0**2 * x

    angle, rate = solve_ivp(slope, (0.0, duration), (start, 0.0), t_eval=time, rtol=1e-10, atol=1e-12).y
    return AxisMotion('roll', time, angle + trim, rate)


def extinction(motion, period=2.0 * np.pi / 3.0):
    return extinction_of([measured_peaks(motion, period)])


@settings(deadline=None, max_examples=20)
@given(damping_ratio=st.floats(0.005, 0.3), w0=st.floats(0.5, 8.0), trim=st.floats(-0.1, 0.1))
def test_the_logarithmic_decrement_of_a_linear_decay_is_that_of_the_textbook(damping_ratio, w0, trim):
    # successive turning points are pi / wd apart and fall by exp(-pi zeta / sqrt(1 - zeta^2))
    damped = w0 * np.sqrt(1.0 - damping_ratio**2)
    time = 0.1 + np.pi / damped * np.arange(8)
    angle = trim + 0.2 * np.exp(-damping_ratio * w0 * time) * (-1.0) ** np.arange(8)
    found = extinction_of([Peaks(time, angle)])
    textbook = 2.0 * np.pi * damping_ratio / np.sqrt(1.0 - damping_ratio**2)
    assert found.peaks[0].logarithmic_decrement == pytest.approx(textbook, rel=1e-6)
    assert found.damping[0] == pytest.approx(2.0 * damping_ratio * w0, rel=1e-6)
    assert found.period == pytest.approx(2.0 * np.pi / damped)


def test_a_rate_alone_gives_the_curve_which_takes_three_turning_points():
    whole = decay(b1=0.06)
    assert extinction(replace(whole, angle=None)).damping[0] == pytest.approx(0.06, rel=0.02)
    with pytest.raises(InputError, match='three turning points'):
        extinction_of([Peaks(np.arange(2.0), np.array([0.2, -0.1]))])


@pytest.mark.long
@pytest.mark.parametrize(('term', 'value'), [('b1', 0.06), ('b2', 0.3), ('b3', 0.4)])
def test_each_damping_term_gives_its_power_of_the_extinction_curve(term, value):
    # averaging: (pi / 2 w) b1 a, 4/3 b2 a^2, 3/8 pi w b3 a^3
    found = extinction(decay(**{term: value}))
    k = int(term[1]) - 1
    amplitude = found.peaks[0].mean_amplitude
    averaged = (np.pi / 6.0, 4.0 / 3.0, 0.375 * np.pi * 3.0)[k] * value * amplitude ** (k + 1)
    np.testing.assert_allclose(found.peaks[0].decrement, averaged, rtol=0.01, atol=2e-6)
    assert found.damping[k] == pytest.approx(value, rel=0.02)
    if term == 'b2':  # Bertin's N is the same at every amplitude
        np.testing.assert_allclose(found.peaks[0].bertin[:20], 0.4, rtol=0.01)
        assert found.bertin == pytest.approx(0.4, rel=0.005)
    others = np.delete(found.coefficients * 0.15 ** np.arange(1, 4), k)
    assert np.abs(others).max() < 0.03 * found.curve(0.15)


@pytest.mark.long
def test_the_curve_of_a_noisy_record_holds_its_truth_within_its_standard_deviations():
    powers = np.array([0.1, 0.01, 0.001])
    clean = decay(b1=0.05, b2=0.25, duration=30.0)
    averaged = powers @ [np.pi / 6.0 * 0.05, 4.0 / 3.0 * 0.25, 0.0]
    far = []
    for seed in range(40):
        noise = 0.002 * np.random.default_rng(seed).normal(size=clean.size)
        found = extinction(replace(clean, angle=clean.angle + noise))
        far.append((found.curve(0.1) - averaged) / np.sqrt(powers @ found.covariance @ powers))
    assert np.mean(np.abs(far) < 2.0) > 0.85
    assert np.abs(far).max() < 5.0


MODEL = DecayModel.of(b1=0.2, r1=4.0, axis='roll')


def bands(exponent=0.0, ratio=0.05):
    amplitude = np.geomspace(0.01, 0.3, 60)
    curves = AmplitudeCurves(amplitude, np.full(60, 2.0), ratio * (amplitude / 0.1) ** exponent)
    return AmplitudeBands(curves, np.full(60, 0.002), 0.02 * curves.damping_ratio)


def budget(axis='roll', exponent=0.0, particulars=None, repeats=(), **type_b):
    given = particulars or Particulars(mass=100.0, metacentric_height=0.4, length=3.0, breadth=1.2)
    inertia = given.inertia_of(MODEL)
    found = tank_quantities(axis, bands(exponent), 0.1, inertia, given, TypeB(**type_b), repeats)
    return {q.name: q for q in found}


def test_damping_in_dimensions_follows_from_gm():
    found = budget()
    inertia = 100.0 * 9.80665 * 0.4 / 4.0
    assert found['natural period'].value == pytest.approx(np.pi)
    assert found['B44'].value == pytest.approx(2.0 * 0.05 * 2.0 * inertia)
    # ITTC: B44 / (rho V B^2) sqrt(B / 2 g)
    assert found['B44 without dimension'].value == pytest.approx(
        found['B44'].value / (100.0 * 1.2**2) * np.sqrt(1.2 / (2.0 * 9.80665))
    )
    pitch = budget('pitch')
    without_dimension = pitch['B55'].value / (100.0 * 3.0**2) * np.sqrt(3.0 / 9.80665)
    assert pitch['B55 without dimension'].value == pytest.approx(without_dimension)
    assert 'B44' not in budget(particulars=Particulars(mass=100.0))


@pytest.mark.parametrize(
    ('source', 'quantity', 'share'),
    [
        ('time_base', 'natural period', 1.0),
        ('mass', 'B44', 1.0),
        ('mass', 'B44 without dimension', 0.0),
        ('metacentric_height', 'B44 without dimension', 1.0),
        ('sensor_scale', 'natural period', 0.0),
        ('sensor_scale', 'B44', 0.7),
    ],
)
def test_each_source_of_type_b_counts_as_the_measurement_would_change(source, quantity, share):
    # the oracle: m g GM / w0^2 * 2 zeta w0, with zeta as amplitude^0.7, by its powers
    found = budget(exponent=0.7, **{source: 0.03})[quantity]
    assert found.type_b.get(source, 0.0) == pytest.approx(share * 0.03 * found.value, rel=1e-3, abs=1e-12)
    assert found.expanded == pytest.approx(2.0 * np.hypot(found.fit, share * 0.03 * found.value), rel=1e-3)


def test_type_a_is_the_larger_of_the_fit_and_the_scatter_of_repeats():
    for ratios, combined in (([0.05] * 3, 0.02 * 0.05), ([0.04, 0.05, 0.06], 0.01 / np.sqrt(3.0))):
        found = budget(repeats=[bands(ratio=r) for r in ratios])['equivalent damping ratio']
        assert found.combined == pytest.approx(combined)


def test_measured_roll_of_a_tanker_decays_by_its_curve_as_by_its_fitted_motion():
    motion = read_trial(RECORDS / 'kvlcc2_roll_decay.csv').axis('roll')
    found = identify([motion], IdentificationSettings('odd-cubic'))
    curve = extinction_of([measured_peaks(found.records[0].motion, found.records[0].segment.period)])
    amplitude, period = np.radians(5.0), found.model.natural_period
    by_motion = 2.0 * np.pi * np.interp(amplitude, found.bands.curves.amplitude, found.bands.curves.damping_ratio)
    assert 2.0 * curve.curve(amplitude) / amplitude == pytest.approx(by_motion, rel=0.1)
    assert curve.period == pytest.approx(period, rel=0.01)


def test_terms_in_which_curve_and_motion_fit_differ_are_marked_and_counted():
    motion = decay(b1=0.06, b2=0.3, duration=30.0)
    terms = {'b1': (0.06, 0.02), 'b2': (3.0, 0.01)}
    rows = curve_rows(extinction(motion), terms, None, Particulars(), 'roll')
    alone = curve_table('extinction', '', rows)
    assert alone.finding.endswith('differ by more than their intervals in: b2.')
    assert alone.marks == {(5, 2): 'beyond', (5, 4): 'beyond'}
    several = curve_table('extinction', '', [(at, *row) for at in (1, 2) for row in rows], (Column('draft'),))
    assert 'b2 (in 2 of 2 conditions)' in several.finding and len(several.marks) == 4
    assert not curve_table('extinction', '', rows[:4]).finding


@pytest.mark.long
def test_where_the_formula_of_the_curve_errs_the_motion_fit_is_recommended():
    hull = hull_named('swath-roll').model
    motion = simulated_trial(hull, np.radians(8.0), 15.0, 100.0, SensorNoise(), 1).axis('roll')
    _, curve, _ = tank_tables(identify([motion]), Particulars(), TypeB())
    by_curve, by_motion = next((row[2], row[4]) for row in curve.rows if row[0] == 'b3')
    assert abs(by_curve - hull.terms['b3']) > 5.0 * abs(by_motion - hull.terms['b3'])
    assert curve.finding.endswith('Use the motion fit.')


@pytest.mark.slow
def test_identify_prints_the_tanks_output(tmp_path, capsys):
    file = tmp_path / 'roll.csv'
    motion = decay(b1=0.06, b2=0.3, duration=30.0)
    write_csv(file, Trial(motion.time, roll=motion.angle, roll_rate=motion.rate))
    craft = ['--mass', '100', '--metacentric-height', '0.4', '--breadth', '1.2', '--uncertainty', 'mass=0.01']
    identify = ['identify', str(file), '--objective', 'one-step', '--equation', 'linear', '--extinction', '--force']
    assert main([*identify, '--json', *craft]) == 0
    found = json.loads(capsys.readouterr().out)
    peak = found['peaks'][1]
    averaged = 2.0 * (np.pi / 6.0 * 0.06 + 4.0 / 3.0 * 0.3 * np.radians(peak['mean amplitude [deg]']))
    assert peak['logarithmic decrement per cycle'] == pytest.approx(averaged, rel=0.01)
    assert found['extinction'][-2]['extinction curve'] == pytest.approx(0.3, rel=0.1)
    damping = {row['quantity']: row for row in found['damping']}
    assert damping['B44']['type B, mass'] == pytest.approx(0.01 * damping['B44']['value'])


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--uncertainty', 'luck=0.1'], 'no source of uncertainty'),
        (['--uncertainty', 'mass=x'], 'needs a share'),
        (['--uncertainty', 'sensor_scale=2'], 'sensor_scale'),
        (['--breadth', '0'], 'greater than zero'),
        (['--metacentric-height', '1'], 'both --mass'),
        (['--inertia', '1', '--mass', '1', '--metacentric-height', '1'], 'each sets the inertia'),
    ],
)
def test_particulars_that_cannot_be_used_are_refused(words, said, capsys):
    assert main(['identify', 'roll.csv', *words]) == 2
    assert said in capsys.readouterr().err
