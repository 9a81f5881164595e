"""Angles and rates that do not quite belong together: a hull is no reason to forecast worse than without one."""

import math

import numpy as np
import pytest

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.prediction.axis_filter import AgreementMeter
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

LINEAR = Equation('linear', ('b1', 'r1'))
ANGLE_STD, RATE_STD = 0.0005, 0.002


def swing(step, lag=0.0, gain=1.0):
    """Angle, late by ``lag`` and scaled by ``gain``, and rate of two sines with white noise."""
    time = np.arange(0.0, 120.0, step)
    noise = np.random.default_rng(4).normal(size=(2, time.size))
    late = time - lag
    angle = gain * (0.1 * np.sin(2.1 * late) + 0.05 * np.sin(3.3 * late + 1.0)) + ANGLE_STD * noise[0]
    rate = 0.21 * np.cos(2.1 * time) + 0.165 * np.cos(3.3 * time + 1.0) + RATE_STD * noise[1]
    return time, angle, rate


def excess(step, **how):
    meter = AgreementMeter()
    _, angle, rate = swing(step, **how)
    for sample in zip(angle, rate, strict=True):
        meter.take(step, *sample, ANGLE_STD**2, RATE_STD**2)
    return meter.excess(step)


@pytest.mark.parametrize('step', [0.01, 0.1])
def test_a_lag_or_a_gain_is_noise_of_the_rate_that_departs_as_far(step):
    (time, true, _), count = swing(step), math.ceil(USUAL_PERIOD / math.tau / step)
    assert excess(step) == 0.0
    for how in ({'lag': 0.07}, {'gain': 0.9}):
        # by hand: the mean square of what the span adds to the difference between angle and integrated rate
        apart = swing(step, **how)[1] - true
        added = (apart[count:] - apart[:-count])[time[count:] > 90.0]
        assert excess(step, **how) == pytest.approx(np.mean(added**2) / (count * step**2), rel=0.25)


def test_gaps_and_missing_values_say_nothing():
    meter = AgreementMeter()
    _, angle, rate = swing(0.1)
    for place, sample in enumerate(zip(angle, rate, strict=True)):
        if place % 97 == 0:
            meter.restart()
        missing = (math.nan, sample[1]) if place % 31 == 0 else sample
        meter.take(0.1, *missing, ANGLE_STD**2, RATE_STD**2)
        assert meter.excess(0.1) == 0.0


@pytest.mark.release
def test_a_hull_does_not_spoil_the_forecast_of_a_buoy_whose_attitude_lags(data_folder):
    """Its angles are some 0.07 s behind its gyroscopes; the hull is what the first five minutes show of it."""
    trial = read_trial(data_folder / 'waves' / 'morro_buoy.csv', frame='frd').between(None, 240.0)
    hull = DecayModel.of(b1=0.945, r1=6.776, trim=0.042, axis='pitch')
    covariance = np.array([[0.0555, -0.0028], [-0.0028, 0.5406]])
    leads = np.array([0.5, 1.0, 2.0])
    error = {}
    for name, models in (('hull', {'pitch': IdentifiedModel(hull, covariance)}), ('none', {})):
        steps = run_through(trial, ForecasterSettings(leads=tuple(leads)), models).steps
        scored = [step for step in steps if 100.0 < step.stamp - trial.time[0] < 237.0]
        came = np.interp(np.array([step.stamp for step in scored])[:, None] + leads, trial.time, trial.pitch)
        forecast = np.array([step.forecast.angle('pitch') for step in scored])
        error[name] = np.sqrt(np.mean((forecast - came) ** 2, axis=0))
    assert np.all(error['hull'] < 1.2 * error['none'])
