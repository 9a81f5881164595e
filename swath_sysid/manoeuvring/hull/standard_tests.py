"""Simulated manoeuvres: the standard tests (ITTC 7.5-04-02-01), and a programme of runs with sensor records."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre, SteeredCraft
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
class RunNoise:
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


def with_noise(manoeuvre: Manoeuvre, noise: RunNoise, seed: int) -> Manoeuvre:
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


LONGEST = 900.0  #: s; a test that lasts longer is cut off there.


@dataclass(frozen=True)
class DriveSettings:
    """Inputs of the tests, as shares of the largest input."""

    base: float = 0.6  #: Mean input of both thrusters, share.
    difference: float = 0.3  #: Half the difference of the inputs, share; positive turns to starboard.
    angle: float = math.radians(20.0)  #: Heading of a zig-zag at which the difference is reversed, rad.

    def __post_init__(self):
        if not 0.0 < self.base <= 1.0:
            raise InputError(f'the base input must be within 0 and 1, not {self.base}: give a share of the largest')
        if not 0.0 < abs(self.difference) <= 1.0:
            raise InputError(f'the difference must be within -1 and 1 and not zero, not {self.difference}')
        if not 0.0 < self.angle < math.pi / 2:
            raise InputError('the zig-zag angle must be between 0 and 90 degrees')


@dataclass(frozen=True)
class ManoeuvringTest:
    """Result of a standard test."""

    name: str
    manoeuvre: Manoeuvre
    numbers: dict[str, float]  #: Units in the names; NaN for what the test did not reach.
    curve: dict[str, np.ndarray]  #: Steady states, of the tests that measure a curve.


def _inputs(model: ManoeuvringModel, settings: DriveSettings, turn: float = 1.0):
    """Port and starboard inputs; ``turn`` 1 to starboard, -1 to port."""
    base, difference = settings.base * model.largest_input, settings.difference * model.largest_input
    return base + turn * difference, base - turn * difference


def turning_circle(model: ManoeuvringModel, settings: DriveSettings) -> ManoeuvringTest:
    """Advance, transfer, tactical and steady diameter, m, of a turn after a straight approach."""
    craft = _steady(model, settings.base)
    port, starboard = _inputs(model, settings)
    while abs(craft.heading) < math.radians(720.0) and craft.time < LONGEST:
        craft.advance(port, starboard)
    run = craft.manoeuvre()
    side = -1.0 if settings.difference > 0 else 1.0
    turned, aside = side * run.heading, side * run.y
    last = turned > turned[-1] - 2.0 * math.pi
    u, v, rate = run.u[last], run.v[last], run.yaw_rate[last]
    speed = float(np.mean(np.hypot(u, v)))
    numbers = {
        'approach_speed_m_s': float(run.u[0]),
        'advance_m': _when(turned, math.pi / 2, run.x),
        'transfer_m': _when(turned, math.pi / 2, aside),
        'tactical_diameter_m': _when(turned, math.pi, aside),
        'steady_diameter_m': 2.0 * speed / float(np.mean(np.abs(rate))) if turned[-1] > 3.0 * math.pi else math.nan,
        'time_to_90deg_s': _when(turned, math.pi / 2, run.time),
        'time_to_180deg_s': _when(turned, math.pi, run.time),
        'steady_speed_m_s': speed,
        'steady_yaw_rate_deg_s': float(np.degrees(np.mean(rate))),
        'drift_angle_deg': float(np.degrees(np.mean(np.arctan2(-v, u)))),
    }
    return ManoeuvringTest('turning-circle', run, numbers, {})


def zigzag(model: ManoeuvringModel, settings: DriveSettings) -> ManoeuvringTest:
    """Overshoots, deg, and period, s, of a zig-zag."""
    craft = _steady(model, settings.base)
    turn = 1.0
    ends: list[float] = []
    forward = -1.0 if settings.difference > 0 else 1.0
    while len(ends) < 6 and craft.time < LONGEST:
        craft.advance(*_inputs(model, settings, turn))
        if forward * turn * craft.heading >= settings.angle:
            turn = -turn
            ends.append(craft.time)
    run = craft.manoeuvre()
    overshoots = []
    for start, end in zip(ends, ends[1:], strict=False):
        span = (run.time >= start) & (run.time <= end)
        overshoots.append(np.degrees(np.max(np.abs(run.heading[span])) - settings.angle))
    numbers = {
        'angle_deg': math.degrees(settings.angle),
        'first_overshoot_deg': float(overshoots[0]) if overshoots else float('nan'),
        'second_overshoot_deg': float(overshoots[1]) if len(overshoots) > 1 else float('nan'),
        'initial_turning_time_s': ends[0] if ends else float('nan'),
        'period_s': float(ends[2] - ends[0]) if len(ends) > 2 else float('nan'),
    }
    return ManoeuvringTest('zigzag', run, numbers, {})


def speed_test(model: ManoeuvringModel, settings: DriveSettings) -> ManoeuvringTest:
    """Steady speed against input, from rest up to the largest input; ``settings`` are not used."""
    craft = _steady(model, 0.0)
    inputs, speeds, times = [], [], []
    for share in np.arange(1, 9) / 8.0:
        value, before, start = share * model.largest_input, craft.u, craft.time
        _hold_until_steady(craft, value, value)
        run = craft.manoeuvre()
        goal = before + (1.0 - math.exp(-1.0)) * (craft.u - before)
        rise = (run.u - before) / ((goal - before) or 1.0)
        after = run.time >= start
        inputs.append(value)
        speeds.append(craft.u)
        times.append(_when(rise[after], 1.0, run.time[after]) - start)
    numbers = {
        'largest_input': float(inputs[-1]),
        'largest_speed_m_s': float(speeds[-1]),
        'half_input_speed_m_s': float(np.interp(0.5 * inputs[-1], inputs, speeds)),
        'first_time_constant_s': float(times[0]),
        'last_time_constant_s': float(times[-1]),
    }
    curve = {'input': np.array(inputs), 'speed_m_s': np.array(speeds), 'time_constant_s': np.array(times)}
    return ManoeuvringTest('speed', craft.manoeuvre(), numbers, curve)


def crash_stop(model: ManoeuvringModel, settings: DriveSettings) -> ManoeuvringTest:
    """Distance and time from full ahead to a stop under full astern; the base input is not used."""
    full, craft = model.largest_input, _steady(model, 1.0)
    while craft.u > 0.0 and craft.time < LONGEST:
        craft.advance(-full, -full)
    run = craft.manoeuvre()
    stopped = craft.u <= 0.0
    way = float(np.sum(np.hypot(np.diff(run.x), np.diff(run.y))))
    numbers = {
        'initial_speed_m_s': float(run.u[0]),
        'stopping_time_s': float(run.time[-1]) if stopped else float('nan'),
        'track_reach_m': way if stopped else float('nan'),
        'head_reach_m': float(run.x[-1]) if stopped else float('nan'),
        'lateral_deviation_m': float(run.y[-1]),
    }
    return ManoeuvringTest('crash-stop', run, numbers, {})


def spiral(model: ManoeuvringModel, settings: DriveSettings) -> ManoeuvringTest:
    """Dieudonne's spiral: steady yaw rate against the thrust difference, from starboard to port and back."""
    down = np.linspace(1.0, -1.0, 13)
    turns = np.concatenate([down, down[::-1][1:]])
    craft = _steady(model, settings.base)
    steady = []
    for turn in turns:
        _hold_until_steady(craft, *_inputs(model, settings, turn))
        steady.append(craft.yaw_rate)
    rates = np.degrees(steady)
    difference = turns * settings.difference * model.largest_input
    there, back = rates[:13], rates[12:][::-1]
    slope = np.gradient(there, difference[:13])
    numbers = {
        'loop_height_deg_s': float(np.max(np.abs(there - back))),
        'yaw_rate_at_full_difference_deg_s': float(there[0]),
        'yaw_rate_without_difference_deg_s': float(there[6]),
        'slope_at_zero_deg_s_per_input': float(slope[6]),
    }
    return ManoeuvringTest('spiral', craft.manoeuvre(), numbers, {'difference': difference, 'yaw_rate_deg_s': rates})


