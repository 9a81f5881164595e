"""The shortest leads against the true motion of a simulated sea, whose sensor reports its noise rightly or not."""

import numpy as np
import pytest

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import RATE_NOISE, NoiseMeter
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings

LEADS = np.array([0.04, 0.08, 0.16])
TOLD = {'': 3e-4, '_rate': 2e-3}


def waves(seed, peak):
    """Angle, or its rate, at times (N,), of a sea with this peak period, s."""
    rng = np.random.default_rng(seed)
    frequency = 2.0 * np.pi / peak * rng.normal(1.0, 0.12, 60)
    height, phase = 0.05 * np.sqrt(2.0 / 60.0) * rng.rayleigh(size=60) / np.sqrt(2.0), rng.uniform(0.0, 7.0, 60)

    def angle(times):
        return np.cos(np.outer(times, frequency) + phase) @ height

    def rate(times):
        return -np.sin(np.outer(times, frequency) + phase) @ (height * frequency)

    return angle, rate


@pytest.mark.release
@pytest.mark.parametrize(
    ('sample_rate', 'noise'),
    [(25.0, 0.5), (100.0, 1.0), (25.0, 2.0)],
)
def test_the_true_motion_lies_in_the_intervals_of_the_shortest_leads(sample_rate, noise):
    sea, rng = {axis: waves(place, 3.0 - place) for place, axis in enumerate(AXES)}, np.random.default_rng(5)
    pipeline = ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(tuple(LEADS))))
    told = {f'{axis}{kind}_variance': std**2 for axis in AXES for kind, std in TOLD.items()}
    held, sure = [], []
    times = np.arange(0.0, 75.0, 1.0 / sample_rate)
    measured = {
        axis + kind: sea[axis][place](times) + noise * std * rng.normal(size=times.size)
        for axis in AXES
        for place, (kind, std) in enumerate(TOLD.items())
    }
    for k, time in enumerate(times.tolist()):
        values = {name: value.item(k) for name, value in measured.items()}
        sample = CraftSample(
            **{**dict.fromkeys(CraftSample._fields, np.nan), **told, **values, 'stamp_ns': round(time * 1e9)}
        )
        step = pipeline.add_sample(sample)
        if step.sea_request is not None:
            pipeline.install(fit_sea(step.sea_request))
        if time > 45.0 and step.forecast is not None:
            deviation = step.forecast.deviation[:, : len(AXES)].T
            errors = np.array([step.forecast.angle(axis) - sea[axis][0](time + LEADS) for axis in AXES])
            held.append(np.abs(errors) < 1.645 * deviation)
            sure.append(deviation)
    assert np.mean(held, axis=(0, 1)) == pytest.approx(0.9, abs=0.09)
    assert (np.diff(np.mean(sure, axis=0)) > 0.0).all()


@pytest.mark.parametrize(('told', 'used'), [(1e-3, 2e-3), (2e-3, 2e-3), (2.2e-3, 2.2e-3), (9e-3, 2e-3), (0.0, 0.0)])
def test_a_report_of_the_noise_holds_unless_the_readings_show_another(told, used):
    meter, rng = NoiseMeter(*RATE_NOISE), np.random.default_rng(2)
    for k in range(4000):
        found = meter.believed(told**2)
        meter.take(0.3 * np.sin(0.02 * k) + 2e-3 * rng.normal())
    assert np.sqrt(found) == pytest.approx(used, rel=0.1)


def test_motion_left_at_slow_sampling_is_no_noise_that_a_sensor_forgot_to_report():
    meter = NoiseMeter(*RATE_NOISE)
    for k in range(4000):
        found = meter.believed(1e-6)
        meter.take(0.3 * np.sin(0.7 * k))
    assert found == 1e-6
