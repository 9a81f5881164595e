"""The sea state on board: asked for once a minute, found beside the samples, and published as YAML."""

import numpy as np
import pytest
import yaml
from bag_messages import STORE

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.sea_fit import SeaFit, sea_of
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.topics import SEA_TOPIC
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings

EPOCH_NS, STEP_NS = 1_700_000_000_000_000_000, 100_000_000
HEIGHT, PERIOD = 1.0, 8.0
NAN = float('nan')


def published(count, *, has_force=True):
    """By stamp, ns: what sea/state says of a craft on a swell from ahead, of which nothing but the sea is learnt."""
    w, time = 2.0 * np.pi / PERIOD, 1e-9 * STEP_NS * np.arange(count)
    lines, phase = w * np.array([0.95, 1.0, 1.05]), np.array([0.3, 1.7, 5.0])
    swing = np.multiply.outer(time, lines) + phase
    size = HEIGHT / 4.0 * np.sqrt(2.0 / 3.0)
    acceleration = -(size * lines**2 * np.sin(swing)).sum(axis=1)
    slope = (size * lines**2 / STANDARD_GRAVITY * np.cos(swing)).sum(axis=1)
    rate = np.gradient(-slope, time)
    seldom = ForecasterSettings(leads=(1.0,), horizon=1.0, horizon_step=1.0, forecast_rate=1.0)
    pipeline, messages, found = ForecastPipeline(PipelineSettings(forecaster=seldom)), ForecastMessages('craft'), {}
    for k in range(count):
        pitch, up = -slope[k], STANDARD_GRAVITY + acceleration[k]
        force = (-np.sin(pitch) * up, 0.0, np.cos(pitch) * up) if has_force else (NAN, NAN, NAN)
        sample = CraftSample(EPOCH_NS + k * STEP_NS, 0.0, pitch, 0.0, rate[k], *force, *4 * (0.0,))
        step = pipeline.add_sample(sample)
        for topic, raw in messages.sea_of(step):
            if topic == SEA_TOPIC:
                found[step.sample.stamp_ns] = yaml.safe_load(STORE.deserialize_cdr(raw, 'std_msgs/msg/String').data)
        request = step.sea_request
        if request is not None:
            sea = sea_of(request) if request.wants_sea_state else None
            pipeline.install(SeaFit(request.time, {}, {}, sea=sea))
    return found


@pytest.mark.long
def test_a_report_comes_each_minute_with_the_sea_or_why_it_is_not_known():
    reports = published(4000)
    gaps = 1e-9 * np.diff([EPOCH_NS, *reports])
    # as often as the waves are learnt
    assert len(reports) == 6 and gaps.mean() == pytest.approx(60.0, abs=4.0) and gaps.max() < 61.0 + 6.2 * PERIOD
    assert all(report['stamp_ns'] == stamp for stamp, report in reports.items())
    first, *_, report = reports.values()
    assert not first['is_known'] and 'too few waves' in first['reason'] and 'significant_height_m' not in first
    assert report['is_known'] and report['reason'] == ''
    assert report['significant_height_m'] == pytest.approx(HEIGHT, rel=0.1)
    assert report['mean_period_s'] == pytest.approx(PERIOD, rel=0.05)
    assert abs(report['axis_rad']) < 0.05
    assert report['significant_height_std_m'] > 0.0 < report['axis_std_rad']
    remarks = ' '.join(report['remarks'])
    assert 'encounter' in remarks and 'not a wave buoy' in remarks
    # a sensor without accelerations
    (report,) = published(900, has_force=False).values()
    assert 'the sensor lacks' in report['reason']
