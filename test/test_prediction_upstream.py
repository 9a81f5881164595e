"""Upstream channels: alignment by stamps, a wave that is seen before it comes, and channels that fail or lie."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.bank import CANDIDATES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.rows import OF_MEANS
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.attitude.prediction.upstream import LONGEST_PAST, NEW_UPSTREAM, UPSTREAM, PastRows, needed_past
from swath_sysid.common.errors import InputError
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import ArrivingSamples, UpstreamSeries, run_through, samples_of

STEP, TRAVEL, NOISE = 0.2, 4.0, 0.02
LEADS = (1.0, 3.0, 6.0)
RESONANCE = [1.0, -2.0 * 0.97 * math.cos(2.0 * math.pi * STEP / 4.0), 0.97**2]
UNKNOWN = [math.nan] * OF_MEANS.stop
SETTINGS = ForecasterSettings(leads=LEADS, horizon=6.0, horizon_step=1.0, forecast_rate=1.0)


def craft_and_probe(seed=1, duration=600.0, travel=TRAVEL):
    """A craft that rolls as a wave is, so many s after that has passed the probe; the wave resonates at 4 s."""
    count, late = round(duration / STEP), round(travel / STEP)
    values = lfilter([1.0], RESONANCE, np.random.default_rng(seed).standard_normal(count + 2000))[1000:]
    values /= values.std()
    noise = NOISE * np.random.default_rng(seed + 100).standard_normal((2, count))
    trial = Trial(np.arange(count) * STEP, roll=0.1 * (values[200 : 200 + count] + noise[0]))
    return trial, values[200 + late : 200 + late + count] + noise[1]


def seeing(trial, stamps, values, *arrivals):
    """A run whose upstream channel has these samples."""
    return run_through(trial, SETTINGS, upstream={'probe': UpstreamSeries(stamps, values, *arrivals)})


def test_gaps_repetitions_and_samples_out_of_order_are_lost():
    rows = PastRows(('probe',), 400)
    rows.lay_out(0.1, math.nan)
    for number in range(300):
        t = 0.1 * number
        rows.add(UNKNOWN, t)
        if not 5.0 < t < 10.0:
            rows.take('probe', t, math.nan if number % 10 == 3 else 1.0 if 15.0 < t < 20.0 else math.sin(t))
            rows.take('probe', t - 0.35, 7.0)
    values = rows.request(300, 100, 1.0).values[:, 0]
    time = 0.1 * np.arange(300)
    assert np.isnan(values[(time > 5.2) & (time < 9.9)]).all() and np.isnan(values[(time > 17.2) & (time < 20.0)]).all()
    seen = (time < 4.9) | (time > 20.5) & (time < 29.5)
    np.testing.assert_allclose(values[seen], np.sin(time[seen]), atol=0.02)


@pytest.mark.parametrize('ratio', [0.5, 2.0, 3.0])
def test_rows_at_another_step_go_on_with_the_samples_that_have_come(ratio):
    rows = PastRows(('probe', 'late'), 600)
    rows.lay_out(0.1, math.nan)
    stamps, count, step, sent = np.arange(0.0, 60.0, 0.05), 0, 0.1, 0
    while count * 0.1 < 30.0:
        rows.add(UNKNOWN, count * 0.1)
        for stamp in stamps[sent : sent + 2]:
            rows.take('probe', stamp, math.sin(stamp))
            rows.take('late', stamp - 1.0, math.cos(stamp - 1.0))
        sent, count = sent + 2, count + 1
    now = (count - 1) * 0.1
    rows.lay_out(ratio * step, ratio)
    for number in range(1, round(20.0 / (ratio * step)) + 1):
        stamp = now + ratio * step * number
        rows.add(UNKNOWN, stamp)
        for at in stamps[(stamps > stamp - ratio * step + 1e-9) & (stamps <= stamp + 1e-9)]:
            rows.take('probe', at, math.sin(at))
            rows.take('late', at - 1.0, math.cos(at - 1.0))
    last = now + ratio * step * number
    values = rows.request(400, 100, 1.0).values
    time = last - ratio * step * np.arange(len(values))[::-1]
    for channel, delay, truth in ((values[:, 0], 0.0, np.sin(time)), (values[:, 1], 1.0, np.cos(time))):
        known = np.isfinite(channel)
        np.testing.assert_allclose(channel[known], truth[known], atol=0.02)
        # but for the rows beside those that were not known yet when the step changed
        seen = (time > 1.0) & (time < last - 1.5) & (abs(time - now + delay) > 2.5 * ratio * step)
        assert known[seen].all()


@pytest.mark.parametrize('travel', [4.0, 14.0, 24.0])
def test_the_past_is_as_long_as_the_wave_travels(travel):
    trial, probe = craft_and_probe(travel=travel)
    rows = np.column_stack([trial.roll, np.full((probe.size, 3), math.nan), probe])
    assert travel - 3.0 <= needed_past(rows, STEP, 3.0, LONGEST_PAST * USUAL_PERIOD) <= travel + 3.0


@pytest.mark.long
def test_channels_are_known_and_their_gain_is_told():
    trial, probe = craft_and_probe(duration=300.0)
    names = ('probe', 'noise')
    pipeline = ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(leads=LEADS, upstream=names)))
    with pytest.raises(InputError, match="'prob' is not an upstream channel: the settings have probe, noise"):
        pipeline.add_upstream('prob', 0, 1.0)
    with pytest.raises(InputError, match='given twice'):
        ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(upstream=('probe', 'probe'))))
    noise = np.random.default_rng(2).standard_normal(probe.size)
    series = {'probe': UpstreamSeries(trial.time, probe), 'noise': UpstreamSeries(trial.time, noise)}
    beside = ArrivingSamples(series, pipeline.add_upstream)
    for sample in samples_of(trial):
        beside.until(sample.stamp_ns)
        step = pipeline.add_sample(sample)
        if step.sea_request is not None:
            pipeline.install(fit_sea(step.sea_request))
    found = pipeline.diagnostics()
    assert found.candidates == (*CANDIDATES, NEW_UPSTREAM, UPSTREAM, 'without-probe', 'without-noise')
    assert found.weights.shape == (len(found.candidates), 2, len(LEADS))
    roll = {name: gain[0] for name, gain in found.upstream_gain.items()}
    assert (roll['probe'][:2] > 0.8).all() and (np.abs(roll['noise']) < 0.3).all()
    assert all(np.isnan(gain[1]).all() for gain in found.upstream_gain.values()), 'pitch is not measured'
