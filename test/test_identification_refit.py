"""Refits: releases that are one fit, which model is published, and the way back."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from imu_stream import EPOCH_NS, decay_stream

from swath_sysid.attitude.hull.coefficients import COEFFICIENT_NAMES, coefficients
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.identification.identify import IdentificationSettings, identify_problem
from swath_sysid.attitude.identification.live_decays import LiveDecay, newest
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.refit import RefitSettings, Refitter, refit
from swath_sysid.attitude.identification.replacement import misfit, reason_to_keep
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.window import COLUMNS, MotionWindow, NoticedDecay, WindowSettings
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml

QUICK = RefitSettings(
    axes=('pitch',), identification=IdentificationSettings('linear', search=SearchSettings(generations=2))
)


def table_of(seed=1, **motion):
    """A window of a craft released in pitch, in the minute of that number."""
    window = MotionWindow(WindowSettings(detect_decay=False))
    for one in decay_stream(20.0, 28.0, seed=seed, first_ns=EPOCH_NS + seed * 60 * 10**9, **motion):
        window.add(one)
    return window.table()


def after(*tables, settings=QUICK, **origin):
    """A refitter that has taken what was found on windows, one after the other, and the last outcome."""
    refitter = Refitter(settings)
    for table in tables:
        refitter.take(outcome := refit(refitter.request(table, **origin)))
    return refitter, outcome


@pytest.fixture(scope='module')
def table():
    return table_of()


@pytest.fixture(scope='module')
def first(table):
    """The outcome of the first refit."""
    return refit(Refitter(QUICK).request(table, source={'topic': 'here'}))


@pytest.fixture
def twice(taken_twice):
    """A refitter that has taken two releases, and the outcome of the second."""
    return copy.deepcopy(taken_twice)


@pytest.fixture(scope='module')
def taken_twice(table):
    return after(table, table_of(2))


def test_the_first_refit_is_believed(first):
    refitter = Refitter(QUICK)
    assert refitter.take(first) and set(refitter.models) == {'pitch'} and refitter.version == 1
    model = refitter.models['pitch'].model
    assert model.natural_period == pytest.approx(2.6, rel=0.01)
    assert model.damping_ratio == pytest.approx(0.08, rel=0.1)
    assert first.message.startswith('pitch: adequate: ') and '; 1 release (' in first.message
    assert '\n' not in first.message
    (source,) = refitter.models['pitch'].provenance['sources']
    assert source['topic'] == 'here' and len(source['sha256']) == 64
    assert model_from_yaml(model_to_yaml(first.models)) == first.models


def test_a_window_whose_rates_are_reversed_is_not_fitted(table):
    column = COLUMNS.index('pitch_rate')
    rows = table.rows.copy()
    rows[:, column] *= -1.0
    outcome = refit(Refitter(QUICK).request(replace(table, rows=rows)))
    assert not outcome.succeeded
    assert 'not fitted' in outcome.message and 'derivative of the pitch angle with the opposite sign' in outcome.message


def test_the_same_decay_in_another_window_counts_once(table, first):
    refitter = Refitter(QUICK)
    refitter.take(first)
    shifted = replace(table, rows=table.rows[40:])
    again = refit(refitter.request(shifted))
    assert not again.succeeded and not refitter.take(again) and refitter.version == 1
    assert 'the current model knows the next release as well' in again.message
    assert len(refitter.decays['pitch'].decays) == 1


def test_a_longer_view_takes_the_place_of_the_shorter_and_its_tail_is_no_release_of_its_own(table, first):
    since = table.rows[:, 0] - table.rows[0, 0]
    short, tail = (replace(table, rows=table.rows[chosen]) for chosen in (since < 14.0, since > 14.5))
    refitter, outcome = after(short, tail)
    assert refitter.version == 1 and 'as well' in outcome.message
    (held,) = refitter.decays['pitch'].decays
    assert held.end < tail.rows[0, 0]
    alone = Refitter(QUICK)
    alone.take(first)
    refitter.take(refit(refitter.request(table)))
    assert [each.end for each in refitter.decays['pitch'].decays] == [each.end for each in alone.decays['pitch'].decays]


def test_several_releases_are_one_fit_as_several_records_are(table, twice):
    refitter, outcome = twice
    assert outcome.succeeded and '; 2 releases, the next one known to ' in outcome.message
    assert '% before (linear, period 2.' in outcome.message
    problem = prepare([each.trial().axis('pitch') for each in (table, table_of(2))])
    ratios = identify_problem(problem, QUICK.identification).model.ratios
    np.testing.assert_allclose(refitter.models['pitch'].model.ratios, ratios, rtol=1e-6)


def test_five_decays_are_held_the_newest():
    segment = DecaySegment(1.0, 9.0, 2.0, 4.0, 0.1, 0.01, 0.0)
    motion = AxisMotion('roll', np.arange(0.0, 10.0, 0.1), np.zeros(100), None)
    decays = tuple(LiveDecay(motion, segment, 60.0 * minute, {}) for minute in (3, 0, 6, 1, 5, 2, 4))
    assert [each.origin for each in newest(decays)] == [120.0, 180.0, 240.0, 300.0, 360.0]


def test_releases_of_one_craft_do_not_contradict_each_other():
    refitter, outcome = after(table_of(1, amplitude=0.05), table_of(2, amplitude=0.12))
    assert len(refitter.decays['pitch'].decays) == 2 and refitter.version == 2, outcome.message


@pytest.mark.parametrize('change', [{'period': 2.65}, {'damping': 0.1}])
def test_a_changed_craft_starts_anew_and_rollback_leads_back(twice, change):
    refitter, _ = twice
    before, decays = refitter.models['pitch'], refitter.decays
    outcome = refit(refitter.request(table_of(3, **change)))
    assert 'the decays before contradict this one and are forgotten; adequate' in outcome.message
    assert refitter.take(outcome) and len(refitter.decays['pitch'].decays) == 1
    assert refitter.models['pitch'].model.natural_period == pytest.approx(change.get('period', 2.6), rel=0.01)
    assert refitter.steps_back == 3
    after_change = refitter.models['pitch']
    assert refitter.rollback() and refitter.models['pitch'] is before and refitter.decays is decays
    assert refitter.undo_rollback() and refitter.models['pitch'] is after_change and not refitter.undo_rollback()
    assert refitter.rollback() and refitter.models['pitch'] is before
    assert refitter.rollback() and refitter.rollback() and refitter.models == refitter.decays == {}
    assert not refitter.rollback() and refitter.version == 8


def test_decays_that_were_forgotten_stay_so_when_a_refit_ends_afterwards(table, first):
    refitter = Refitter(QUICK)
    refitter.request(table)
    refitter.forget_decays()
    assert refitter.take(first) and refitter.models and not refitter.decays


def test_by_itself_only_the_axis_whose_decay_was_noticed_is_fitted(table):
    """The same rows in both axes."""
    rows = table.rows.copy()
    rows[:, [1, 3]] = rows[:, [2, 4]]
    both = replace(table, rows=rows)
    noticed = replace(both, noticed=NoticedDecay('roll', rows[0, 0], rows[-1, 0]))
    settings = replace(QUICK, axes=('roll', 'pitch'))
    assert set(refit(Refitter(settings).request(noticed, is_asked=False)).models) == {'roll'}
    assert set(refit(Refitter(settings).request(both)).models) == {'roll', 'pitch'}
    assert not refit(Refitter(settings).request(both, is_asked=False)).models
    outcome = refit(Refitter(QUICK).request(noticed, is_asked=False))
    assert not outcome.verdicts and 'see the parameter axes' in outcome.message


def test_the_verdict_decides_what_replaces_what(first):
    (found,) = first.models.values()

    def kept(held, new, error=0.05, contradicts=False):
        held, new = (
            replace(found, metrics={**found.metrics, 'verdict': level, 'motion_error': each}) if level else None
            for level, each in ((held, error and 0.05), (new, error))
        )
        return reason_to_keep(held, new, contradicts)

    replaces = [
        (held, new)
        for held in ('doubtful', 'adequate')
        for new in ('rejected', 'doubtful', 'adequate')
        if not kept(held, new, contradicts=True)
    ]
    assert replaces == [('doubtful', 'doubtful'), ('doubtful', 'adequate'), ('adequate', 'adequate')]
    assert kept(None, 'rejected').startswith('rejected: ')
    assert kept(None, 'doubtful') == kept('doubtful', 'adequate', 0.06) == kept('adequate', 'adequate', 0.04) == ''
    assert 'as well' in kept('adequate', 'adequate', 0.06) and 'as well' in kept('adequate', 'adequate', None)
    endless = replace(found, model=DecayModel(found.model.equation, 0.0 * found.model.ratios))
    assert reason_to_keep(None, endless, False)


def test_the_misfit_is_that_of_the_best_initial_state(table, first):
    """The fitted model's is hardly above the least of its equation; a worse one's larger, a wild one's huge."""
    (found,) = first.models.values()
    problem = prepare([table.trial().axis('pitch')])
    model, least = found.model, found.metrics['objective_value']
    assert least * (1.0 - 1e-9) <= misfit(problem, model) < 1.003 * least
    slower = DecayModel(model.equation, model.ratios * np.where(model.ratios == model.ratios.max(), 0.9, 1.0))
    assert misfit(problem, slower) > 1.5 * least
    wild = DecayModel(model.equation, -100.0 * model.ratios)
    assert misfit(problem, wild) > 100.0


