"""A craft in still water, sample by sample: at rest, lifted about one axis, held and released."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, gravity_reading
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.common.errors import InputError

FREE_SPAN = 60.0  #: s of free motion that are simulated at once.
RETURN_SPAN = 30.0  #: s after which a craft that returns has returned.


@dataclass(frozen=True)
class CraftSettings:
    """The hull, the sensor, and how the craft is released."""

    model: DecayModel
    angle: float  #: To which the craft is lifted, from trim, rad.
    rate_hz: float = 100.0
    lift: float = 1.5  #: s.
    hold: float = 1.0  #: s.
    noise: SensorNoise = field(default_factory=SensorNoise)
    seed: int = 1

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0.0 and self.lift > 0.0 and self.hold >= 0.0):
            raise InputError('rate_hz and lift must be greater than zero, hold not negative')
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
        self._next = 0
        self._state = settings.model.trim, 0.0

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
        self._state = angle, rate
        return self._measured(angle, rate)

    def _move_freely(self) -> None:
        time = np.arange(round(FREE_SPAN * self.settings.rate_hz) + 1) / self.settings.rate_hz
        angles, rates = simulate(self.settings.model, *self._state, time)
        self._angles, self._rates, self._next = angles[1:], rates[1:], 0

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
