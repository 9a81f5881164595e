"""Records of craft in waves of which every sine is known."""

import math
from dataclasses import replace

import numpy as np

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.motion.vertical import vertical_acceleration


def only(trial, keep):
    """The samples that a mask keeps."""
    return replace(trial, time=trial.time[keep], **{name: values[keep] for name, values in trial.channels.items()})


def sea(duration=120.0, step=0.1, seed=0):
    """Roll and pitch of many sines and their rates, with noise."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, duration, step)
    frequency, phase = rng.uniform(1.0, 3.0, (2, 60)), rng.uniform(0.0, 6.28, (2, 60))
    turns = [np.outer(time, f) + p for f, p in zip(frequency, phase, strict=True)]
    angles = [0.01 * np.cos(turn).sum(axis=1) for turn in turns]
    rates = [-0.01 * np.sin(turn) @ f for turn, f in zip(turns, frequency, strict=True)]
    roll, pitch, roll_rate, pitch_rate = np.array(angles + rates) + rng.normal(0.0, 1e-3, (4, time.size))
    return Trial(time, roll=roll, pitch=pitch, roll_rate=roll_rate, pitch_rate=pitch_rate, source='simulated')


def swell(duration, seed=2):
    """A craft that follows a swell of many lines: the trial, and a function that gives the vertical motion.

    From times and the distance of a point ahead of the sensor: heave, velocity and acceleration, shape (..., 3).
    """
    rng = np.random.default_rng(seed)
    frequency = rng.uniform(0.08, 0.25, 40)
    w, phase = 2.0 * math.pi * frequency, rng.uniform(0.0, 2.0 * math.pi, 40)
    size = 0.15 * np.exp(-(((frequency - 0.14) / 0.04) ** 2))

    def lines(time, factor, order, turn=0.0):
        angle = np.multiply.outer(time, w) + phase + turn + 0.5 * math.pi * order
        return np.cos(angle) @ (size * factor * w**order)

    def motion(time, ahead=0.0):
        heave, velocity, acceleration = (lines(time, 1.0, order) for order in range(3))
        pitch, rate, turning = (lines(time, 0.08 * w, order, 0.3) for order in range(3))
        parts = np.sin(pitch), np.cos(pitch) * rate, np.cos(pitch) * turning - np.sin(pitch) * rate**2
        return np.stack([heave, velocity, acceleration], axis=-1) - ahead * np.stack(parts, axis=-1)

    time = np.arange(0.0, duration, 0.1)
    (pitch, pitch_rate), (roll, roll_rate) = (
        [lines(time, factor * w, order, turn) for order in range(2)] for factor, turn in ((0.08, 0.3), (0.1, 1.1))
    )
    up = motion(time)[:, 2] + STANDARD_GRAVITY
    force = up * np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    noise = rng.normal(size=(7, time.size)) * np.array([[1e-4]] * 4 + [[5e-3]] * 3)
    names = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
    values = np.stack([roll, pitch, roll_rate, pitch_rate, *force]) + noise
    return Trial(time, **dict(zip(names, values, strict=True)), source='swell'), motion


def evenly(trial, step, until=None):
    """Times, s, and at them, by straight lines, the vertical acceleration and each measured channel by its name."""
    time = np.arange(trial.time[0], trial.time[-1] if until is None else trial.time[0] + until, step)
    known = {name: np.isfinite(values) for name, values in trial.channels.items()}
    found = {name: np.interp(time, trial.time[is_], trial.channels[name][is_]) for name, is_ in known.items()}
    force = np.stack([found[f'accel_{axis}'] for axis in 'xyz'], axis=1)
    return time, vertical_acceleration(found['roll'], found['pitch'], force), found
