"""A record run through the pipeline: every forecast from the past alone, one at every turn."""

import math

import numpy as np
import pytest
from records_at_sea import sea

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.pipeline.record_run import run_through

SETTINGS = ForecasterSettings(leads=(0.5, 1.0), horizon=2.0, horizon_step=0.5)


def test_what_is_to_come_changes_no_forecast_before():
    trial, others, changed_from = sea(30.0), sea(30.0, seed=7), 22.0
    is_later = trial.time > changed_from
    columns = {name: np.where(is_later, 3.0 * others.channels[name], own) for name, own in trial.channels.items()}
    alike = []
    steps = (run_through(each, SETTINGS).steps for each in (trial, Trial(trial.time, **columns)))
    for one, two in zip(*steps, strict=True):
        assert one.stamp == two.stamp
        same = all(
            np.array_equal(getattr(part.axes[axis], name), getattr(counterpart.axes[axis], name))
            for part, counterpart in ((one.forecast, two.forecast), (one.horizon, two.horizon))
            for axis in part.axes
            for name in ('angle', 'rate', 'covariance', 'half_width')
        )
        assert same == (one.stamp <= changed_from), one.stamp
        alike.append(same)
    assert sum(alike) > 200


@pytest.mark.parametrize(('rate', 'asked', 'every'), [(10.0, 5.0, 0.2), (50.0, 10.0, 0.1), (10.0, 100.0, 0.1)])
def test_forecasts_come_at_the_rate_asked_for_but_never_between_samples(rate, asked, every):
    settings = ForecasterSettings(leads=(0.5,), horizon=0.5, forecast_rate=asked)
    run = run_through(sea(15.0, 1.0 / rate), settings)
    np.testing.assert_allclose(np.diff([step.stamp for step in run.steps]), every, atol=1e-9)


def test_a_record_of_one_axis_and_a_record_that_is_still():
    trial = sea(30.0)
    run = run_through(Trial(trial.time, roll=trial.roll), SETTINGS)
    assert len(run.steps) > 250 and all(list(step.forecast.axes) == ['roll'] for step in run.steps)
    still = np.zeros(trial.time.size)
    run = run_through(Trial(trial.time, roll=still, roll_rate=still), SETTINGS)
    assert max(abs(step.forecast.axes['roll'].angle).max() for step in run.steps) < 1e-6
    assert all(np.isfinite(step.forecast.axes['roll'].half_width).all() for step in run.steps)


def test_times_and_progress_are_given_and_the_clock_is_an_argument():
    ticks, shares = iter(range(10**6)), []
    trial = sea(20.0)
    run = run_through(trial, SETTINGS, clock=lambda: float(next(ticks)), progress=shares.append)
    assert run.step_times == (1.0,) * trial.time.size and set(run.refit_times) == {1.0}
    assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] < 1.0
    assert all(math.isnan(spent) for spent in run_through(trial, SETTINGS).step_times)


def test_limits_of_quiescence_are_taken_up_at_their_stamp():
    wide, narrow = (QuiescenceLimits(math.radians(size), math.radians(size), duration=2.0) for size in (60.0, 0.2))
    settings = ForecasterSettings(leads=(0.5,), horizon=2.0, horizon_step=0.1, quiescence=wide)
    run = run_through(sea(30.0), settings, limits_from=(20.0, narrow))
    before, after = (
        [step.horizon.quiescence for step in run.steps if span[0] <= step.stamp < span[1]]
        for span in ((10.0, 20.0), (20.0, 30.0))
    )
    assert run.quiescence_limits == narrow and run.reliability is not None
    assert np.nanmin(before) > 0.9 and np.nanmax(after) < 0.5
