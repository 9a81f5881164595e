"""Froude scaling of hulls and of their schedules."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import DecayModel, check_physical
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel, ScheduledModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.common.errors import InputError
from swath_sysid.formats import model_file
from swath_sysid.tank.froude import length_ratio, scaled, scaled_model, scaled_schedule, scaling_advice

RATIOS = {'b0': 0.01, 'b1': 0.3, 'b2': 0.2, 'b3': 0.1, 'r1': 8.0, 'r2': 1.5, 'r3': 3.0, 's1': 0.5, 's2': 0.2}
FULL = DecayModel.of(trim=0.01, friction_rate=0.02, axis='roll', **RATIOS)


def identified(model):
    """A model with a full covariance."""
    n = len(model.equation.terms)
    root = np.random.default_rng(1).normal(size=(n, n)) * 0.01
    metrics = {'r2': 0.999, 'rate_rmse_rad_s': 0.013}
    every = HullPosterior(model.equation, model.ratios[model.equation.indices], 2.0 * root @ root.T)
    return IdentifiedModel(model, root @ root.T, 0.002, (0.01, 0.15), metrics, {'software': 'test'}, every)


@pytest.mark.parametrize('ratio', [25.0, 0.3])
def test_the_scaled_hull_moves_the_same_in_scaled_time(ratio):
    time = np.linspace(0.0, 12.0, 400)
    angle, rate = simulate(FULL, 0.15, 0.05, time)
    root = math.sqrt(ratio)
    scaled_angle, scaled_rate = simulate(scaled_model(FULL, ratio), 0.15, 0.05 / root, time * root)
    np.testing.assert_allclose(scaled_angle, angle, atol=1e-9)
    np.testing.assert_allclose(scaled_rate * root, rate, atol=1e-9)


@pytest.mark.long
@given(st.fractions(Fraction(1, 500), 500).filter(lambda f: f > 0))
def test_the_way_back_gives_the_very_numbers(ratio):
    start = identified(FULL)
    through_a_file = model_file.model_from_yaml(model_file.model_to_yaml({'roll': scaled(start, ratio)}))['roll']
    assert scaled(through_a_file, 1 / ratio) == start


def test_uncertainty_and_metrics_follow():
    start = identified(FULL)
    there = scaled(start, length_ratio('16'))
    assert scaled(scaled(start, length_ratio('2')), length_ratio('8')) == there
    for name, std in start.std.items():
        assert there.std[name] / there.model.terms[name] == pytest.approx(std / start.model.terms[name])
    assert there.metrics['rate_rmse_rad_s'] == pytest.approx(start.metrics['rate_rmse_rad_s'] / 4.0)
    assert there.model.natural_period == pytest.approx(4.0 * start.model.natural_period)
    assert there.model.damping_ratio == pytest.approx(start.model.damping_ratio)
    assert there.amplitude_range == start.amplitude_range
    assert there.posterior.ratios == pytest.approx(there.model.ratios[there.model.equation.indices])
    assert there.posterior.covariance == pytest.approx(2.0 * there.covariance)


@pytest.mark.parametrize('quantity, factor', [('draft_factor', 1), ('draft_m', 25), ('displacement_kg', 25**3)])
def test_a_schedule_keeps_its_loadings_in_proportion(quantity, factor):
    models = [identified(scaled_model(FULL, f)) for f in (0.9, 1.0, 1.1)]
    schedule = ScheduledModel(quantity, (0.1386, 0.154, 0.1694), models)
    there = scaled_schedule(schedule, length_ratio('25'))
    np.testing.assert_allclose(there.loadings, np.array(schedule.loadings) * factor)
    assert scaled_schedule(there, length_ratio('1/25')) == schedule


def test_the_viscous_scale_effect_is_told():
    codes = [a.code for a in scaling_advice(FULL, Fraction(25))]
    assert codes == ['viscous-scale-effect', 'dry-friction-scaled']
    (up,) = scaling_advice(PUBLISHED_HULLS['swath-pitch'].model, Fraction(25))
    assert 'b1, b2' in up.message and 'smaller' in up.message and '125' in up.message
    (down,) = scaling_advice(PUBLISHED_HULLS['swath-pitch'].model, Fraction(1, 25))
    assert 'larger' in down.message


def test_published_hulls_are_craft_at_every_scale():
    for hull in PUBLISHED_HULLS.values():
        for ratio in (1 / 25, 25.0, 500.0):
            check_physical(scaled_model(hull.model, ratio))


@pytest.mark.parametrize('ratio, times', [('1000', 2), ('1.1234567891234567', 12)])
def test_a_ratio_that_could_not_be_read_back_is_refused(ratio, times):
    there = identified(FULL)
    with pytest.raises(InputError, match='was scaled by .* before.* in 200 characters'):
        for _ in range(times):
            there = scaled(there, length_ratio(ratio))
    assert length_ratio(there.provenance['froude_scaling']['length_ratio'])
    there.provenance['froude_scaling'] = {'length_ratio': 'x'}
    with pytest.raises(InputError, match='froude_scaling'):
        scaled(there, length_ratio('2'))


def test_what_is_no_length_ratio():
    texts = '1e300 1e-300 1e300000000 1e-300000000 10001 1/10001 0 -3 1/0 nan inf 1e400/1e400 long 1/2/3'.split()
    for text in (*texts, '', '9' * 300):
        with pytest.raises(InputError, match='length ratio') as caught:
            length_ratio(text)
        assert len(str(caught.value)) < 160
