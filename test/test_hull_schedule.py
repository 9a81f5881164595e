"""Schedules over loadings, and the ranges of what any craft has."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import RATIO_RANGES, DecayModel, check_physical
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, ScheduledModel, models_at
from swath_sysid.attitude.hull.terms import TERM_NAMES, Scales
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats import model_file

LOADINGS = (0.9, 1.0, 1.15)


def truth(loading):
    """Ratios that bend with the loading: a parabola, a line, a constant."""
    return {'b1': 1.0 + 4.0 * (loading - 1.0) ** 2, 'r1': 10.0 - 3.0 * loading, 'r3': 5.0}


def of_loading(loading, std=0.01, axis='pitch'):
    model = DecayModel.of(trim=0.01 * loading, axis=axis, **truth(loading))
    return IdentifiedModel(model, np.eye(3) * std**2, 0.001, (0.01, 0.1 * loading), {'r2': 0.99}, {'software': 'test'})


@pytest.fixture
def schedule():
    return ScheduledModel('draft_factor', LOADINGS, tuple(of_loading(v) for v in LOADINGS))


@given(st.floats(0.9, 1.15))
def test_the_truth_between_lies_within_what_is_said(loading):
    schedule = ScheduledModel('draft_factor', LOADINGS, tuple(of_loading(v, std=0.0) for v in LOADINGS))
    found, advice = schedule.at(loading)
    assert advice == ()
    for name, value in truth(loading).items():
        assert abs(found.model.terms[name] - value) <= found.std[name] + 1e-9
    assert found.model.terms['r1'] == pytest.approx(truth(loading)['r1'])
    assert found.model.trim == pytest.approx(0.01 * loading)
    assert found.amplitude_range[1] == pytest.approx(0.1 * loading)


def test_halfway_two_independent_models_are_averaged():
    schedule = ScheduledModel('draft_m', (0.1, 0.2), (of_loading(1.0, 0.02), of_loading(1.1, 0.04)))
    found, advice = schedule.at(0.15)
    assert found.std['r1'] == pytest.approx(np.hypot(0.01, 0.02))
    assert found.model.terms['r1'] == pytest.approx(0.5 * (truth(1.0)['r1'] + truth(1.1)['r1']))
    assert [a.code for a in advice] == ['loading-curvature-unknown']


def test_exact_where_it_was_identified_and_nothing_is_extrapolated_in_silence(schedule):
    for loading in LOADINGS:
        assert schedule.at(loading) == (of_loading(loading), ())
    for loading, nearest in ((0.5, 0.9), (2.0, 1.15)):
        found, advice = schedule.at(loading)
        assert found == of_loading(nearest) and [a.code for a in advice] == ['loading-outside']
        assert f'{loading:g}' in advice[0].message and f'{nearest:g}' in advice[0].message
    ratios, stds = schedule.curve([0.5, 1.0, 1.08])
    for ratio, std, loading in zip(ratios, stds, (0.9, 1.0, 1.08), strict=True):
        found, _ = schedule.at(loading)
        assert ratio.tolist() == [*found.model.terms.values()] and std.tolist() == [*found.std.values()]
    for loading in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InputError, match='draft_factor must be a number'):
            schedule.at(loading)
        with pytest.raises(InputError, match='greater than zero'):
            models_at({'pitch': schedule.reference}, {}, loading)


@pytest.mark.parametrize(
    'quantity, loadings, models, words',
    [
        ('speed', (1.0,), 1, 'scheduled on'),
        ('draft_m', (1.0, 1.0), 2, 'must increase'),
        ('draft_m', (0.9, 1.0), 1, 'one model for each'),
        ('draft_m', (), 0, 'at least one'),
        ('draft_m', (-1.0, 1.0), 2, 'greater than zero'),
    ],
)
def test_what_is_no_schedule(quantity, loadings, models, words):
    with pytest.raises(InputError, match=words):
        ScheduledModel(quantity, loadings, (of_loading(1.0),) * models)
    with pytest.raises(InputError, match='one axis'):
        ScheduledModel('draft_m', (0.9, 1.0), (of_loading(0.9), of_loading(1.0, axis='roll')))


def test_a_file_holds_it_and_serves_readers_that_know_no_schedule(schedule, tmp_path):
    path = tmp_path / 'model.yaml'
    model_file.write_scheduled(path, {'pitch': schedule})
    assert model_file.read_description(path)[1] == {'pitch': schedule}
    assert model_file.read_model(path) == {'pitch': schedule.reference}
    assert model_file.description_from_yaml(model_file.model_to_yaml({'pitch': schedule.reference}))[1] == {}


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
    text = model_file.scheduled_to_yaml({'pitch': schedule})
    assert old in text
    with pytest.raises(InputError, match=words):
        model_file.description_from_yaml(text.replace(old, new))[1]


def test_models_at_a_loading_are_scheduled_where_there_is_a_schedule(schedule):
    other = of_loading(1.0, axis='roll')
    models = {'pitch': schedule.reference, 'roll': other}
    assert models_at(models, {'pitch': schedule}, None) == (models, ())
    found = models_at(models, {'pitch': schedule}, schedule.loadings[0])
    assert found == ({'pitch': schedule.models[0], 'roll': other}, ())


def linear(period, damping_ratio=0.1, **fields):
    """A linear hull of a natural period, s."""
    frequency = 2.0 * math.pi / period
    return DecayModel.of(b1=2.0 * damping_ratio * frequency, r1=frequency**2, **fields)


@pytest.mark.parametrize(
    'model, words',
    [
        (linear(0.0499), 'natural period in s is 0.0499'),
        (linear(1001.0), 'natural period in s is 1001'),
        (linear(3.0, trim=3.2), 'trim'),
        (linear(3.0, trim=math.nan), 'trim'),
        (linear(3.0, friction_rate=1e-9), 'friction_rate'),
        (linear(3.0, friction_rate=1e9), 'friction_rate'),
        (DecayModel.of(b0=99.0, r1=9.0, friction_rate=1e-6), 'damping at rest'),
    ],
)
def test_what_no_craft_has_is_named(model, words):
    with pytest.raises(InputError, match=words):
        check_physical(model)


@pytest.mark.parametrize('name', TERM_NAMES)
def test_every_ratio_has_both_ends(name):
    for ratio in (math.nextafter(end, side * math.inf) for end, side in zip(RATIO_RANGES[name], (-1, 1), strict=True)):
        with pytest.raises(InputError, match=f'the ratio {name} is'):
            check_physical(DecayModel.of(**{'b1': 0.1, 'r1': 9.0, name: ratio}))


def test_the_ranges_are_those_of_the_quickest_craft_at_the_smallest_amplitude_and_every_craft_passes():
    quickest, smallest = 2.0 * math.pi / 0.05, math.radians(0.05)
    assert RATIO_RANGES['b3'][1] == pytest.approx(12.0 / (2.0 * math.pi / 1000.0) / smallest**2)
    assert RATIO_RANGES['r3'] == pytest.approx((-6.0 * (quickest / smallest) ** 2, 6.0 * (quickest / smallest) ** 2))
    assert RATIO_RANGES['b0'][1] == pytest.approx(0.5 * math.pi * quickest**2)
    for hull in PUBLISHED_HULLS.values():
        check_physical(hull.model)
    for period, damping_ratio in itertools.product((0.0501, 3.0, 999.0), (0.0, 1.9)):
        check_physical(linear(period, damping_ratio))
        scales = Scales(math.radians(5.0), 2.0 * math.pi / period)
        most = 0.5 * scales.amplitude * scales.frequency**2
        check_physical(linear(period, damping_ratio, b0=most, friction_rate=scales.friction_rate))
    # a hull that capsizes is a hull
    check_physical(DecayModel.of(b1=0.3, b2=0.1, r1=-2.0, r3=80.0))


def test_the_command_line_refuses_ratios_of_no_craft(tmp_path, capsys):
    output = tmp_path / 'trial.csv'
    words = ['simulate', '--equation', 'linear', '--ratio', 'b1=1', '--ratio', 'r1=1e300', '--initial-angle-deg', '5']
    assert main([*words, '--output', str(output)]) == 2
    assert 'the ratio r1 is 1e+300' in capsys.readouterr().err and not output.exists()
