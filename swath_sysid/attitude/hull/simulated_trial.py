"""Trials with known truth: a hull's free decay as an inertial sensor would have recorded it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Value, up_in_body
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError

MAX_SAMPLES = 20_000_000


@dataclass(frozen=True)
class SensorNoise:
    """White noise of an inertial sensor, standard deviations."""

    angle: float = 0.001  #: rad.
    #: rad/s; by default about that of the SWATH pitch trials; `PublishedHull.rate_noise` is that of each study.
    rate: float = 0.0165
    acceleration: float = 0.02  #: m/s^2.

    def __post_init__(self) -> None:
        if not (self.angle >= 0 and self.rate >= 0 and self.acceleration >= 0):
            raise InputError('noise cannot be negative')


def simulated_trial(
    model: DecayModel,
    initial_angle: float,
    duration: float,
    rate_hz: float = 100.0,
    noise: SensorNoise = SensorNoise(),  # noqa: B008 - frozen
    seed: int = 1,
    hold: float = 0.0,
) -> Trial:
    """A free decay, released at rest from an initial angle, at even samples.

    Args:
        model: Of the hull.
        initial_angle: From trim, rad.
        duration: From release, s.
        rate_hz: Samples per second.
        noise: Of the sensor, standard deviations; by default about that of the SWATH pitch trials.
        seed: Of the noise.
        hold: Seconds for which the craft is held at the initial angle first.

    Returns:
        Angles, Euler rates and the gravity part of the specific force; the other axis at rest.

    Raises:
        InputError: Too few or too many samples, or the motion runs away from that angle.

    Example:
        >>> trial = simulated_trial(hull_named('swath-roll').model, initial_angle=0.1, duration=15.0)
        >>> trial.time.size, sorted(trial.channels)[-4:]
        (1500, ['pitch', 'pitch_rate', 'roll', 'roll_rate'])
    """
    if not (duration > 0.0 and rate_hz > 0.0 and hold >= 0.0):
        raise InputError('duration and rate must be greater than zero, hold not negative', 'times-of-trial')
    count = int(round((hold + duration) * rate_hz))
    if not 8 <= count <= MAX_SAMPLES:
        raise InputError(
            f'{count} samples cannot be simulated: choose duration and rate for 8 to {MAX_SAMPLES:,} samples'
        )
    time = np.arange(count) / rate_hz
    angle = np.full(count, model.trim + initial_angle)
    rate = np.zeros(count)
    free = time >= hold
    angle[free], rate[free] = simulate(model, model.trim + initial_angle, 0.0, time[free])
    if not (np.isfinite(angle).all() and np.abs(angle).max() < np.pi / 2):
        raise InputError(
            f'this hull does not return from {np.degrees(initial_angle):g} deg: its restoring moment vanishes before; '
            'choose a smaller initial angle or one of the other sign'
        )
    rng = np.random.default_rng(seed)
    other = 'pitch' if model.axis == 'roll' else 'roll'
    truth = {model.axis: angle, f'{model.axis}_rate': rate, other: np.zeros(count), f'{other}_rate': np.zeros(count)}
    truth |= gravity_reading(truth['roll'], truth['pitch'])
    spread = {name: noise.rate if name.endswith('_rate') else noise.angle for name in truth}
    spread |= {name: noise.acceleration for name in truth if name.startswith('accel')}
    measured: dict[str, Any] = {name: values + spread[name] * rng.normal(size=count) for name, values in truth.items()}
    return Trial(time, **measured, source='simulation', initial_angle=float(initial_angle))


def gravity_reading(roll: Value, pitch: Value) -> dict[str, Value]:
    """Specific force of a sensor that only gravity acts on, m/s^2, body axes forward, port, up."""
    up = up_in_body(roll, pitch)
    return {name: STANDARD_GRAVITY * part for name, part in zip(('accel_x', 'accel_y', 'accel_z'), up, strict=True)}
