"""Staleness: what the watch says of innovations whose law is known."""
import math

import numpy as np
import pytest

from swath_sysid.hull.catalogue import EQUATIONS
from swath_sysid.hull.decay_model import DecayModel
from swath_sysid.prediction.predictor import ImuSample, Predictor
from swath_sysid.prediction.staleness import ModelWatch

STEP = 0.01


def watched(innovations, excursion=0.0, largest=math.inf):
    """A watch that has seen innovations of two degrees of freedom, shape (N, 2), of unit variance expected."""
    watch = ModelWatch()
    watch.restart(largest)
    for angle, rate in innovations.tolist():
        watch.take(STEP, angle * angle + rate * rate, 2, rate, excursion)
    return watch


@pytest.fixture
def white():
    return np.random.default_rng(1).normal(size=(20_000, 2))


def test_white_innovations_of_the_right_size_say_nothing(white):
    watch = watched(white)
    assert watch.outside == pytest.approx(0.05, abs=0.01)
    assert watch.alike == pytest.approx(0.5, abs=0.02)
    assert watch.advice('roll') == ()


def test_innovations_twice_as_large_are_told(white):
    watch = watched(2.0 * white)
    assert watch.outside == pytest.approx(math.exp(-5.991 / 2.0 / 4.0), abs=0.02)
    (advice,) = watch.advice('roll')
    assert advice.code == 'stale-model' and 'identify again' in advice.message and 'roll' in advice.message


def test_innovations_that_are_not_white_are_told(white):
    coloured = np.zeros_like(white)
    for k in range(1, len(white)):
        coloured[k] = 0.95 * coloured[k - 1] + math.sqrt(1.0 - 0.95**2) * white[k]
    watch = watched(coloured)
    # the sign of a Gaussian pair of correlation r agrees with probability 1/2 + asin(r) / pi
    assert watch.alike == pytest.approx(0.5 + math.asin(0.95) / math.pi, abs=0.02)
    assert [a.code for a in watch.advice('pitch')] == ['stale-model']


def test_a_push_now_and_then_is_no_staleness(white):
    pushed = white.copy()
    for begin in range(0, len(white), 2500):
        pushed[begin : begin + 100] += 30.0
    assert watched(pushed).advice('roll') == ()


def test_motion_beyond_what_the_model_saw_is_told(white):
    assert watched(white, excursion=0.3, largest=0.4).advice('roll') == ()
    assert watched(white, excursion=-0.5, largest=0.4).amplitude == pytest.approx(0.5 * math.sqrt(2.0))
    (advice,) = watched(white, excursion=-0.5, largest=0.4).advice('roll')
    assert advice.code == 'beyond-amplitude' and '22.9 deg' in advice.message


def test_a_young_watch_says_nothing(white):
    assert watched(50.0 * white[:5000]).advice('roll') == ()


def told_by_predictor(hull, amplitude, told_noise, largest):
    """Codes that a predictor tells after 90 s of a sine with noise of 1e-3 rad and 5e-3 rad/s."""
    rng, frequency = np.random.default_rng(2), 2.0 * math.pi / 2.5
    predictor = Predictor()
    predictor.set_model('roll', hull, largest)
    for k in range(9000):
        stamp = k * STEP
        predictor.observe(ImuSample(
            stamp,
            roll=amplitude * math.sin(frequency * stamp) + 1e-3 * rng.normal(),
            roll_rate=amplitude * frequency * math.cos(frequency * stamp) + 5e-3 * rng.normal(),
            roll_variance=(1e-3 * told_noise) ** 2, roll_rate_variance=(5e-3 * told_noise) ** 2,
        ))  # fmt: skip
    return {advice.code for advice in predictor.diagnostics().advice}


def test_the_predictor_says_when_its_model_is_stale():
    hull = DecayModel.from_terms(EQUATIONS['linear'], {'b1': 0.4, 'r1': 6.3}, axis='roll')
    assert told_by_predictor(hull, 0.05, 1.0, 0.1) == set()
    assert told_by_predictor(hull, 0.05, 0.2, 0.1) == {'stale-model'}
    assert told_by_predictor(hull, 0.2, 1.0, 0.1) == {'beyond-amplitude'}
    assert told_by_predictor(None, 0.2, 0.2, 0.1) == {'no-model'}
