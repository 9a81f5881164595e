"""The examples of controllers, on a short simulated record: what they compute, and that the forecast helps."""

import importlib
import os
import sys
from unittest.mock import patch

import numpy as np
import pytest
import yaml
from repository import ROOT
from scipy.stats import norm

from swath_sysid.formats.reading import read_trial
from swath_sysid.share import share_folder


@pytest.fixture(scope='module', autouse=True)
def path_to_examples():
    with patch.object(sys, 'path', [str(ROOT / 'examples'), *sys.path]):
        yield


@pytest.fixture(scope='module')
def voyage(path_to_examples):
    shared = importlib.import_module('craft_in_waves')
    return shared.sail(shared.simulated_craft(420.0), 240.0)


@pytest.mark.release
def test_more_landings_succeed_by_the_forecast(voyage):
    landing = importlib.import_module('landing')
    shares = landing.land(voyage)
    for lead in range(2):
        assert shares['forecast'][lead, 0] > shares['any time'][lead, 0] + 0.15
        assert shares['forecast'][lead, 0] > shares['persistence'][lead, 0]


def test_the_probability_of_keeping_limits_is_that_of_a_normal_forecast():
    landing = importlib.import_module('landing')
    mean, deviation = np.array([0.2, 0.01, -0.02]), np.array([0.3, 0.03, 0.02])
    edges = [norm.cdf((sign * landing.LIMITS - mean) / deviation) for sign in (1.0, -1.0)]
    found = landing.inside_probability(mean[None], np.diag(deviation**2)[None])
    assert found[0] == pytest.approx(np.prod(edges[0] - edges[1]), abs=0.01)


def test_the_actuator_follows_through_the_inverse_of_its_lag_and_integration_is_exact():
    gangway = importlib.import_module('gangway')
    time = gangway.STEP * np.arange(300)
    ahead = [np.sin(time + gangway.STEP * k) for k in (gangway.DELAY, gangway.DELAY + 1)]
    left = (np.sin(time) - gangway.follow(gangway.through_inverse_lag(*ahead)))[30:]
    assert np.abs(left).max() < 1e-3
    raw = (np.sin(time) - gangway.follow(np.sin(time)))[30:]
    assert np.abs(raw).max() > 0.4
    # accelerations that change linearly are integrated exactly
    time = gangway.STEP * np.arange(4)
    found = gangway.integrated_twice(np.array([0.5]), np.array([-0.2]), (0.3 + 2.0 * time)[None])
    np.testing.assert_allclose(found[0], 0.5 - 0.2 * time + 0.15 * time**2 + time**3 / 3.0, rtol=1e-12)


@pytest.mark.release
def test_a_gangway_is_stiller_with_the_forecast(voyage):
    gangway = importlib.import_module('gangway')
    for left in gangway.residual_variances(gangway.hold(voyage)).values():
        assert left['forecast'] < 0.1 * left['constant rate'] < left['raw']


def test_the_platform_answers_after_its_delay_at_its_speed_and_falls_back_without_a_forecast():
    steady = importlib.import_module('steady_platform')
    platform, angles = steady.Platform(), []
    for _ in range(10):
        platform.send(1.0)
        angles.append(platform.angle)
    late = round(steady.DELAY / steady.STEP)
    moved = steady.STEP * steady.SPEED * np.arange(1, 11 - late)
    np.testing.assert_allclose(angles, np.concatenate([np.zeros(late), moved]))
    assert platform.ahead() == pytest.approx(10 * steady.STEP * steady.SPEED)
    # a target that can be followed is: the plan reaches it in the first step
    leads = np.arange(0.1, 5.05, 0.1)
    near = steady.Horizon(0.0, leads, np.full(leads.size, platform.ahead() + 0.2 * steady.STEP * steady.SPEED), 5.0)
    assert steady.command(platform, 0.0, 9.0, near) == pytest.approx(0.2 * steady.SPEED, rel=0.5)
    for horizon, time in ((None, 0.0), (near, 6.0), (steady.Horizon(0.0, leads, 0.0 * leads, 0.1), 0.0)):
        assert steady.command(platform, time, 0.3, horizon) == (0.3 - platform.ahead()) / steady.STEP
        assert steady.command(platform, time, None, horizon) == -platform.ahead() / steady.STEP


@pytest.mark.long
@pytest.mark.parametrize('seed', [101, pytest.param(102, marks=pytest.mark.release)])
def test_the_platform_is_steadier_with_the_forecast_and_no_worse_while_the_sensor_is_frozen(seed):
    steady = importlib.import_module('steady_platform')
    found = steady.errors(seed, None, 150.0, 80.0)
    assert found['forecast'] < 0.3 * found['reading'] and found['forecast'] < 0.8 * found['reading and rate']
    found = steady.errors(seed, (100.0, 120.0), 150.0)
    assert found['forecast'] <= found['reading']


@pytest.mark.release
@pytest.mark.dds
def test_landings_are_decided_by_what_the_running_node_publishes(tmp_path, monkeypatch):
    """That the node publishes what play-through computes is shown by test_nodes_replay.py."""
    pytest.importorskip('rclpy')
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'PYTHONPATH'):
        monkeypatch.setenv(name, os.environ.get(name, ''))
    landing, landing_live = importlib.import_module('landing'), importlib.import_module('landing_live')
    content = yaml.safe_load(landing.PARAMETERS.read_text(encoding='utf-8'))
    cheap = {'waves_first_fit_periods': 66.0, 'waves_refit_interval_periods': 19.0, 'forecast_rate_hz': 5.0}
    content['/**/predictor']['ros__parameters'] |= cheap
    parameters = tmp_path / 'landing.yaml'
    parameters.write_text(yaml.safe_dump(content), encoding='utf-8')
    trial = read_trial(share_folder() / 'records' / 'morro_buoy.csv', frame='frd').between(None, 220.0)
    live = landing_live.hear(trial, 1000.0, parameters, landing.DESCENTS, int(os.environ['ROS_DOMAIN_ID'] or 0))
    for lead, heard in live.at_lead.items():
        stamps = sorted(heard.keys() & live.calm.keys())
        assert len(stamps) > 100
        calm, mean, covariance = (
            np.array(each) for each in zip(*((live.calm[at], *heard[at]) for at in stamps), strict=True)
        )
        for method, when in landing.decisions(calm, mean, covariance, lead).items():
            assert method == 'window of calm' or 0.1 < when.mean() < 0.3
