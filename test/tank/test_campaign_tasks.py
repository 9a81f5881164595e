"""The pure part of campaigns: fits together, order of nested equations, judging, ranking."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import from_plain
from swath_sysid.tank.campaign import evaluation
from swath_sysid.tank.campaign.evaluation import Condition, FitJudgement, TankRecord
from swath_sysid.tank.campaign.trials import of_like_periods, turns_of
from swath_sysid.tank.report.campaign_report import decay_drawings

HULL = hull_named('swath-pitch').model
NAMES = ('linear', 'swath-pitch-2', 'swath-pitch-1')
SIMULATION = IdentificationSettings(search=SearchSettings())
QUIET = SensorNoise(0.0, 0.0, 0.0)


def trial(angle_deg, seed, noise=SensorNoise(), duration=10.0):  # noqa: B008 - frozen
    return simulated_trial(HULL, math.radians(angle_deg), duration, 25.0, noise, seed)


def kept(plain, problem, settings):
    """What a task gave, as it comes back from the store."""
    return Identification.restored(json.loads(json.dumps(plain)), problem, settings)


def settled(problem, fits):
    plain = evaluation.settle(problem, fits)
    return [kept(each, problem, fit.settings) for each, fit in zip(plain, fits, strict=True)]


def fitted(problem, names):
    each = [replace(SIMULATION, equation=name) for name in names]
    return settled(problem, [kept(evaluation.fit_one(problem, settings), problem, settings) for settings in each])


def judged(fits, other):
    return from_plain(tuple[FitJudgement, ...], json.loads(json.dumps(evaluation.judge(fits, other))))


@pytest.fixture(scope='module')
def records():
    """Two repeats from 6 deg and one from 9 deg."""
    motions = [(angle, trial(angle, seed, duration=6.0).axis('pitch')) for angle, seed in ((6, 1), (6, 2), (9, 3))]
    return [
        TankRecord(f'{k}', Condition('pitch', 1.0, angle), k % 2 + 1, motion, prepare([motion]))
        for k, (angle, motion) in enumerate(motions)
    ]


@pytest.fixture(scope='module')
def fits(records):
    return [fitted(r.problem, NAMES) for r in records]


def with_terms(fit, **terms):
    model = fit.model
    return replace(fit, model=DecayModel.from_terms(model.equation, model.terms | terms, trim=model.trim, axis='pitch'))


@pytest.mark.long
def test_settling_repairs_a_search_that_failed(records, fits):
    small, large = fits[0][0], fits[0][1]
    wrong = with_terms(large, **{t: 1.3 * value for t, value in large.model.terms.items()})
    failed = replace(wrong, objective_value=2.0 * small.objective_value)
    repaired = settled(records[0].problem, (small, failed))
    assert repaired[1].objective_value <= small.objective_value and repaired[0].plain() == small.plain()
    assert repaired[1].objective_value == pytest.approx(large.objective_value, rel=1e-6)
    assert repaired[1].search.stop == 'refined'


def together_of(records, fits, place):
    problem = evaluation.joint_problem(records)
    return kept(evaluation.fit_together(problem, [f[place] for f in fits]), problem, fits[0][place].settings)


@pytest.mark.long
def test_together_is_better_known_than_alone(records, fits):
    together = together_of(records[:2], fits[:2], 1)
    assert together.problem.scales.amplitude == max(r.problem.scales.amplitude for r in records[:2])
    assert len(together.states) == 2
    for term in ('b1', 'r1'):
        value, std = together.ratio(term)
        assert std < min(f[1].ratio(term)[1] for f in fits[:2])
        assert abs(value - HULL.terms[term]) < 4.0 * std


@pytest.mark.long
def test_judging_knows_the_truth_from_a_wrong_hull(records, fits):
    fit = fits[0][1]
    right, bad = judged((fit, with_terms(fit, r1=1.2 * fit.model.terms['r1'])), records[1].problem)
    assert right.simulation < 0.1 and right.held_out < 0.1
    assert bad.simulation > 3 * right.simulation and bad.held_out > 3 * right.held_out
    assert all(b > r for b, r in zip(bad.forecasts, right.forecasts, strict=True))
    # a record without a repeat is judged on its second half
    (found,) = judged(fits[2][:1], None)
    assert 0.0 < found.held_out < 1.0


@pytest.mark.long
def test_the_best_repeat_is_the_best_explained_and_differences_within_the_noise_are_told(records, fits):
    worse = [with_terms(f, r1=1.05 * f.model.terms['r1']) for f in fits[0]]
    assert evaluation.best_repeats(records, [worse, *fits[1:]]) == {records[0].condition: 1, records[2].condition: 2}
    linear, two, one = fits[2]
    alike = replace(one, objective_value=two.objective_value * (1 - 1e-9))
    assert evaluation.beyond_noise((linear, two, alike)) == (True, False, False)
    assert evaluation.tied_best((linear, two, alike)) == (1, 2)
    pairs, best = [(f[1], f[2]) for f in fits], evaluation.best_repeats(records, fits)
    statement = evaluation.noise_statement(records, pairs, best)
    assert 'no difference exceeds the noise' in statement and 'between repeats' in statement


@pytest.mark.long
def test_ranking_takes_the_simplest_adequate(fits, records):
    records, fits = records[1:], fits[1:]
    own = [together_of(records, fits, k) for k in range(len(NAMES))]
    together = settled(own[0].problem, own)
    judgements = [judged(f, records[0].problem) for f in fits]
    ranking = evaluation.rank_campaign('pitch', [together], fits, judgements)
    assert {r.name for r in ranking.ranked} == set(NAMES)
    assert ranking.choice.name == 'swath-pitch-2' and 'swath-pitch-2' in ranking.reason
    assert ranking.findings == ()
    with pytest.raises(InputError, match='no equation could be fitted'):
        evaluation.rank_campaign('pitch', [], [], [])


@pytest.mark.long
def test_spread_between_repeats(fits):
    condition = Condition('pitch', 1.0, 6.0)
    by_name = {s.quantity: s for s in evaluation.spread_of_repeats(condition, [f[1] for f in fits[:2]])}
    values = [f[1].ratio('r1')[0] for f in fits[:2]]
    assert by_name['r1'].mean == pytest.approx(np.mean(values))
    assert by_name['r1'].spread == pytest.approx(abs(values[0] - values[1]) / math.sqrt(2.0))
    assert by_name['natural_period_s'].mean == pytest.approx(HULL.natural_period, rel=0.03)
    assert 0.0 < by_name['damping_ratio'].stated < 0.05


def test_angles_and_rates_are_not_drawn_on_one_axis():
    motions = [trial(6.0, seed).axis('pitch') for seed in (1, 2)]
    motions[1] = replace(motions[1], angle=None)
    records = [SimpleNamespace(problem=SimpleNamespace(motions=[motion])) for motion in motions]
    best = {Condition('pitch', 1.0, angle): index for index, angle in enumerate((6.0, 3.0))}
    outcome = SimpleNamespace(quantity='draft_factor')
    drawn = decay_drawings(outcome, SimpleNamespace(axis='pitch', best=best, records=records))
    labels = {each.name: [axes.get_ylabel() for axes in each.figure.axes] for each in drawn}
    assert labels == {'decays_pitch_all_rate': ['pitch rate [deg/s]'], 'decays_pitch_all': ['pitch [deg]']}


@pytest.mark.long
@pytest.mark.parametrize(('hull', 'longer', 'groups'), [('swath-pitch', 1.0, [6]), ('swath-roll', 1.1, [5, 1])])
def test_repeats_of_a_strongly_damped_hull_do_not_contradict_each_other_and_another_draft_does(hull, longer, groups):
    model = hull_named(hull).model
    other = model.from_terms(
        model.equation, {n: v / longer**2 if n[0] in 'rs' else v for n, v in model.terms.items()}, axis=model.axis
    )
    for repeat in range(6):
        segments, turns = [], []
        for k, angle in enumerate((3, 5, 8, -5, 6, 5)):
            craft, noise = (other if k == 5 else model), SensorNoise(5e-4, 0.0)
            made = simulated_trial(craft, math.radians(angle), 15.0, 50.0, noise, 100 * repeat + k, 3.0)
            motion = replace(made.axis(model.axis), rate=None)
            problem = prepare([motion])
            segments.append(problem.segments[0])
            turns.append(turns_of(problem.motions[0], segments[-1]))
        assert [len(group) for group in of_like_periods(segments, turns)] == groups
