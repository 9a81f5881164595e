"""Simulated measurements with known truth: a free decay as a trial, or a craft in waves, sample by sample."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulation import motion_step, simulate
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


RETURN_SPAN = 30.0  #: s after which a craft that returns has returned.
RELEASE_ANGLES = np.radians((6.0, 5.0, 4.0, 3.0, 2.0))  #: Of which the first from which the hull returns is taken.
WAVE_COMPONENTS = 40  #: Sinusoids in the motion in waves.
WAVE_BAND = 0.5, 1.5  #: Their frequencies, as multiples of the natural frequency.


@dataclass(frozen=True)
class CraftSettings:
    """The hull, the sensor, and how the craft is released."""

    model: DecayModel
    angle: float  #: To which the craft is lifted, from trim, rad.
    rate_hz: float = 100.0
    lift: float = 1.5  #: s.
    hold: float = 1.0  #: s.
    sea: float = 0.0  #: Root mean square of the motion in waves, rad; 0: still water.
    noise: SensorNoise = field(default_factory=SensorNoise)
    seed: int = 1

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0.0 and self.lift > 0.0 and self.hold >= 0.0 and self.sea >= 0.0):
            raise InputError('rate_hz and lift must be greater than zero, hold and sea not negative')
        if not returns(self.model, self.angle):
            raise InputError(
                f'this hull does not return from {np.degrees(self.angle):g} deg: its restoring moment vanishes before; '
                'choose a smaller angle or one of the other sign'
            )


@dataclass(frozen=True)
class CraftReading:
    """What the sensor measures at one sample, in the craft's axes."""

    roll: float  #: rad.
    pitch: float
    roll_rate: float  #: Euler rate, rad/s.
    pitch_rate: float
    force: tuple[float, float, float]  #: Specific force, m/s^2.


class SimulatedCraft:
    """The readings of a craft's sensor at even times; the same settings and releases give the same readings."""

    def __init__(self, settings: CraftSettings) -> None:
        self.settings = settings
        self._rng = np.random.default_rng(settings.seed)
        self._angles = self._rates = np.empty(0)
        self._next = self._count = 0
        frequency = 2.0 * np.pi / settings.model.natural_period
        self._waves = frequency * self._rng.uniform(*WAVE_BAND, WAVE_COMPONENTS) if settings.sea else np.empty(0)
        self._phases = self._rng.uniform(0.0, 2.0 * np.pi, self._waves.size)
        angle, rate, _ = self._motion_in_waves(0.0)
        self._state = settings.model.trim + float(angle), float(rate)

    def release(self) -> float:
        """Lift the craft from where it is, hold it and let it go: s from the next reading to the release."""
        s = self.settings
        begin, target = self._state[0], s.model.trim + s.angle
        lift, hold = (round(span * s.rate_hz) for span in (s.lift, s.hold))
        phase = np.pi * np.arange(1, lift + 1) / lift
        angles = begin + (target - begin) * 0.5 * (1.0 - np.cos(phase))
        rates = (target - begin) * 0.5 * np.sin(phase) * s.rate_hz * np.pi / lift
        self._angles = np.concatenate([angles, np.full(hold, target)])
        self._rates = np.concatenate([rates, np.zeros(hold)])
        self._next = 0
        return (lift + hold) / s.rate_hz

    def next_reading(self) -> CraftReading:
        """The next reading."""
        if self._next == len(self._angles):
            self._move_freely()
        angle, rate = float(self._angles[self._next]), float(self._rates[self._next])
        self._next += 1
        self._count += 1
        self._state = angle, rate
        return self._measured(angle, rate)

    def _move_freely(self) -> None:
        model = self.settings.model
        count = math.ceil(model.natural_period * self.settings.rate_hz)
        if self._waves.size:
            self._angles, self._rates = self._driven(count)
        else:
            angles, rates = simulate(model, *self._state, np.arange(count + 1) / self.settings.rate_hz)
            self._angles, self._rates = angles[1:], rates[1:]
        self._next = 0

    def _motion_in_waves(self, time: Value) -> tuple[Value, Value, Value]:
        """Angle from trim, rate and acceleration of a craft that nobody has touched, at times, s."""
        w = self._waves
        phase = np.multiply.outer(time, w) + self._phases
        amplitude = self.settings.sea * np.sqrt(2.0 / max(w.size, 1))
        cosine, sine = amplitude * np.cos(phase), amplitude * np.sin(phase)
        return cosine.sum(axis=-1), -(sine @ w), -(cosine @ (w * w))

    def _driven(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The next angles and rates under the moment by which the waves make the untouched craft move as it does."""
        model, step = self.settings.model, 1.0 / self.settings.rate_hz
        angle, rate, acceleration = self._motion_in_waves((self._count - 0.5 + np.arange(count)) * step)
        moments = (acceleration - model.acceleration(model.trim + angle, rate)).tolist()
        ratios, active, friction = tuple(model.ratios.tolist()), model.equation.active, model.friction_rate
        x, w, motion = self._state[0] - model.trim, self._state[1], []
        for moment in moments:
            _, x, w = motion_step(x, w, moment, step, ratios, active, friction)
            motion.append((x, w))
        angles, rates = np.array(motion).T
        return model.trim + angles, rates

    def _measured(self, angle: float, rate: float) -> CraftReading:
        noise, axis = self.settings.noise, self.settings.model.axis
        other = 'pitch' if axis == 'roll' else 'roll'
        angles = {axis: angle, other: 0.0}
        force = gravity_reading(angles['roll'], angles['pitch'])
        spread = np.array([noise.angle] * 2 + [noise.rate] * 2 + [noise.acceleration] * 3)
        errors = (spread * self._rng.normal(size=spread.size)).tolist()
        x, y, z = (float(value) + error for value, error in zip(force.values(), errors[4:], strict=True))
        return CraftReading(
            angles['roll'] + errors[0],
            angles['pitch'] + errors[1],
            (rate if axis == 'roll' else 0.0) + errors[2],
            (rate if axis == 'pitch' else 0.0) + errors[3],
            (x, y, z),
        )


def returns(model: DecayModel, angle: float) -> bool:
    """Whether a craft let go at rest at this angle from trim, rad, returns to trim."""
    angles, _ = simulate(model, model.trim + angle, 0.0, np.linspace(0.0, RETURN_SPAN, 301))
    moved = angles - model.trim
    return bool(np.isfinite(moved).all() and np.abs(moved).max() < np.pi / 2 and abs(moved[-1]) < abs(angle))


def release_angle(model: DecayModel) -> float:
    """The first of `RELEASE_ANGLES`, rad, from which this hull returns."""
    found = next((float(angle) for angle in RELEASE_ANGLES if returns(model, angle)), None)
    if found is None:
        raise InputError(f'this hull does not return from {np.degrees(RELEASE_ANGLES[-1]):g} deg: choose another hull')
    return found
