"""Simulated trials: a programme of runs, and the sensor records of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.hull.stepping import SteeredCraft
from swath_sysid.manoeuvring.motion.trial import MEASURED

#: Runs to drive for an identification: name, instructions, duration in s.
RECIPE = (
    ('speeding up', 'straight, both thrusters alike: 15, 30, 50, 70, 100 % of full, 25 s each', 125),
    ('slowing down', 'straight: 90, 40, 80, 20, 0 %, 25 s each; on another course', 125),
    ('slow turns', 'about 25 % ahead, thrusters apart by 10 and by 20 %, to port and to starboard, 25 s each', 100),
    ('fast turns', 'about 60 % ahead, apart by 10 and by 30 %, to both sides, 25 s each', 100),
    ('zig-zag 10', 'about 50 % ahead, apart by 15 %, over to the other side at every 10 deg of heading', 90),
    ('zig-zag 20', 'about 65 % ahead, apart by 30 %, at every 20 deg', 90),
    ('astern', '50 % ahead for 15 s, 40 % astern for 20 s, then one thruster ahead and one astern, both ways', 75),
    ('mixed', 'any thrusts, each held for 5 to 15 s, on courses all around the compass', 105),
)

MIXED = ((0.8, 0.4), (0.3, 0.7), (0.9, 0.9), (0.2, 0.6), (0.7, 0.1), (0.1, 0.1), (0.5, 0.95))


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of white noise: speeds, m/s, yaw rate, rad/s, heading, rad, position, m."""

    speed: float = 0.05
    yaw_rate: float = 0.005
    heading: float = 0.005
    position: float = 0.3

    def __post_init__(self):
        for name, value in vars(self).items():
            if not value >= 0.0:
                raise InputError(f'the noise of {name} must not be negative: give zero or a positive number')


def trial_programme(model: ManoeuvringModel) -> dict[str, Manoeuvre]:
    """Straight runs with thrust steps, turns to both sides at several speeds, zig-zags; about 15 min."""
    return {
        'speed_up': _steps(model, [(s, s, 25) for s in (0.15, 0.3, 0.5, 0.7, 1.0)]),
        'speed_down': _steps(model, [(s, s, 25) for s in (0.9, 0.4, 0.8, 0.2, 0.0)]),
        'turns_slow': _steps(model, [(0.25 + d, 0.25 - d, 25) for d in (0.1, -0.1, 0.25, -0.2)]),
        'turns_fast': _steps(model, [(0.6 + d, 0.6 - d, 25) for d in (0.1, -0.1, 0.35, -0.25)]),
        'zigzag_10': _zigzag(model, 0.5, 0.15, np.radians(10.0)),
        'zigzag_20': _zigzag(model, 0.65, 0.3, np.radians(20.0)),
        'reverse': _steps(model, [(0.5, 0.5, 15), (-0.4, -0.4, 20), (0.6, -0.3, 20), (-0.3, 0.6, 20)]),
        'mixed': _steps(model, [(port, starboard, 15) for port, starboard in MIXED]),
    }


def with_noise(manoeuvre: Manoeuvre, noise: SensorNoise, seed: int) -> Manoeuvre:
    """The manoeuvre as noisy sensors record it; time, inputs, ``u`` and ``v`` stay exact."""
    rng = np.random.default_rng(seed)

    def disturbed(values: np.ndarray, std: float) -> np.ndarray:
        return values + std * rng.standard_normal(values.size)

    stds = noise.speed, noise.speed, noise.yaw_rate, noise.heading, noise.position, noise.position
    changed: dict = {n: disturbed(getattr(manoeuvre, n), std) for n, std in zip(MEASURED, stds, strict=True)}
    return replace(manoeuvre, **changed)


def _steps(model: ManoeuvringModel, stages: Sequence[tuple[float, float, float]]) -> Manoeuvre:
    """From rest, shares of the full input to port and to starboard, each held for a duration, s."""
    full, craft = model.largest_input, SteeredCraft(model)
    for port, starboard, duration in stages:
        craft.hold(port * full, starboard * full, duration)
    return craft.manoeuvre()


def _zigzag(model: ManoeuvringModel, base: float, difference: float, angle: float) -> Manoeuvre:
    full, turn = model.largest_input, 1.0
    craft = SteeredCraft(model, base * full)
    while craft.time < 90.0:
        craft.advance((base + turn * difference) * full, (base - turn * difference) * full)
        if -turn * craft.heading >= angle:
            turn = -turn
    return craft.manoeuvre()
