"""What an upstream channel is worth to the forecasts, and costs where it fails or lies."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from test_prediction_upstream import LEADS, NOISE, RESONANCE, SETTINGS, STEP, TRAVEL, craft_and_probe, seeing

from swath_sysid.evaluation.scoring import score
from swath_sysid.pipeline.record_run import run_through


def error(trial, run, begin=300.0, until=None):
    roll = score(trial, run, warmup=begin, until=until).axes['roll']
    return roll.nrmse['forecast'], roll.coverage[:, 1]


@pytest.fixture(scope='module')
def blind():
    """A run without the probe."""
    return run_through(craft_and_probe()[0], SETTINGS)


@pytest.fixture(scope='module')
def without(blind):
    return error(craft_and_probe()[0], blind)[0]


@pytest.mark.release
def test_a_wave_is_forecast_until_it_has_passed_the_probe_and_then_as_well_as_can_be(without):
    trial, probe = craft_and_probe()
    found, coverage = error(trial, seeing(trial, trial.time, probe))
    # at leads below the travel only noise is unknown; beyond, what the wave does after it passed the probe
    response = lfilter([1.0], RESONANCE, np.eye(1, 1000)[0]) ** 2
    after = (response[: round(max(0.0, lead - TRAVEL) / STEP)].sum() / response.sum() for lead in LEADS)
    best = [math.sqrt(NOISE**2 + unknown) for unknown in after]
    assert found[0] < 2.5 * best[0] and found[1] < 2.5 * best[1] and found[2] < 1.15 * best[2]
    assert (found[:2] < 0.3 * without[:2]).all() and found[2] < 0.85 * without[2]
    assert (np.abs(coverage - 0.9) < 0.06).all()
    # a channel of noise costs nothing
    noise = np.random.default_rng(5).standard_normal(probe.size)
    assert (error(trial, seeing(trial, trial.time, noise))[0] < 1.03 * without).all()


@pytest.mark.release
@pytest.mark.parametrize('kind', ['lost', 'quick', 'late'])
def test_samples_may_be_lost_quicker_than_the_imus_or_late(without, kind):
    trial, probe = craft_and_probe()
    rng = np.random.default_rng(3)
    kept = rng.uniform(size=probe.size) > 0.05
    stamps = np.sort(rng.uniform(0.0, trial.time[-1], 5 * probe.size))
    sent = {
        'lost': (trial.time[kept], probe[kept]),
        'quick': (stamps, np.interp(stamps, trial.time, probe)),
        'late': (trial.time, probe, trial.time + 1.0),
    }[kind]
    found, _ = error(trial, seeing(trial, *sent))
    assert (found[:2] < [0.2, 0.2]).all() and (found[:2] < 0.35 * without[:2]).all()


@pytest.mark.release
@pytest.mark.parametrize('kind', ['stuck', 'lying'])
def test_a_probe_that_is_stuck_or_lies_costs_little_and_serves_again(blind, without, kind):
    trial, probe = craft_and_probe()
    instead = probe[1900] if kind == 'stuck' else craft_and_probe(seed=9)[1]
    seen = np.where((trial.time > 340.0) & (trial.time < 460.0), instead, probe)
    run = seeing(trial, trial.time, seen)
    meanwhile, after = (error(trial, run, *span)[0] for span in ((400.0, 455.0), (550.0, 590.0)))
    usual = error(trial, blind, 400.0, 455.0)[0]
    assert (meanwhile < 1.1 * usual).all() and (after[:2] < 0.35 * without[:2]).all()