_TESTS = turning_circle, zigzag, speed_test, crash_stop, spiral
TESTS = dict(zip(('turning-circle', 'zigzag', 'speed', 'crash-stop', 'spiral'), _TESTS, strict=True))


def run_test(name: str, model: ManoeuvringModel, settings: DriveSettings | None = None) -> ManoeuvringTest:
    """Run a standard test, a key of ``TESTS``, in still water."""
    check_choice(name, TESTS, 'test')
    return TESTS[name](model, settings or DriveSettings())


def _steady(model: ManoeuvringModel, share: float):
    """A craft in still water at its steady speed under a share of the largest input."""
    return SteeredCraft(replace(model, current=(0.0, 0.0)), share * model.largest_input)


def _hold_until_steady(craft: SteeredCraft, port: float, starboard: float, longest: float = 120.0):
    """Hold inputs until neither speed nor yaw rate changes by a thousandth of itself in 5 s."""
    before = None
    end = craft.time + longest
    while craft.time < end:
        craft.hold(port, starboard, 5.0)
        now = np.array([craft.u, craft.yaw_rate])
        if before is not None and np.all(np.abs(now - before) < 1e-3 * np.abs(now) + 1e-5):
            return
        before = now


def _when(rising: np.ndarray, level: float, values: np.ndarray):
    """Value at the first passage of a level, linear between samples; NaN where it is not reached."""
    above = np.flatnonzero(np.asarray(rising) >= level)
    if not above.size or above[0] == 0:
        return float('nan')
    k = above[0]
    share = (level - rising[k - 1]) / (rising[k] - rising[k - 1])
    return float(values[k - 1] + share * (values[k] - values[k - 1]))
