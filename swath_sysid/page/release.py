"""The last measured free decay, and a model's motion from the same release."""

from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.window import FinishedDecay
from swath_sysid.common.errors import InputError


@dataclass(frozen=True, eq=False)
class Release:
    """A free decay as detected in the motion window."""

    motion: AxisMotion  #: From the release to the end; time as stamps, s.
    period: float  #: s.
    cycles: float
    amplitude: float  #: First, rad.
    trim: float  #: rad.

    @property
    def peaks(self) -> Peaks:
        """The turning points, the first at the release."""
        found = measured_peaks(self.motion, self.period)
        start, angle = self.motion.time[:1], np.asarray(self.motion.angle)[:1]
        return Peaks(np.concatenate([start, found.time]), np.concatenate([angle, found.angle]))

    def simulated(self, model: DecayModel) -> np.ndarray:
        """Angles of a model at the samples, rad, shape (N,), from the best-fitting initial state and trim."""
        from scipy.optimize import least_squares

        time, angle = self.motion.time, np.asarray(self.motion.angle)

        def motion(state: np.ndarray) -> np.ndarray:
            start, rate, trim = state.tolist()
            return simulate(model.with_trim(trim), start, rate, time)[0]

        def misses(state: np.ndarray) -> np.ndarray:
            # a motion that runs away is as wrong as a capsized craft
            return np.clip(np.nan_to_num(motion(state) - angle, nan=np.pi), -np.pi, np.pi)

        scale = np.array([self.amplitude, 2.0 * np.pi / self.period * self.amplitude, self.amplitude])
        start = np.array([float(angle[0]), 0.0, self.trim])
        return motion(least_squares(misses, start, x_scale=scale).x)


def release_of(finished: FinishedDecay) -> Release | None:
    """The decay in its window; None where no angle was measured."""
    trial, segment = finished.table.trial(), finished.segment
    try:
        motion = trial.axis(finished.axis).between(segment.start, segment.end)
    except InputError:
        return None
    if motion.angle is None:
        return None
    stamped = replace(motion, time=motion.time + float(finished.table.rows[0, 0]))
    return Release(stamped, segment.period, segment.cycles, segment.initial_amplitude, segment.trim)
