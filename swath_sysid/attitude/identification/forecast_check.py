"""Errors of a model that steps (the published objective), simulates and forecasts a measured free decay.

f is linear in the ratios, so F^2 is a quadratic form, triangularised once; its bounded minimum is a linear problem.
Under noise the minimum is biased, because the measured rate is on both sides: simulation is the default.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.simulation import STEPS_PER_PERIOD, runge_kutta_population, simulate
from swath_sysid.attitude.hull.terms import TERM_NAMES, term_moments
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.problem import FIRST_LOOK_PERIODS
from swath_sysid.attitude.motion.stamps import GAP_INTERVALS
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import running_integral


@dataclass(frozen=True)
class OneStepObjective:
    """F as a function of the ratios."""

    #: (10, 10); Triangular factor of the Gram matrix of the nine terms' steps and the measured step.
    triangle: np.ndarray
    samples: int  #: Number of steps.

    @classmethod
    def of(cls, motions: Sequence[AxisMotion], trims: Sequence[float], friction_rate: float) -> 'OneStepObjective':
        """The objective of records at their trims, rad; `InputError` with fewer than ten neighbouring samples."""
        steps = [_steps(motion, trim, friction_rate) for motion, trim in zip(motions, trims, strict=True)]
        samples = sum(len(s) for s in steps)
        if samples < len(TERM_NAMES) + 1:
            raise InputError('the one-step objective needs at least ten neighbouring samples: give a longer record')
        triangle = np.asarray(np.linalg.qr(np.concatenate([np.linalg.qr(s, mode='r') for s in steps]), mode='r'))
        return cls(triangle, samples)

    def __call__(self, ratios: np.ndarray):
        """F of candidates (P, 9), ratios to inertia: (P,), rad/s."""
        errors = ratios @ self.triangle[:, :-1].T + self.triangle[:, -1]
        return np.sqrt(np.einsum('pk,pk->p', errors, errors) / self.samples)

    def minimum(self, equation: Equation, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """The exact optimum (9,) within bounds (9,); ratios of terms not in the equation are zero."""
        from scipy.optimize import lsq_linear

        used = equation.indices
        columns = self.triangle[:, used]
        scale = np.linalg.norm(columns, axis=0)
        scale[scale == 0.0] = 1.0
        solved = lsq_linear(
            columns / scale, -self.triangle[:, -1], (lower[used] * scale, upper[used] * scale), method='bvls', tol=1e-15
        )
        return equation.complete(solved.x / scale)


def _steps(motion: AxisMotion, trim: float, friction_rate: float):
    """Rows of the nine terms' Euler steps (to be added, times their ratio) and the measured step."""
    angle, rate = with_angle_and_rate(motion)
    interval = np.diff(motion.time)
    terms = term_moments(angle[:-1] - trim, rate[:-1], friction_rate) * interval
    rows = np.column_stack([terms.T, np.diff(rate)])
    return rows[interval <= GAP_INTERVALS * np.median(interval)]


def with_angle_and_rate(motion: AxisMotion) -> tuple[np.ndarray, np.ndarray]:
    """Angle and rate (N,); a missing rate is the centred difference, a missing angle the rate's integral."""
    if motion.rate is None:
        return motion.primary, np.gradient(motion.primary, motion.time)
    if motion.angle is None:
        angle = running_integral(motion.primary, motion.time)
        return angle - angle[angle.size // 2 :].mean(), motion.primary
    return motion.angle, motion.rate


LEADS = (0.25, 0.5, 1.0)  #: Natural periods ahead.
MAX_STARTS = 200


@dataclass(frozen=True)
class NextStep:
    """The papers' check: the rate one sample ahead, from the measured state."""

    time: np.ndarray  #: (N - 1,); s.
    measured: np.ndarray  #: (N - 1,); rad/s.
    predicted: np.ndarray  #: (N - 1,); rad/s.

    @property
    def error(self) -> np.ndarray:
        """Predicted less measured, rad/s."""
        return self.predicted - self.measured


def next_step(model: DecayModel, motion: AxisMotion) -> NextStep:
    """One Euler step ahead along a record, at the model's trim: w'[k+1] = w[k] + dt f(psi[k], w[k])."""
    angle, rate = with_angle_and_rate(motion)
    predicted = rate[:-1] + np.diff(motion.time) * model.acceleration(angle[:-1], rate[:-1])
    return NextStep(motion.time[1:], rate[1:], predicted)


def simulation_error(model: DecayModel, state: InitialState, motion: AxisMotion) -> float:
    """Error of the simulated angle, or rate without an angle, over the standard deviation of the measured one.

    Model at the trim of the record; state at the first sample. Infinite where the motion diverges.
    """
    angle, rate = simulate(model, state.x + model.trim, state.rate, motion.time)
    return _relative((rate if motion.angle is None else angle) - motion.primary, motion.primary)


def forecast_errors(
    model: DecayModel, motion: AxisMotion, period: float, leads: Sequence[float] = LEADS
) -> tuple[float, ...]:
    """Error at each lead, in periods, of forecasts started along a record, over the motion's standard deviation.

    NaN where the record is too short for ten starts, infinite where the model diverges; the period is in s.
    """
    angle, rate, first = measured_states(motion, period)
    step = period / STEPS_PER_PERIOD
    starts = np.unique(np.linspace(first, motion.size - 1, MAX_STARTS).astype(int))
    with np.errstate(over='ignore', invalid='ignore'):
        angles, _, _ = runge_kutta_population(
            angle[starts] - model.trim,
            rate[starts],
            np.repeat(model.ratios[:, None], starts.size, axis=1),
            model.equation.active,
            model.friction_rate,
            step,
            round(max(leads) * STEPS_PER_PERIOD),
        )
    target = with_angle_and_rate(motion)[0]
    found = []
    for lead in leads:
        due = motion.time[starts] + lead * period
        inside = due <= motion.time[-1]
        if inside.sum() < 10:
            found.append(float('nan'))
            continue
        forecast = angles[round(lead * STEPS_PER_PERIOD), inside] + model.trim
        found.append(_relative(forecast - np.interp(due[inside], motion.time, target), target))
    return tuple(found)


def measured_states(motion: AxisMotion, period: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Angle and rate (N,) by a parabola through the past `FIRST_LOOK_PERIODS`, and the first sample with enough."""
    interval = motion.sample_interval
    window = int(FIRST_LOOK_PERIODS * period / interval)
    angle, rate = with_angle_and_rate(motion)
    if window < 5:
        return angle, rate, 0
    window = min(window, motion.size)
    # what the samples before weigh in the parabola's value and slope at the newest one (Savitzky and Golay 1964)
    value, slope, _ = np.linalg.pinv(np.vander(-interval * np.arange(window), 3, increasing=True))
    rate = np.convolve(angle, slope) if motion.rate is None else np.convolve(rate, value)
    return np.convolve(angle, value)[: motion.size], rate[: motion.size], window - 1


def _relative(error: np.ndarray, measured: np.ndarray):
    with np.errstate(over='ignore', invalid='ignore'):
        ratio = float(np.sqrt(np.mean(error**2)) / np.std(measured))
    return ratio if np.isfinite(ratio) else float('inf')
