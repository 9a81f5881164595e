"""The window of odometry and thrust, and what a refit on it believes."""

from dataclasses import replace

import numpy as np
import pytest
from manoeuvring_runs import OLD

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.programme import SensorNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.identification.refit import (
    ManoeuvreRefitRequest,
    ManoeuvreRefitter,
    pieces,
    refit_manoeuvring,
)
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.intake import prepare
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE
from swath_sysid.manoeuvring.motion.window import ManoeuvringWindow

pytestmark = pytest.mark.slow

SETTINGS = ManoeuvringSettings(mass=180.0, generations=2, population=12)


@pytest.fixture(scope='module')
def window():
    """One that saw three runs one after the other."""
    window, start = ManoeuvringWindow(), 0.0
    for k, name in enumerate(('speed_up', 'turns_fast', 'zigzag_20')):
        m = with_noise(trial_programme(OLD)[name], SensorNoise(), 10 + k)
        columns = (m.time + start, m.surge, m.sway, m.yaw_rate, m.heading, m.x, m.y)
        for port, starboard, *motion in zip(m.port, m.starboard, *columns, strict=True):
            thrusts(window, port, starboard)
            window.add_motion(*motion)
        start += m.time[-1] + 10.0
    return window


def thrusts(window, port, starboard):
    window.add_thrust('port', port)
    window.add_thrust('starboard', starboard)


@pytest.fixture(scope='module')
def outcome(window):
    return refit_manoeuvring(ManoeuvreRefitRequest(window.trial(), None, SETTINGS))


def test_the_window_keeps_what_came(window):
    trial = window.trial()
    assert trial.thrust_input == FORCE
    assert trial.time.size == window.size
    first = trial_programme(OLD)['speed_up']
    assert np.array_equal(trial.port[: first.time.size], first.port)
    assert trial.frame == 'enu'


def test_memory_is_fixed_and_the_oldest_give_way():
    window = ManoeuvringWindow(duration=60.0)
    thrusts(window, 0.5, 0.4)
    for k in range(20000):
        window.add_motion(0.01 * k, 1.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    trial = window.trial()
    assert trial.thrust_input == COMMAND
    assert trial.time[-1] - trial.time[0] == pytest.approx(60.0, abs=0.2)
    assert window.size <= 1200


def test_what_is_wrong_is_counted_and_left_out():
    window = ManoeuvringWindow(stop_after=0.5)
    with pytest.raises(InputError, match='port and starboard'):
        window.trial()
    window.add_motion(0.0, 1, 0, 0, 0, 0, 0)
    window.add_thrust('port', float('nan'))
    thrusts(window, 50.0, 40.0)
    with pytest.raises(InputError, match='odometry'):
        window.trial()
    for stamp in (0.0, 0.1, 0.1, 0.05, 0.2):
        window.add_motion(stamp, 1, 0, 0.1, 0, 0, 0)
    window.add_motion(0.3, float('inf'), 0, 0, 0, 0, 0)
    window.add_motion(1.0, 1, 0, 0.1, 0, 0, 0)
    assert window.counts == {'not-finite': 2, 'late': 2, 'jumped-back': 0, 'no-thrust': 1}
    assert window.trial().port.tolist() == [50.0, 50.0, 50.0, 0.0]
    window.add_motion(-50.0, 1, 0, 0.1, 0, 0, 0)
    assert window.counts['jumped-back'] == 1
    assert window.size == 1


def test_a_refit_finds_the_craft(outcome):
    assert outcome.model is not None, outcome.message
    assert outcome.model.model['Xuu'] == pytest.approx(OLD['Xuu'], rel=0.2)
    assert outcome.model.model['Nr'] == pytest.approx(OLD['Nr'], rel=0.1)
    assert outcome.model.metrics['held_out']
    assert np.isnan(outcome.current_misfit)


@pytest.mark.long
def test_only_a_better_model_replaces_the_current_one(window, outcome):
    good = outcome.model
    again = refit_manoeuvring(ManoeuvreRefitRequest(window.trial(), good, SETTINGS))
    assert again.model is None
    assert 'as well' in again.message
    wrong = replace(good, model=good.model.with_values(Xuu=-150.0, Nr=-800.0))
    better = refit_manoeuvring(ManoeuvreRefitRequest(window.trial(), wrong, SETTINGS))
    assert better.model is not None
    assert better.misfit < 0.8 * better.current_misfit


def test_the_way_back(outcome):
    refitter = ManoeuvreRefitter()
    assert not refitter.rollback()
    assert refitter.take(outcome)
    assert not refitter.rollback()
    assert refitter.take(replace(outcome, model=replace(outcome.model, metrics={})))
    assert refitter.rollback()
    assert refitter.model is outcome.model
    assert not refitter.take(replace(outcome, model=None))


def test_pieces_do_not_span_gaps(window):
    run = prepare(window.trial())
    parts = pieces(run)
    assert len(parts) >= 4
    for part in parts:
        known = np.flatnonzero(np.isfinite(part.surge))
        assert np.max(np.diff(known)) * part.step < 2.1
        assert part.smooth.shape == (3, part.time.size)
    with pytest.raises(InputError, match='too short'):
        pieces(replace(run, time=run.time[:300]))
