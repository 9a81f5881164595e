"""A manoeuvring model with its uncertainty, validity and provenance, and whether it stays within bounds."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.common.judgement import Judged
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel, jacobians
from swath_sysid.manoeuvring.hull.simulation import balance, states_under, steady_speed, substeps_for
from swath_sysid.manoeuvring.hull.terms import ADVANCE, DEDUCTION, XU_DOT, M, accelerations
from swath_sysid.manoeuvring.hull.thrust import acting_thrust
from swath_sysid.manoeuvring.motion.trial import STEP

LEVELS = 5  #: Speeds, and inputs of each thruster, that are checked.
DURATION = 60.0  #: s of free motion under held inputs.
EXCESS = 2.0  #: Motion beyond this multiple of its limit has diverged.


@dataclass(frozen=True)
class Region:
    """Range of motion and inputs in the runs."""

    slowest: float  #: m/s.
    fastest: float  #: m/s.
    largest_sway: float  #: m/s.
    largest_yaw_rate: float  #: rad/s.
    least_input: float  #: Of one thruster, N or command.
    most_input: float  #: Of one thruster, N or command.
    largest_difference: float  #: Starboard less port, N or command.


@dataclass(frozen=True)
class StabilityCheck:
    """Outcome of `check_stability`."""

    stable: bool  #: Straight courses are stable, and motion under held inputs stays bounded.
    bounded: bool  #: Motion under held inputs stays bounded, even if a course-unstable craft turns.
    largest_growth: float  #: Largest real part of the eigenvalues about straight courses, 1/s; negative decays.
    unstable_speed: float  #: Where the growth is not negative, m/s; NaN if nowhere.


def check_stability(model: ManoeuvringModel, region: Region) -> StabilityCheck:
    """Check small motions about every straight course, and free motion under every held input, within a region."""
    speeds = straight_speeds(region)
    growth = growth_rates(model.values[:, None], speeds)[:, 0]
    worst = int(np.argmax(growth))
    bounded = _largest_excess(model, region) < EXCESS
    decays = growth[worst] < 0.0
    return StabilityCheck(
        stable=bool(decays and bounded),
        bounded=bounded,
        largest_growth=float(growth[worst]),
        unstable_speed=float('nan') if decays else float(speeds[worst]),
    )


def straight_speeds(region: Region) -> np.ndarray:
    """Speeds ahead at which straight courses are checked, m/s, shape (5,)."""
    return np.linspace(max(0.0, region.slowest), max(region.fastest, 1e-3), LEVELS)


def growth_rates(p: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Largest real part, 1/s, (S, K), of the eigenvalues of sway and yaw about straight courses at speeds (S,), m/s, of
    craft (n, K); surge, which has no part in them, is always damped.
    """
    count, candidates = speeds.size, p.shape[1]
    columns = np.tile(p, count)
    u = np.repeat(speeds, candidates)
    nothing = np.zeros_like(u)
    resistance = -accelerations(u, nothing, nothing, nothing, nothing, columns)[0]
    slip = (1.0 - columns[DEDUCTION]) * np.maximum(1.0 - columns[ADVANCE] * u, 0.1)
    thrust = 0.5 * resistance * (columns[M] - columns[XU_DOT]) / slip
    jacobian = jacobians(columns, np.stack([u, nothing, nothing]), thrust, thrust)[:, 1:, 1:]
    usable = np.all(np.isfinite(jacobian), axis=(1, 2))
    jacobian[~usable] = np.eye(2)
    return np.linalg.eigvals(jacobian).real.max(axis=1).reshape(count, candidates)


def _largest_excess(model: ManoeuvringModel, region: Region):
    port, starboard = np.meshgrid(*2 * [np.linspace(region.least_input, region.most_input, LEVELS)])
    held = np.abs(starboard - port) <= region.largest_difference * (1.0 + 1e-9)
    inputs = zip(port[held], starboard[held], strict=True)
    thrust = np.array([acting_thrust(np.full(2, a), np.full(2, b), model.values, STEP)[:, -1] for a, b in inputs]).T
    speeds, sway, rate = (region.slowest, region.fastest), region.largest_sway, region.largest_yaw_rate
    starts = np.array([[u, v, r] for u in speeds for v, r in ((0.0, 0.0), (sway, rate), (sway, -rate))]).T
    state = np.repeat(starts, thrust.shape[1], axis=1)
    substeps = substeps_for(model, STEP, (region.fastest, 0.0, rate), np.max(np.abs(thrust)))
    held_for_long = np.tile(thrust[:, None], (1, int(DURATION / STEP), starts.shape[1]))
    states = states_under(model.values, state, held_for_long, STEP, substeps)
    share = np.max(np.abs(states), axis=(0, 2)) / _limits(model, region, thrust)
    return float(np.max(share)) if np.all(np.isfinite(share)) else float('inf')


def _limits(model: ManoeuvringModel, region: Region, thrust: np.ndarray):
    """Speed, sway and yaw rate that these inputs may drive: measured maxima, or the steady values of the hull."""
    ahead = steady_speed(model, float(np.max(thrust.sum(axis=0))))
    speed = max(abs(region.slowest), region.fastest, ahead, 0.1)
    seen = max(region.largest_yaw_rate, 0.05)
    # manoeuvres are shorter than this check: inputs held for long may rightly turn a craft faster than was seen
    half = 0.5 * float(np.max(np.abs(thrust[1] - thrust[0])))
    turning = balance(lambda r: model.accelerations(0.0, 0.0, r, -half, half)[2], 10.0)
    return np.array([speed, max(region.largest_sway, 0.7 * speed), float(np.clip(turning, seen, 2.0 * seen))])


@dataclass(frozen=True)
class ForecastNoise:
    """Uncertainties of forecasts, measured on the runs of the identification."""

    disturbance: np.ndarray  #: (3,); Standard deviations of the slow residual accelerations, m/s^2, m/s^2, rad/s^2.
    disturbance_time: np.ndarray  #: (3,); Their correlation times, s.
    thrust_mean: np.ndarray  #: (2,); Of port and starboard on those runs, N.
    thrust_covariance: np.ndarray  #: (2, 2); About that mean, N^2.
    thrust_time: float  #: Mean time for which thrusts are held, s.
    sensors: np.ndarray  #: (4,); Of speeds, yaw rate, heading, position; m/s, rad/s, rad, m.
    leads: np.ndarray = field(default_factory=lambda: np.array([1.0]))  #: (L,); s.
    #: (6, L); Factors on the standard deviations of surge, sway, yaw rate, heading, x and y, for calibrated intervals;
    #: linear between the leads and constant beyond them.
    scale: np.ndarray = field(default_factory=lambda: np.ones((6, 1)))


@dataclass(frozen=True)
class IdentifiedManoeuvringModel(Judged):
    """Content of a manoeuvring model file."""

    model: ManoeuvringModel
    names: tuple[str, ...]  #: Identified parameters, current included, in the order of the covariance.
    covariance: np.ndarray  #: (n, n)
    noise: np.ndarray  #: (3,); Residual standard deviation of surge, sway, m/s, and yaw rate, rad/s.
    region: Region  #: Range of motion and inputs in the runs.
    metrics: dict = field(default_factory=dict)
    provenance: dict = field(default_factory=dict)
    forecast: ForecastNoise | None = None  #: None: not measured; forecasts use `noise`.
