"""The decay model: its terms, its Jacobian, the catalogue and the published form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import (
    EQUATIONS,
    PUBLISHED_EQUATIONS,
    PUBLISHED_HULLS,
    equation_named,
    hull_named,
)
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.published_form import (
    PublishedForm,
    from_published,
    to_published,
)
from swath_sysid.attitude.hull.terms import TERM_NAMES, restoring_energy, term_moments
from swath_sysid.common.errors import InputError

PUBLISHED_TERMS = {
    'swath-pitch-1': 'b1 b2 b3 r1 r2 r3',
    'swath-pitch-2': 'b1 b2 r1 r2 r3',
    'swath-pitch-3': 'b1 r1 r2 r3',
    'swath-pitch-4': 'b1 b2 b3 r1 r2',
    'swath-pitch-5': 'b1 b2 r1 r2',
    'swath-pitch-6': 'b1 r1 r2',
    'swath-pitch-7': 'b1 b2 b3 r1',
    'swath-pitch-8': 'b1 b2 r1',
    'swath-pitch-9': 'b1 r1',
    'swath-roll-1': 'b1 b2 b3 r1 r2 r3',
    'swath-roll-2': 'b1 b2 b3 r1',
    'swath-roll-3': 'b1 b2 b3 s1 s2',
    'hydrofoil-pitch-1': 'b1 b2 b3 r1 r2 r3',
    'hydrofoil-pitch-2': 'b1 b2 b3 s1',
    'hydrofoil-pitch-3': 'b1 b2 b3 r1 r3',
    'swath-usv-pitch-1': 'b1 b2 b3 r1 r2 r3',
    'swath-usv-pitch-2': 'b1 b2 b3 r1',
    'swath-usv-pitch-3': 'b1 b2 b3 s1 s2',
}

ALL_TERMS = Equation('all', TERM_NAMES)
ratio_lists = st.lists(st.floats(-5, 5), min_size=9, max_size=9)
angles, rates = st.floats(-1.2, 1.2), st.floats(-3, 3)


def written_out(b0, b1, b2, b3, r1, r2, r3, s1, s2, x, w, width):
    """The model as DESIGN writes it, term by term."""
    damping = b0 * np.tanh(w / width) + b1 * w + b2 * abs(w) * w + b3 * w**3
    return -damping - (r1 * x + r2 * x**2 + r3 * x**3 + s1 * np.sin(x) + s2 * np.sin(x) ** 2)


def test_catalogue_holds_the_published_equations():
    assert {name: ' '.join(e.terms) for name, e in PUBLISHED_EQUATIONS.items()} == PUBLISHED_TERMS
    assert EQUATIONS['odd-cubic'].terms == ('b1', 'b2', 'r1', 'r3')


@given(ratio_lists, angles, rates)
def test_acceleration_is_the_sum_of_the_terms(ratios, angle, rate):
    model = DecayModel(ALL_TERMS, ratios, trim=0.1, friction_rate=0.05)
    expected = written_out(*ratios, angle - 0.1, rate, 0.05)
    assert model.acceleration(angle, rate) == pytest.approx(expected, abs=1e-9)
    moments = term_moments(np.array([angle - 0.1]), np.array([rate]), 0.05)
    assert -(model.ratios @ moments)[0] == pytest.approx(expected, abs=1e-9)


@given(ratio_lists, angles, rates)
@settings(max_examples=200)
def test_jacobian_against_finite_differences(ratios, angle, rate):
    model = DecayModel(ALL_TERMS, ratios, trim=-0.05, friction_rate=0.3)
    if abs(rate) < 1e-3:
        rate = 1e-3
    h = 1e-6
    by_angle = (model.acceleration(angle + h, rate) - model.acceleration(angle - h, rate)) / (2 * h)
    by_rate = (model.acceleration(angle, rate + h) - model.acceleration(angle, rate - h)) / (2 * h)
    assert model.jacobian(angle, rate) == pytest.approx((by_angle, by_rate), abs=2e-5)


@given(ratio_lists, st.floats(-1, 1))
def test_restoring_energy_is_the_integral_of_the_moment(ratios, x):
    model = DecayModel(ALL_TERMS, [0, 0, 0, 0, *ratios[4:]])
    h = 1e-5
    slope = (restoring_energy(x + h, model.ratios) - restoring_energy(x - h, model.ratios)) / (2 * h)
    assert slope == pytest.approx(-model.acceleration(x, 0.0), abs=1e-6)


@pytest.mark.parametrize('name', [n for n, hull in PUBLISHED_HULLS.items() if hull.form])
def test_published_form_round_trip(name):
    hull = PUBLISHED_HULLS[name]
    again = to_published(hull.model, hull.form.inertia)
    assert vars(again) == pytest.approx(vars(hull.form))
    assert from_published(hull.model.equation, again, hull.axis).ratios == pytest.approx(hull.model.ratios)


def test_composition_by_name():
    assert equation_named('linear,quadratic|linear,cubic').terms == EQUATIONS['odd-cubic'].terms
    assert equation_named('b1|s1').terms == ('b1', 's1')
    assert equation_named('swath-pitch-2+friction').terms == ('b0', 'b1', 'b2', 'r1', 'r2', 'r3')
    assert EQUATIONS['swath-pitch-1'].contains(EQUATIONS['swath-pitch-9'])
    assert not EQUATIONS['swath-pitch-6'].contains(EQUATIONS['odd-cubic'])


@pytest.mark.parametrize(
    ('build', 'words'),
    [
        (lambda: equation_named('swath-pitch-10'), "no equation 'swath-pitch-10'"),
        (lambda: equation_named('b1|r9'), "unknown term 'r9'"),
        (lambda: Equation('x', ('b1',)), 'one restoring'),
        (lambda: hull_named('titanic'), "no hull 'titanic'"),
        (lambda: DecayModel(EQUATIONS['linear'], np.ones(9)), "no term 'b0'"),
        (lambda: DecayModel(EQUATIONS['linear'], np.full(9, np.nan)), 'finite'),
        (lambda: DecayModel(EQUATIONS['linear'], np.zeros(9), friction_rate=0.0), 'friction_rate'),
        (lambda: DecayModel.from_terms(EQUATIONS['linear'], {'q1': 1.0}), "no ratio 'q1'"),
        (lambda: PublishedForm(inertia=0.0), 'greater than zero'),
        (lambda: to_published(DecayModel(ALL_TERMS, np.ones(9)), 1.0), 'mixes polynomial and sine'),
        (lambda: to_published(PUBLISHED_HULLS['swath-roll'].model, -1.0), 'greater than zero'),
    ],
)
def test_bad_choices_are_named(build, words):
    with pytest.raises(InputError, match=words):
        build()
