"""Checks of a fit, against closed forms and another integrator: peaks, errors ahead, nested equations."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.identification.forecast_check import (
    forecast_errors,
    measured_states,
    next_step,
    simulation_error,
)
from swath_sysid.attitude.identification.identify import identify_problem, refit_from
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.attitude.identification.selection import enforce_nesting, simplest_adequate
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.plain import as_plain, from_plain

HULL = hull_named('swath-pitch').model
SOFTER = DecayModel.from_terms(HULL.equation, HULL.terms | {'r1': 12.0}, axis='pitch')
QUIET = SensorNoise(0.0, 0.0, 0.0)


def released(angle_deg, seed=1, noise=SensorNoise()):  # noqa: B008 - frozen
    return simulated_trial(HULL, math.radians(angle_deg), 10.0, 25.0, noise, seed).axis('pitch')


def test_peaks_of_a_record_are_those_of_the_motion_whatever_its_trim():
    time, damped = np.arange(0.0, 40.0, 0.01), np.sqrt(9.0 - 0.03**2)
    swing = 0.2 * np.exp(-0.03 * time) * (np.cos(damped * time) + 0.03 / damped * np.sin(damped * time))
    found = measured_peaks(AxisMotion('roll', time, 0.05 + swing, None), 2.1)
    np.testing.assert_allclose(found.time[:10], np.pi / damped * np.arange(1, 11), atol=5e-4)
    expected = 0.05 + 0.2 * np.exp(-0.03 * found.time) * np.cos(damped * found.time)
    np.testing.assert_allclose(found.angle[:10], expected[:10], rtol=2e-3)
    # of a rate alone the angle is the integral, whose level is not known
    alone = measured_peaks(AxisMotion('roll', time, None, np.gradient(swing, time)), 2.1)
    assert alone.decrement[:8] == pytest.approx(found.decrement[:8], rel=0.02)


def test_decrements_of_a_geometric_decay_and_their_covariance():
    found = Peaks(np.arange(8.0), 0.1 + 0.2 * (-0.8) ** np.arange(8))
    assert found.decrement == pytest.approx(0.2 * 0.9 * 0.2 * 0.8 ** np.arange(6))
    assert found.logarithmic_decrement == pytest.approx(np.full(6, -2.0 * math.log(0.8)))
    assert found.bertin == pytest.approx(0.036 * 0.8 ** np.arange(6) / (0.162 * 0.8 ** np.arange(6)) ** 2)
    assert found.period == pytest.approx(np.full(6, 2.0))
    angles = found.angle + 1e-6 * np.eye(8)
    slopes = [(replace(found, angle=angle).decrement - found.decrement) / 1e-6 for angle in angles]
    assert found.decrement_covariance == pytest.approx(np.transpose(slopes) @ slopes, abs=1e-8)


def test_next_step_is_the_papers_formula():
    motion = released(6)
    found = next_step(HULL, motion)
    k = 37
    step = motion.time[k + 1] - motion.time[k]
    expected = motion.rate[k] + step * HULL.acceleration(motion.angle[k], motion.rate[k])
    assert found.predicted[k] == pytest.approx(expected) and found.measured[k] == motion.rate[k + 1]
    assert found.error[k] == pytest.approx(expected - motion.rate[k + 1])


@pytest.mark.long
def test_simulation_and_forecasts_against_another_integrator():
    motion, period = released(9, noise=QUIET), HULL.natural_period
    (found,) = forecast_errors(SOFTER, motion, period, leads=(0.5,))
    angle, rate, first = measured_states(motion, period)

    def solved(start, times):
        slopes = lambda _, y: (y[1], SOFTER.acceleration(*y))  # noqa: E731
        return solve_ivp(slopes, (0, times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-12).y[0]

    errors = [
        solved((angle[k], rate[k]), [0.5 * period])[0] - np.interp(due, motion.time, motion.angle)
        for k in np.unique(np.linspace(first, motion.size - 1, 200).astype(int))
        if (due := motion.time[k] + 0.5 * period) <= motion.time[-1]
    ]
    assert found == pytest.approx(np.sqrt(np.mean(np.square(errors))) / np.std(motion.angle), rel=1e-4)
    off = solved((motion.angle[0], 0.0), motion.time) - motion.angle
    expected, start = np.sqrt(np.mean(off**2)) / np.std(motion.angle), InitialState(motion.angle[0], 0.0, 0.0)
    assert simulation_error(SOFTER, start, motion) == pytest.approx(expected, rel=1e-4)
    short = motion.between(None, 1.2 * period)
    assert math.isnan(forecast_errors(HULL, short, 1.15 * period)[-1])


def test_measured_states_use_the_past_alone():
    motion = released(6)
    angle, rate, first = measured_states(motion, 2.0)
    cut = motion.only(slice(0, 200))
    assert np.array_equal(measured_states(cut, 2.0)[0][first:], angle[first:200])
    truth = released(6, noise=QUIET)
    assert np.std((rate - truth.rate)[first:]) < np.std(motion.rate - truth.rate)
    # of a period of a few samples there is no parabola
    assert measured_states(motion, 0.1)[2] == 0


@pytest.mark.long
def test_a_fit_is_kept_as_plain_data_and_one_worse_than_what_it_contains_is_refined():
    problem = prepare([released(6)])
    each = [IdentificationSettings(equation=name) for name in ('linear', 'swath-pitch-2')]
    small, large = (identify_problem(problem, settings) for settings in each)
    kept = json.loads(json.dumps(large.plain()))
    assert Identification.restored(kept, problem, large.settings).plain() == large.plain()
    pairs = {'a': (1.0, 2.0)}
    assert from_plain(dict[str, tuple[float, ...]], json.loads(json.dumps(as_plain(pairs)))) == pairs
    failed = replace(large, objective_value=2.0 * small.objective_value)
    found = enforce_nesting(
        [small, failed], lambda fit, better: refit_from(problem, fit.settings, better.model.ratios, better.states, None)
    )
    assert found[0] is small and found[1].objective_value == pytest.approx(large.objective_value, rel=1e-6)


def test_an_equation_that_alone_fits_well_is_chosen_whatever_its_terms():
    names = enumerate(('bc', 'a'))
    fits = [SimpleNamespace(name=n, term_count=len(n), criterion=99.0 * k, held_out=0.1) for k, n in names]
    choice, reason = simplest_adequate(fits)
    assert choice.name == 'bc' and reason.startswith('bc is the only equation whose criterion is within')
