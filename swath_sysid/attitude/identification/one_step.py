"""The published objective: the rms error of the rate one Euler step ahead, w'[k+1] = w[k] + dt f(psi[k], w[k]).

f is linear in the ratios, so F^2 is a quadratic form, triangularised once; its bounded minimum is a linear problem.
Under noise the minimum is biased, because the measured rate is on both sides: simulation is the default.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import TERM_NAMES, term_moments
from swath_sysid.attitude.motion.stamps import GAP_INTERVALS
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.errors import InputError


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
        ratios = np.zeros(len(TERM_NAMES))
        ratios[used] = solved.x / scale
        return ratios


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
        from scipy.integrate import cumulative_trapezoid

        angle = cumulative_trapezoid(motion.primary, motion.time, initial=0.0)
        return angle - angle[angle.size // 2 :].mean(), motion.primary
    return motion.angle, motion.rate