def test_an_axis_without_a_decay_is_told_and_the_other_is_fitted(table):
    told = []
    outcome = refit(Refitter(replace(QUICK, axes=('roll', 'pitch'))).request(table), progress=told.append)
    assert set(outcome.models) == {'pitch'}
    assert outcome.message.startswith('pitch: adequate') and outcome.message.endswith('; roll: no free decay')
    assert told == sorted(told) and told[0] >= 0.0 and told[-1] == 1.0


def test_coefficients_are_rows_of_values_and_deviations(first):
    other = IdentifiedModel.exactly(first.models['pitch'].model.with_trim(0.02))
    found = replace(first.models['pitch'], metrics={'verdict': 'doubtful'})
    rows, values = coefficients({'pitch': found, 'roll': other})
    assert rows == ('roll', 'roll_std', 'pitch', 'pitch_std') and values.shape == (4, len(COEFFICIENT_NAMES))
    roll, roll_std, pitch, pitch_std = (dict(zip(COEFFICIENT_NAMES, row, strict=True)) for row in values)
    assert roll['offset'] == 0.02 and roll['verdict'] == -1.0 and pitch['verdict'] == 1.0
    assert (pitch['smallest_amplitude'], pitch['largest_amplitude']) == found.amplitude_range
    assert math.isnan(roll_std['offset']) and not any(v for k, v in roll_std.items() if k != 'offset')
    np.testing.assert_array_equal(values[2, : len(TERM_NAMES)], found.model.ratios)
    for number, name in enumerate(found.model.equation.terms):
        assert pitch_std[name] == np.sqrt(found.covariance[number, number]) > 0.0
    for name in set(TERM_NAMES) - set(found.model.equation.terms):
        assert pitch[name] == pitch_std[name] == 0.0
    adequate = coefficients({'pitch': replace(found, metrics={'verdict': 'adequate'})})[1]
    assert adequate[0, COEFFICIENT_NAMES.index('verdict')] == 2.0
    assert coefficients({})[1].shape == (0, len(COEFFICIENT_NAMES))
