"""Refits: which model is believed, and the way back."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from imu_stream import decay_stream

from swath_sysid.attitude.hull.coefficients import COEFFICIENT_NAMES, coefficients
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.identification.identify import IdentificationSettings
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.refit import (
    RefitSettings,
    Refitter,
    misfit,
    refit,
    window_provenance,
)
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.window import COLUMNS, MotionTable, MotionWindow, WindowSettings
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml

QUICK = RefitSettings(
    axes=('pitch',), identification=IdentificationSettings(search=SearchSettings(generations=15, population=40))
)


def table_of(seed=1, **motion):
    """A window of a craft released in pitch."""
    window = MotionWindow(WindowSettings(detect_decay=False))
    for one in decay_stream(50.0, 40.0, seed=seed, **motion):
        window.add(one)
    return window.table()


@pytest.fixture(scope='module')
def table():
    return table_of()


@pytest.fixture(scope='module')
def first(table):
    """The outcome of the first refit."""
    return refit(Refitter(QUICK).request(table, {'source': 'here'}))


def test_the_first_refit_is_believed(first):
    refitter = Refitter(QUICK)
    assert refitter.take(first) and set(refitter.models) == {'pitch'} and refitter.version == 1
    model = refitter.models['pitch'].model
    assert model.natural_period == pytest.approx(2.6, rel=0.01)
    assert model.damping_ratio == pytest.approx(0.08, rel=0.1)
    assert 'b1|r1' in first.message and '\n' not in first.message
    assert refitter.models['pitch'].provenance['source'] == 'here'


def test_a_window_whose_rates_are_reversed_is_not_fitted(table):
    column = COLUMNS.index('pitch_rate')
    rows = table.rows.copy()
    rows[:, column] *= -1.0
    outcome = refit(Refitter(QUICK).request(replace(table, rows=rows)))
    assert not outcome.succeeded
    assert 'not fitted' in outcome.message and 'derivative of the pitch angle with the opposite sign' in outcome.message


def test_the_same_window_again_changes_nothing(table, first):
    refitter = Refitter(QUICK)
    refitter.take(first)
    again = refit(refitter.request(table))
    assert not again.succeeded and not refitter.take(again) and refitter.version == 1
    assert 'current model explains the window as well' in again.message


def test_another_window_of_the_same_craft_is_no_reason_to_change(first):
    """Four ratios fit the noise of any window a little better than those from another: chance is not believed."""
    refitter = Refitter(QUICK)
    refitter.take(first)
    kept = [not refit(refitter.request(table_of(seed))).succeeded for seed in (2, 3, 4)]
    assert sum(kept) >= 2


def test_a_changed_craft_is_followed_and_rollback_leads_back(first):
    refitter = Refitter(QUICK)
    refitter.take(first)
    before = refitter.models['pitch']
    outcome = refit(refitter.request(table_of(period=3.1)))
    (verdict,) = outcome.verdicts
    assert verdict.misfit < 0.5 * verdict.current_misfit
    assert refitter.take(outcome)
    assert refitter.models['pitch'].model.natural_period == pytest.approx(3.1, rel=0.01)
    assert refitter.steps_back == 2
    assert refitter.rollback() and refitter.models['pitch'] is before
    assert refitter.rollback() and refitter.models == {}
    assert not refitter.rollback() and refitter.version == 4


def test_the_misfit_is_that_of_the_best_initial_state(table, first):
    """The fitted model's is hardly above the least of its equation; a worse one's larger, a wild one's huge."""
    (verdict,) = first.verdicts
    problem = prepare([table.trial().axis('pitch')])
    model = verdict.model.model
    least = verdict.model.metrics['objective_value']
    assert misfit(problem, model) == pytest.approx(verdict.misfit, rel=1e-9)
    assert least * (1.0 - 1e-9) <= verdict.misfit < 1.003 * least
    slower = DecayModel(model.equation, model.ratios * np.where(model.ratios == model.ratios.max(), 0.9, 1.0))
    assert misfit(problem, slower) > 1.5 * verdict.misfit
    wild = DecayModel(model.equation, -100.0 * model.ratios)
    assert misfit(problem, wild) > 100.0


def test_an_axis_without_a_decay_is_told_and_the_other_is_fitted(table):
    outcome = refit(Refitter(replace(QUICK, axes=('roll', 'pitch'))).request(table))
    assert set(outcome.models) == {'pitch'}
    assert outcome.message.startswith('pitch: b1|r1') and '; roll: not fitted, ' in outcome.message


def test_progress_goes_from_nothing_to_all(table):
    told = []
    refit(Refitter(replace(QUICK, axes=('roll', 'pitch'))).request(table), progress=told.append)
    assert told == sorted(told) and told[-1] == 1.0 and all(0.0 <= share <= 1.0 for share in told)


def test_an_empty_window_is_refused():
    with pytest.raises(InputError, match='window is empty'):
        refit(Refitter(QUICK).request(MotionTable(np.empty((0, 8)), 0)))


def test_request_and_outcome_go_to_another_process(table, first):
    request = pickle.loads(pickle.dumps(Refitter(QUICK).request(table)))
    np.testing.assert_array_equal(request.table.rows, table.rows)
    assert pickle.loads(pickle.dumps(first)).models == first.models


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


def test_the_provenance_of_a_window_survives_the_model_file(table):
    provenance = window_provenance(table, {'topic': 'motion/window'}, 'swath_sysid 0')
    held = refit(Refitter(QUICK).request(table, provenance)).models
    assert model_from_yaml(model_to_yaml(held)) == held
    assert len(held['pitch'].provenance['sources'][0]['sha256']) == 64


@pytest.mark.parametrize(
    'fields',
    [
        {'axes': ()},
        {'axes': ('yaw',)},
        {'axes': ('roll', 'roll')},
        {'least_improvement': 1.0},
        {'least_improvement': -0.1},
    ],
)
def test_settings_that_make_no_sense_are_refused(fields):
    with pytest.raises(InputError, match=next(iter(fields))):
        RefitSettings(**fields)
