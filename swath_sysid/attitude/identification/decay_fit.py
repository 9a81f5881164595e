"""A decay model beside the measured motion that it was fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.identification.hull_terms import AbsentTerm
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice


@dataclass(frozen=True)
class RecordFit:
    """Measured and simulated motion of one record."""

    motion: AxisMotion  #: The free decay.
    segment: DecaySegment
    state: InitialState
    angle: np.ndarray  #: (N,); Simulated, rad.
    rate: np.ndarray  #: (N,); Simulated, rad/s.

    @property
    def residual(self) -> np.ndarray:
        """Measured less simulated: of the angle, or of the rate where no angle was measured, less the gyro's bias."""
        left = self.motion.primary - (self.rate if self.motion.angle is None else self.angle)
        return left - left.mean() if self.motion.angle is None else left


@dataclass(frozen=True, kw_only=True)
class DecayFit:
    """A model, its uncertainty, and the problem that it solves."""

    model: DecayModel
    covariance: np.ndarray  #: (n, n); Of the ratios of the model's terms, in their order.
    trim_std: float  #: rad; NaN where no angle was measured.
    states: tuple[InitialState, ...]  #: Of each record.
    problem: Problem
    absent_term: AbsentTerm | None = None  #: That the equation lacks and the motion shows most.
    posterior: HullPosterior | None = None  #: Of every term, those pruned included; None where the equation was named.
    disturbance: Advice | None = None  #: That explains what the fit leaves, if one is certain to.

    @cached_property
    def records(self) -> tuple[RecordFit, ...]:
        """Measured and simulated motion of each record."""
        fit = motion_fit(self.problem, self.model.equation)
        simulated = fit.simulated(fit.pack(self.model.ratios, self.states))
        measured = zip(self.problem.motions, self.problem.segments, self.states, simulated, strict=True)
        return tuple(RecordFit(motion, segment, state, *motions) for motion, segment, state, motions in measured)

    @cached_property
    def amplitude_range(self) -> tuple[float, float]:
        """Smallest and largest amplitude seen, rad: where the model is valid. Without measured angles the largest is
        that of the fitted motion.
        """
        smallest, largest = self.problem.amplitudes_seen
        if self.problem.motions[0].angle is None:
            largest = max(float(np.abs(r.angle - r.state.trim).max()) for r in self.records)
        return min(smallest, 0.9 * largest), largest

    @property
    def r2(self) -> float:
        """Share of the variance of the measured motion that the simulated one explains, of each about its own mean."""
        error = sum(float(np.sum(r.residual**2)) for r in self.records)
        return 1.0 - error / sum(float(np.sum((r.motion.primary - r.motion.primary.mean()) ** 2)) for r in self.records)

    @property
    def rmse(self) -> float | None:
        """Of the angle, rad; None where not measured."""
        return _rms([r.motion.angle - r.angle for r in self.records if r.motion.angle is not None])

    @property
    def rate_rmse(self) -> float | None:
        """Of the rate, rad/s; None where not measured."""
        return _rms([r.motion.rate - r.rate for r in self.records if r.motion.rate is not None])


def _rms(parts: Sequence[np.ndarray]):
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else None
