"""What is forecast while the motion changes at once: never wilder than it, and soon forgotten."""

import math

import numpy as np
import pytest

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.axis_filter import MotionSize
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.pipeline.record_run import run_through

PERIOD, INTERVAL = 3.0, 0.1


def waves(seconds, seed=3):
    """Roll, pitch and their rates (N, 4) in waves of about three seconds."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, seconds, INTERVAL)
    frequency = 2.0 * np.pi / PERIOD * rng.normal(1.0, 0.12, (2, 40))
    phase = time[:, None, None] * frequency + rng.uniform(0.0, 7.0, frequency.shape)
    angle, rate = 0.01 * np.cos(phase).sum(axis=2), -0.01 * (frequency * np.sin(phase)).sum(axis=2)
    return time, np.hstack([angle, rate]) + rng.normal(size=(time.size, 4)) * [1e-4, 1e-4, 3e-4, 3e-4]


def trial_of(time, motion):
    return Trial(time, **dict(zip((*AXES, 'roll_rate', 'pitch_rate'), motion.T, strict=True)))


@pytest.mark.long
@pytest.mark.parametrize(
    ('factor', 'stretch'),
    [(8.0, 1.0), (0.02, 0.1), *(pytest.param(*each, marks=pytest.mark.release) for each in ((0.02, 1.0), (2.0, 0.1)))],
)
def test_no_forecast_is_wilder_than_the_motion_of_the_last_two_periods(factor, stretch):
    time, motion = waves(110.0)
    # within a period: an angle that jumps against its rate is a sensor's fault, not a motion that changes
    part = np.clip((time - 70.0) / PERIOD, 0.0, 1.0)[:, None]
    scale = 1.0 + 0.5 * (factor - 1.0) * (1.0 - np.cos(np.pi * part))
    grows = 0.5 * (factor - 1.0) * np.pi / PERIOD * np.sin(np.pi * part)
    motion = np.hstack([scale * motion[:, :2], scale * motion[:, 2:] + grows * motion[:, :2]])
    motion[:, 2:] /= stretch
    time = stretch * time
    settings = ForecasterSettings((0.5 * stretch, 1.5 * stretch, 5.0 * stretch), forecast_rate=10.0 / stretch)
    for step in run_through(trial_of(time, motion), settings).steps:
        if step.forecast is None or step.stamp < 20.0 * stretch:
            continue
        # the period that is found is some tenths off that of the waves, and the filtered motion overshoots
        last = motion[(time > step.stamp - 1.6 * 2.0 * PERIOD * stretch) & (time <= step.stamp + 1e-9), :2]
        mean = motion[time <= step.stamp + 1e-9, :2].mean(axis=0)
        largest = 3.0 * np.maximum(0.5 * np.ptp(last, axis=0), np.abs(last[-1] - mean)) + 0.05 * np.ptp(last, axis=0)
        assert (step.forecast.deviation[:, :2] <= 1.2 * largest + 1e-3).all()
        assert (np.abs(step.forecast.mean[:, :2] - mean) <= 1.2 * largest + 3e-3).all()


@pytest.mark.long
def test_a_craft_that_was_pushed_is_quiet_as_soon_as_it_is():
    rate_hz, natural = 25.0, 2.0 * math.pi / 2.5
    state, motion = np.zeros(2), []
    rng = np.random.default_rng(1)
    for k in range(round(130 * rate_hz)):
        hand = 0.11 * natural**2 if k % 1000 < 15 and k > 100 else 0.0
        state[1] += (hand - 0.1 * natural * state[1] - natural**2 * state[0]) / rate_hz
        state[0] += state[1] / rate_hz
        motion.append([state[0], 0.0, state[1], 0.0])
    motion = np.array(motion) + rng.normal(size=(len(motion), 4)) * [3e-4, 3e-4, 1e-3, 1e-3]
    trial = trial_of(np.arange(len(motion)) / rate_hz, motion)
    limit = QuiescenceLimits(roll=math.radians(3.0), duration=5.0)
    told = [(step.stamp, step.outlook) for step in run_through(trial, ForecasterSettings(quiescence=limit)).steps]
    since_push = 40.0  # s between them; half of it, the roll is below a degree
    calm = [found.quiescence for stamp, found in told if found and stamp > 80.0 and stamp % since_push > 22.0]
    assert np.mean(calm) > 0.93 and min(calm) > 0.8


def test_the_size_of_now_forgets_a_larger_motion_in_some_periods_and_the_whole_one_does_not():
    size = MotionSize(375.0)
    size.period = PERIOD
    for k in range(4000):
        amplitude = 1.0 if k < 3000 else 0.1
        phase = 2.0 * math.pi / PERIOD * INTERVAL * k
        size.follow(amplitude * math.sin(phase), amplitude * 2.0 * math.pi / PERIOD * math.cos(phase), INTERVAL)
        if k == 2999:
            assert size.present == pytest.approx(math.sqrt(0.5), rel=0.1)
            assert size.reach.amplitude == pytest.approx(1.0, rel=0.1)
        if k == 3000 + round(2.2 * PERIOD / INTERVAL):
            assert size.reach.amplitude == pytest.approx(0.1, rel=0.2)
    assert size.present < 0.1 and size.deviation > 0.5
