"""Landing through the running node: what it publishes of a replayed record decides as play-through does."""

import importlib
import os
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy')

from swath_sysid.formats.bags import write_imu_bag  # noqa: E402
from swath_sysid.formats.forecast_output import ForecastMessages  # noqa: E402
from swath_sysid.formats.messages import typestore  # noqa: E402
from swath_sysid.formats.reading import read_readings, read_trial  # noqa: E402
from swath_sysid.formats.topics import CALM_TOPIC, point_lead_topic, type_of  # noqa: E402
from swath_sysid.nodes.parameters.files import values_from_file  # noqa: E402
from swath_sysid.nodes.parameters.predictor import pipeline_settings  # noqa: E402
from swath_sysid.pipeline.play_through import PlayThrough, PlayThroughSettings  # noqa: E402
from swath_sysid.share import share_folder  # noqa: E402

pytestmark = pytest.mark.dds

CHEAP = {'waves_first_fit_s': 170.0, 'waves_refit_interval_s': 60.0, 'forecast_rate_hz': 5.0}
LENGTH = 197.0


@pytest.fixture
def example(monkeypatch):
    """Imports an example, and leaves the ROS domain as it is."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[1] / 'examples'))
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'PYTHONPATH'):
        monkeypatch.setenv(name, os.environ.get(name, ''))
    return importlib.import_module


def played(bag, settings, listener):
    """What play-through publishes, taken by a listener."""
    pipeline, messages = PlayThrough(PlayThroughSettings(forecasts=settings, auto_identify=False)), ForecastMessages('')
    takers = {CALM_TOPIC: listener.on_calm} | {
        point_lead_topic('sensor', lead): lambda message, lead=lead: listener.on_lead(lead, message)
        for lead in listener.leads
    }
    for reading in read_readings(bag):
        for topic, raw in messages.of(pipeline.add(reading).step):
            if topic in takers:
                takers[topic](typestore().deserialize_cdr(raw, type_of(topic)))
    return listener


@pytest.mark.long
def test_landings_through_the_node_are_those_of_play_through(example, tmp_path):
    landing, landing_live = example('landing'), example('landing_live')
    content = yaml.safe_load(landing.PARAMETERS.read_text(encoding='utf-8'))
    content['/**/predictor']['ros__parameters'] |= CHEAP
    parameters = tmp_path / 'landing.yaml'
    parameters.write_text(yaml.safe_dump(content), encoding='utf-8')
    settings = pipeline_settings(values_from_file(parameters, 'predictor'))
    trial = read_trial(share_folder() / 'records' / 'morro_buoy.csv', frame='frd').between(None, LENGTH)
    live = landing_live.hear(trial, 1000.0, parameters, landing.DESCENTS, int(os.environ['ROS_DOMAIN_ID'] or 0))
    bag = tmp_path / 'record.mcap'
    write_imu_bag(bag, trial, start_stamp_ns=landing_live.START_NS)
    offline = played(bag, settings, landing_live.Listener(landing.DESCENTS))
    for lead in landing.DESCENTS:
        # what is lost on the way is lost, but what comes is the same
        common = sorted(live.at_lead[lead].keys() & live.calm.keys())
        assert len(common) > 0.9 * len(offline.at_lead[lead]) > 100
        forecasts, decided = [], []
        for each in (live, offline):
            calm = np.array([each.calm[stamp] for stamp in common])
            mean, covariance = (np.array([each.at_lead[lead][stamp][part] for stamp in common]) for part in (0, 1))
            forecasts.append((calm, mean, covariance))
            decided.append(landing.decisions(calm, mean, covariance, lead))
        for one, other in zip(*forecasts, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)
        for method, when in decided[0].items():
            np.testing.assert_array_equal(when, decided[1][method])
            assert method == 'window of calm' or 0.1 < when.mean() < 0.3
