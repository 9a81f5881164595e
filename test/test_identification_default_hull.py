"""One general hull, pruned by evidence, is what is identified where no equation is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from swath_sysid.attitude.hull.catalogue import (
    EQUATIONS,
    GENERAL_HULL,
    PUBLISHED_HULLS,
    composed,
    equation_named,
    published_alike,
)
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.identification.identify import IdentificationSettings, identify
from swath_sysid.attitude.identification.pruning import log_evidence, prune
from swath_sysid.attitude.identification.scoring import Evaluation, LogPosterior
from swath_sysid.common.errors import InputError


class Regression(LogPosterior):
    """A linear regression: its evidence is known in closed form."""

    def __init__(self, equation, truth, samples=40):
        rng = np.random.default_rng(1)
        self.equation, n = equation, len(equation.terms)
        self.slopes = rng.normal(size=(samples, n))
        self.values = self.slopes @ truth + rng.normal(size=samples)
        self.ratio_prior = np.full(n, 2.0)
        self.lowest = np.where([name.startswith('b') for name in equation.terms], 0.0, -np.inf)

    def evaluate(self, points):
        return [self._at(z) for z in points]

    def _at(self, z):
        e = self.slopes @ z - self.values
        weight = self.ratio_prior**-2
        information = self.slopes.T @ self.slopes + np.diag(weight)
        return Evaluation(z, 0.5 * e @ e + 0.5 * weight @ z**2, self.slopes.T @ e + weight * z, information)

    def optimum(self):
        n = len(self.equation.terms)
        (found,) = self.search_each([np.zeros(n)], [np.zeros(n, dtype=bool)])
        return found


def test_evidence_is_the_marginal_likelihood_of_a_regression():
    case = Regression(composed(('b1', 'r1', 'r2', 'r3')), np.array([5.0, 3.0, 0.2, 0.0]))
    complete = case.optimum()
    kept = np.array([True, True, True, False])
    held = replace(
        complete, z=np.append(np.linalg.solve(complete.information[:3, :3], case.slopes[:, :3].T @ case.values), 0)
    )
    (without,) = case.evaluate([held.z])
    found = log_evidence(case, complete, np.ones(4, dtype=bool)) - log_evidence(case, without, kept)

    def exact(columns):
        covariance = np.eye(40) + 4.0 * case.slopes[:, columns] @ case.slopes[:, columns].T
        return multivariate_normal(np.zeros(40), covariance).logpdf(case.values)

    # what the linear terms' own priors add is the same in both
    assert found == pytest.approx(exact([0, 1, 2, 3]) - exact([0, 1, 2]), abs=0.01)


def test_evidence_of_damping_counts_what_takes_energy_only():
    case = Regression(composed(('b1', 'b2', 'r1')), np.array([5.0, 0.1, 3.0]))
    best = case.optimum()
    (without,) = case.evaluate([np.append(np.linalg.solve(*_of([0, 2], case)), 0.0)[[0, 2, 1]]])
    found = log_evidence(case, best, np.ones(3, dtype=bool)) - log_evidence(
        case, without, np.array([True, False, True])
    )

    def profile(b2):
        rest = np.linalg.solve(
            best.information[::2, ::2], case.slopes[:, ::2].T @ (case.values - b2 * case.slopes[:, 1])
        )
        (at,) = case.evaluate([np.array([rest[0], b2, rest[1]])])
        return np.exp(without.cost - at.cost + 0.5 * b2**2 / 4.0) * 2.0 * norm(0.0, 2.0).pdf(b2)

    assert found == pytest.approx(np.log(quad(profile, 0.0, 5.0)[0]), abs=0.01)


def _of(places, case):
    block = case.evaluate([np.zeros(3)])[0].information[np.ix_(places, places)]
    return block, case.slopes[:, places].T @ case.values


def test_terms_that_are_not_there_go_and_the_others_stay():
    truth = dict.fromkeys(GENERAL_HULL.terms, 0.0) | {'b1': 5.0, 'b3': 2.0, 'r1': 3.0, 'r2': -1.5}
    case = Regression(GENERAL_HULL, np.array(list(truth.values())))
    pruned = prune(case, case.optimum())
    assert [n for n, kept in zip(GENERAL_HULL.terms, pruned.kept, strict=True) if kept] == ['b1', 'b3', 'r1', 'r2']


@pytest.mark.parametrize('name', ['swath-roll', 'hydrofoil-pitch'])
def test_the_next_release_of_a_published_hull_is_reproduced(name):
    hull = PUBLISHED_HULLS[name]
    trial = simulated_trial(hull.model, np.radians(6.0), 20.0, 100.0, SensorNoise(rate=hull.rate_noise), 1, hold=1.0)
    found = identify([trial.axis(hull.axis)])
    time, start = np.arange(0.0, 12.0, 0.02), np.radians(5.0)
    truth = simulate(hull.model, start, 0.0, time)[0]
    error = simulate(found.model.with_trim(0.0), start, 0.0, time)[0] - truth
    assert np.sqrt(np.mean(error**2)) < 0.03 * truth.std()
    assert found.posterior.equation == GENERAL_HULL
    assert set(found.model.terms) < set(GENERAL_HULL.terms)
    assert equation_named(found.model.equation.name).terms == found.model.equation.terms
    assert found.identified_model({}).posterior == found.posterior


def test_friction_is_found_where_only_angles_were_measured_and_left_out_where_there_is_none():
    equation = EQUATIONS['odd-cubic+friction']
    for friction in (0.03, 0.0):
        ratios = {'b0': friction, 'b1': 0.5, 'b2': 0.0, 'r1': 10.0, 'r3': 0.0}
        rig = PUBLISHED_HULLS['swath-pitch'].model.from_terms(equation, ratios, friction_rate=0.006)
        motion = simulated_trial(rig, np.radians(6.0), 15.0, 100.0, SensorNoise(5e-4, 0.004), 1, 1.0).axis('pitch')
        found = identify([replace(motion, rate=None)])
        assert ('b0' in found.model.terms) == (friction > 0.0)
        assert found.model.terms.get('b0', 0.0) == pytest.approx(friction, abs=0.005)
        assert found.basin is None and found.posterior is not None


def test_names():
    assert published_alike(composed(('b1', 'b2', 'r1', 'r2', 'r3')), 'pitch') == ('swath-pitch-2',)
    # a tanker's roll is no hydrofoil's pitch
    assert published_alike(composed(('b1', 'b2', 'b3', 'r1', 'r3')), 'roll') == ()
    with pytest.raises(InputError, match='without a name'):
        IdentificationSettings('')
    with pytest.raises(InputError, match="no equation 'automatic'"):
        IdentificationSettings('automatic')
