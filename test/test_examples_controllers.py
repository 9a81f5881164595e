"""The examples of controllers, on a short simulated record: what they compute, and that the forecast helps."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from swath_sysid.formats.csv_trials import write_csv

WARMUP = 240.0


@pytest.fixture(scope='module', autouse=True)
def path_to_examples():
    """The folder of the examples, from which each imports what they share."""
    folder = str(Path(__file__).resolve().parents[1] / 'examples')
    sys.path.insert(0, folder)
    yield
    sys.path.remove(folder)


@pytest.fixture(scope='module')
def trial(path_to_examples):
    return importlib.import_module('craft_in_waves').simulated_craft(420.0)


@pytest.fixture(scope='module')
def voyage(trial):
    return importlib.import_module('craft_in_waves').sail(trial, WARMUP)


def test_a_voyage_holds_what_came(trial, voyage):
    assert voyage.stamps[0] == pytest.approx(WARMUP, abs=0.2)
    # the truth of vertical motion ends half a minute before the record does
    assert 384.0 < voyage.stamps[-1] <= 387.0
    came = voyage.truth(voyage.stamps + 0.2)
    assert came[:, 3] == pytest.approx(np.interp(voyage.stamps + 0.2, trial.time, trial.roll))
    mean, covariance = voyage.at_lead(0.2)
    assert np.std(mean[:, 1] - came[:, 1]) < 0.2 * np.std(came[:, 1])
    assert covariance.shape == (*mean.shape, 7)


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


def test_the_actuator_follows_through_the_inverse_of_its_lag():
    gangway = importlib.import_module('gangway')
    time = gangway.STEP * np.arange(300)
    ahead = [np.sin(time + gangway.STEP * k) for k in (gangway.DELAY, gangway.DELAY + 1)]
    left = (np.sin(time) - gangway.follow(gangway.through_inverse_lag(*ahead)))[30:]
    assert np.abs(left).max() < 1e-3
    raw = (np.sin(time) - gangway.follow(np.sin(time)))[30:]
    assert np.abs(raw).max() > 0.4


def test_accelerations_are_integrated_exactly_where_they_change_linearly():
    gangway = importlib.import_module('gangway')
    time = gangway.STEP * np.arange(4)
    found = gangway.integrated_twice(np.array([0.5]), np.array([-0.2]), (0.3 + 2.0 * time)[None])
    np.testing.assert_allclose(found[0], 0.5 - 0.2 * time + 0.15 * time**2 + time**3 / 3.0, rtol=1e-12)


def test_a_gangway_is_stiller_with_the_forecast(voyage):
    gangway = importlib.import_module('gangway')
    for left in gangway.residual_variances(gangway.hold(voyage)).values():
        assert left['forecast'] < 0.1 * left['constant rate'] < left['raw']


def test_a_winch_plans_within_its_limits_and_gains_by_the_horizon(voyage):
    mpc = importlib.import_module('mpc')
    planned = mpc.plan(0.0, np.full(mpc.STEPS, 5.0), np.ones(mpc.STEPS))
    assert planned == pytest.approx(np.full(mpc.STEPS, -mpc.LARGEST))
    _, speeds = mpc.control(voyage)
    rms = {name: np.sqrt(np.mean(speed**2)) for name, speed in speeds.items()}
    assert rms['forecast'] < 0.9 * rms['constant rate']
    assert rms['forecast'] < 0.7 * rms['persistence'] < rms['(not at all)']


@pytest.mark.parametrize('name', ['landing', 'gangway', 'mpc'])
def test_each_prints_a_table_and_draws_a_figure(name, voyage, tmp_path, capsys, monkeypatch):
    shared, file = importlib.import_module('craft_in_waves'), tmp_path / 'figure.png'
    monkeypatch.setattr(shared, 'sail', lambda *_, **__: voyage)
    assert shared.carry_out('', importlib.import_module(name).demonstrate, ['--figure', str(file)]) == 0
    assert 'forecast' in capsys.readouterr().out and file.stat().st_size > 10_000


def test_a_record_that_cannot_be_used_is_refused(trial, tmp_path, capsys):
    short = tmp_path / 'short.csv'
    write_csv(short, trial.between(None, 50.0))
    shared = importlib.import_module('craft_in_waves')
    assert shared.carry_out('', None, [str(short), '--figure', str(tmp_path / 'a.png')]) == 2
    assert 'without a gap' in capsys.readouterr().err
