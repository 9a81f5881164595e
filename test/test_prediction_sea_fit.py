"""What is learnt of the sea: a request as data, a pure function, a result without holes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.prediction.forecaster import Forecaster, ForecasterSettings
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.rows import CHANNELS, ROWS_A_PERIOD
from swath_sysid.attitude.prediction.sea_fit import (
    LONG_WAVES,
    LONGEST_FILLED,
    NEW_WAVES,
    WAVES,
    SeaRequest,
    fit_sea,
    newest_stretch,
)
from swath_sysid.attitude.prediction.state_space import InnovationsFilter
from swath_sysid.attitude.prediction.vertical_forecast import VerticalForecaster, VerticalRequest

STEP, PERIOD = 0.1, USUAL_PERIOD


def waves(count):
    rng, channels = np.random.default_rng(0), len(CHANNELS)
    frequency = rng.uniform(1.2, 4.0, 40)
    angle = np.multiply.outer(STEP * np.arange(count), frequency)[:, None] + rng.uniform(0.0, 6.0, (channels, 40))
    return 0.01 * np.cos(angle).sum(-1) + rng.normal(0.0, 1e-3, (count, channels))


@pytest.mark.parametrize(
    ('count', 'absent', 'missing'),
    [
        *((count, (), 0.0) for count in (0, 1, 80, 300)),
        *((900, absent, 0.0) for absent in ((1, 3), (4, 5, 6, 7, 8), tuple(range(9)))),
        *((900, (), missing) for missing in (0.05, 0.6)),
    ],
)
def test_what_cannot_be_learnt_is_left_out_and_the_rest_is_sound(count, absent, missing):
    values = waves(count)
    values[:, absent] = math.nan
    values[np.random.default_rng(1).uniform(size=count) < missing] = math.nan
    before = values.copy()
    fit = fit_sea(SeaRequest(12.5, STEP, PERIOD, CHANNELS, values))
    np.testing.assert_array_equal(values, before)
    assert fit.time == 12.5 and fit.excitations == {}
    assert set(fit.waves) <= {WAVES, LONG_WAVES, NEW_WAVES} and None not in fit.waves.values()
    for model in fit.waves.values():
        assert all(np.isfinite(np.asarray(part)).all() for part in (model.a, model.k, model.c))
        assert not {CHANNELS[place] for place in absent} & set(model.channels)
        assert abs(np.linalg.eigvals(model.a)).max() <= 1.0 + 1e-9
    if count >= 900 and len(absent) < len(CHANNELS) and missing < 0.5:
        assert set(fit.waves) == {WAVES, LONG_WAVES, NEW_WAVES}
    if count < 2 or len(absent) == len(CHANNELS):
        assert fit.waves == {}


def test_values_that_do_not_change_teach_nothing_and_break_nothing():
    for values in (np.zeros((900, len(CHANNELS))), np.ones((900, len(CHANNELS)))):
        fit = fit_sea(SeaRequest(1.0, STEP, PERIOD, CHANNELS, values))
        assert all(np.isfinite(np.asarray(model.a)).all() for model in fit.waves.values())


@pytest.mark.long
def test_a_hull_is_asked_for_its_moment_and_gets_it():
    """The request of a forecaster that knows a hull; the axis without one is not asked for."""
    forecaster, request = Forecaster(ForecasterSettings(leads=(0.5,), horizon=0.5)), None
    forecaster.set_model('roll', IdentifiedModel.exactly(hull_named('swath-roll').model))
    for number, row in enumerate(waves(800).tolist()):
        sample = CraftSample(round(1e9 * STEP * number), *row[:4], *(math.nan,) * 7)
        step = forecaster.observe(sample, STEP * number, STEP if number else None)
        request = forecaster.issue(step).sea_request or request
    assert set(request.excitations) == {'roll'} and request.names == CHANNELS
    samples = round(request.period / ROWS_A_PERIOD / STEP)
    assert request.step == pytest.approx(samples * STEP) and request.values.shape[1] == len(CHANNELS)
    fit = fit_sea(request)
    assert set(fit.excitations) == {'roll'} and fit.excitations['roll'] is not None


def stretch_of(channels, step):
    """The same by looking at every sample in turn, backwards."""
    used = [channel for channel in channels if not all(map(math.isnan, channel))]
    stretch = []
    for number in reversed(range(len(channels[0]) if used else 0)):
        if any(math.isnan(channel[number]) for channel in used):
            continue
        if stretch and (stretch[0] - number) * step > LONGEST_FILLED * PERIOD:
            break
        stretch.insert(0, number)
    rows = np.arange(stretch[0], stretch[-1] + 1) if stretch else np.empty(0)
    return [np.interp(rows, stretch, np.array(channel)[stretch]) if stretch else rows for channel in channels]


def two_channels(count):
    values = st.lists(st.one_of(st.just(math.nan), st.floats(-1.0, 1.0)), min_size=count, max_size=count)
    return st.lists(values, min_size=2, max_size=2)


@given(st.integers(0, 40).flatmap(two_channels))
def test_the_newest_stretch_is_that_of_looking_backwards(channels):
    step = LONGEST_FILLED * PERIOD / 4.5
    found = newest_stretch(np.array(channels, dtype=float), step, PERIOD)
    wanted = np.array(stretch_of(channels, step))
    assert found.shape == wanted.shape
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(('roll', 'sensor'), [(1e-4, 0.0), (0.0, 5e-3), ('coarse', 5e-3)])
def test_a_craft_that_only_heaves_is_forecast_vertically(roll, sensor):
    """Whether its roll is noise, stays the same to the last digit, or jumps by one of them now and then."""
    count, ahead, row, rng = 2400, 30, 2399, np.random.default_rng(1)
    frequency = 2.0 * np.pi * np.array([0.11, 0.12, 0.135, 0.15])
    heave = 0.2 * np.cos(np.outer(STEP * np.arange(count + ahead), frequency) + rng.uniform(0.0, 6.0, 4))
    velocity = np.gradient(heave.sum(axis=1), STEP)
    values = np.full((count, len(CHANNELS)), math.nan)
    measured = dict(zip(CHANNELS, values.T, strict=True))
    for name in ('pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y'):
        measured[name][:] = 0.0
    steps = 0.01 * (rng.uniform(size=count) < 0.03)
    measured['roll'][:] = steps if roll == 'coarse' else rng.normal(0.0, roll, count)
    measured['accel_z'][:] = STANDARD_GRAVITY - heave[:count] @ frequency**2 + rng.normal(0.0, sensor, count)
    fit = fit_sea(SeaRequest(1.0, STEP, PERIOD, CHANNELS, values, vertical=VerticalRequest(ahead + 2, 0.0, row)))
    waves = InnovationsFilter(fit.waves[WAVES], ATTITUDE, 3.0)
    waves.seed(values[-600:])
    forecaster = VerticalForecaster(STEP, PERIOD, ahead + 2)
    for sample in values:
        forecaster.take(sample, None)
    forecaster.install(fit.vertical, row, waves)
    known = np.zeros((2, 4)), np.tile(1e-6 * np.eye(4), (2, 1, 1))
    found, covariance = forecaster.forecast(np.array([1.0, 2.0]), 0.0, *known)
    assert found[:, 1] == pytest.approx(velocity[[row + 10, row + 20]], abs=0.1 * velocity.std())
    assert np.isfinite(covariance).all()
    assert (np.diagonal(covariance, axis1=1, axis2=2)[:, :3] > 0.0).all()
