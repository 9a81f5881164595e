"""The model scheduled on draft: exact where identified, honest between, silent nowhere beyond."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.scheduled_model import ScheduledModel, models_at
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import (
    description_from_yaml,
    model_to_yaml,
    read_description,
    read_model,
    scheduled_to_yaml,
    write_scheduled,
)

EQUATION = Equation('test', ('b1', 'r1', 'r3'))
LOADINGS = (0.9, 1.0, 1.15)


def truth(loading):
    """Ratios that bend with the loading: a parabola, a line, a constant."""
    return {'b1': 1.0 + 4.0 * (loading - 1.0) ** 2, 'r1': 10.0 - 3.0 * loading, 'r3': 5.0}


def identified(loading, std=0.01, axis='pitch'):
    model = DecayModel.from_terms(EQUATION, truth(loading), trim=0.01 * loading, friction_rate=0.01, axis=axis)
    return IdentifiedModel(model, np.eye(3) * std**2, 0.001, (0.01, 0.1 * loading), {'r2': 0.99}, {'software': 'test'})


@pytest.fixture
def schedule():
    return ScheduledModel('draft_factor', LOADINGS, tuple(identified(v) for v in LOADINGS))


@pytest.mark.parametrize('loading', LOADINGS)
def test_exact_where_it_was_identified(schedule, loading):
    found, advice = schedule.at(loading)
    assert found == identified(loading) and advice == ()


@given(st.floats(0.9, 1.15))
def test_the_truth_between_lies_within_what_is_said(loading):
    schedule = ScheduledModel('draft_factor', LOADINGS, tuple(identified(v, std=0.0) for v in LOADINGS))
    found, advice = schedule.at(loading)
    assert advice == ()
    for name, value in truth(loading).items():
        assert abs(found.model.terms[name] - value) <= found.std[name] + 1e-9
    assert found.model.terms['r1'] == pytest.approx(truth(loading)['r1'])
    assert found.model.trim == pytest.approx(0.01 * loading)
    assert found.amplitude_range[1] == pytest.approx(0.1 * loading)


def test_halfway_two_independent_models_are_averaged():
    schedule = ScheduledModel('draft_m', (0.1, 0.2), (identified(1.0, 0.02), identified(1.1, 0.04)))
    found, advice = schedule.at(0.15)
    assert found.std['r1'] == pytest.approx(np.hypot(0.01, 0.02))
    assert found.model.terms['r1'] == pytest.approx(0.5 * (truth(1.0)['r1'] + truth(1.1)['r1']))
    assert [a.code for a in advice] == ['loading-curvature-unknown']


@pytest.mark.parametrize('loading, nearest', [(0.5, 0.9), (2.0, 1.15)])
def test_beyond_nothing_is_extrapolated_in_silence(schedule, loading, nearest):
    found, advice = schedule.at(loading)
    assert found == identified(nearest)
    assert [a.code for a in advice] == ['loading-outside']
    assert f'{loading:g}' in advice[0].message and f'{nearest:g}' in advice[0].message


@pytest.mark.parametrize('loading', [0.0, -1.0, float('nan'), float('inf')])
def test_a_loading_that_is_none(schedule, loading):
    with pytest.raises(InputError, match='draft_factor must be a number'):
        schedule.at(loading)
    with pytest.raises(InputError, match='greater than zero'):
        models_at({'pitch': schedule.reference}, {}, loading)


@pytest.mark.parametrize(
    'arguments, words',
    [
        (('speed', (1.0,), (identified(1.0),)), 'scheduled on'),
        (('draft_m', (1.0, 1.0), (identified(1.0), identified(1.0))), 'must increase'),
        (('draft_m', (0.9, 1.0), (identified(0.9),)), 'one model for each'),
        (('draft_m', (), ()), 'at least one'),
        (('draft_m', (-1.0, 1.0), (identified(0.9), identified(1.0))), 'greater than zero'),
        (('draft_m', (0.9, 1.0), (identified(0.9), identified(1.0, axis='roll'))), 'one axis'),
    ],
)
def test_what_is_no_schedule(arguments, words):
    with pytest.raises(InputError, match=words):
        ScheduledModel(*arguments)


def test_a_file_holds_it_and_serves_readers_that_know_no_schedule(schedule, tmp_path):
    path = tmp_path / 'model.yaml'
    write_scheduled(path, {'pitch': schedule})
    assert read_description(path)[1] == {'pitch': schedule}
    assert read_model(path) == {'pitch': schedule.reference}
    assert description_from_yaml(model_to_yaml({'pitch': schedule.reference}))[1] == {}


@pytest.mark.parametrize(
    'old, new, words',
    [
        ('quantity: draft_factor', 'quantity: speed', "quantity: 'speed' must be"),
        ('loading: 1.15', 'loading: 0.95', 'must increase'),
        ('loading: 1.15', 'loading: high', "'high' is not a number"),
        ('schedule:', 'plan:', "unknown field 'plan'"),
        ('pitch:', 'yaw:', 'axes'),
    ],
)
def test_a_damaged_schedule_is_named(schedule, old, new, words):
    text = scheduled_to_yaml({'pitch': schedule})
    assert old in text
    with pytest.raises(InputError, match=words):
        description_from_yaml(text.replace(old, new))[1]


def test_models_at_a_loading_are_scheduled_where_there_is_a_schedule(schedule):
    other = identified(1.0, axis='roll')
    models = {'pitch': schedule.reference, 'roll': other}
    assert models_at(models, {'pitch': schedule}, None) == (models, ())
    found, advice = models_at(models, {'pitch': schedule}, schedule.loadings[0])
    assert found == {'pitch': schedule.models[0], 'roll': other}
    assert advice == ()
    _, (advice,) = models_at(models, {'pitch': schedule}, 10.0 * schedule.loadings[-1])
    assert advice.code == 'loading-outside'
