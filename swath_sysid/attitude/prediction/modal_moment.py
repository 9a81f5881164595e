"""A stationary exciting moment as a linear state space in real modal form, exact over any interval.

dz/dt = A z + w, moment = h z, E[z z'] = Pi, with w white noise and A block diagonal: [[s, v], [-v, s]] (poles
s +- i v) or diag(s1, s2). Over an interval t the transition is F(t) = exp(A t), the noise Q(t) = Pi - F(t) Pi F(t)'.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Self

import numpy as np
from scipy.linalg import block_diag, eig, expm, solve_continuous_lyapunov

SLOWEST_DECAY = 1e-4  #: 1/s; least decay of a pole, so that the stationary covariance exists.

#: 1/s; decay of a discrete pole at zero or on the negative real axis.
FASTEST_DECAY = 200.0

WORST_CONDITION = 300.0  #: Of the modal coordinates; nearly coinciding poles are perturbed.


@dataclass(frozen=True)
class ModalMoment:
    """A moment in modal form; n = 2 B states."""

    #: (B, 3); two decay rates, 1/s (negative; equal for complex poles), and frequency, rad/s (zero for real poles).
    blocks: np.ndarray
    output: np.ndarray  #: (n,); From the state to the moment over inertia, rad/s^2.
    stationary: np.ndarray  #: (n, n); Covariance of the state.

    @property
    def size(self) -> int:
        """Number of states."""
        return self.output.size

    @cached_property
    def variance(self) -> float:
        """Of the moment, rad^2/s^4."""
        return float(self.output @ self.stationary @ self.output)

    @property
    def generator(self) -> np.ndarray:
        """The matrix A, shape (n, n)."""
        return block_diag(*[[[first, v], [-v, second]] for first, second, v in self.blocks])

    @classmethod
    def from_discrete(cls, transition: np.ndarray, output: np.ndarray, stationary: np.ndarray, step: float) -> Self:
        """Continuous modal form of a stable discrete state space over a step, s.

        Transition (n, n), output (n,) to the moment over inertia, rad/s^2, and stationary covariance (n, n).
        """
        values, vectors = _separate_poles(transition)
        # a negative real number has no real continuous counterpart: what alternates from step to step is forgotten
        values = np.where((np.abs(values.imag) < 1e-9) & (values.real <= 0.0), np.exp(-FASTEST_DECAY * step), values)
        poles = np.log(values) / step
        decay = np.clip(poles.real, -FASTEST_DECAY, -SLOWEST_DECAY)
        real = np.flatnonzero(np.abs(poles.imag) < 1e-9)
        pairs = np.flatnonzero(poles.imag >= 1e-9)
        columns = [part for k in pairs for part in (vectors[:, k].real, vectors[:, k].imag)]
        columns += [vectors[:, k].real for k in real]
        blocks = [(decay[k], decay[k], poles[k].imag) for k in pairs]
        real_decays = list(decay[real])
        if len(real_decays) % 2:
            real_decays.append(-FASTEST_DECAY)
        blocks += [(*two, 0.0) for two in zip(real_decays[::2], real_decays[1::2], strict=True)]
        # modal coordinates are known up to a scale: that of unit variance
        to_modal = np.linalg.inv(np.array(columns).T)
        spread = to_modal @ stationary @ to_modal.T
        scale = np.sqrt(np.maximum(np.diag(spread), 1e-300))
        scale[: 2 * pairs.size] = np.repeat(np.hypot(*scale[: 2 * pairs.size].reshape(-1, 2).T), 2)
        new_output, covariance = np.array(columns) @ output * scale, spread / np.outer(scale, scale)
        if len(real) % 2:
            new_output, covariance = np.append(new_output, 0.0), block_diag(covariance, 1.0)
        found = cls(np.array(blocks), new_output, covariance)
        return found._realisable(float(output @ stationary @ output))

    def _realisable(self, variance: float):
        """Make -(A Pi + Pi A') positive semidefinite with the variance kept, so that white noise can drive it."""
        generator = self.generator
        drive = -(generator @ self.stationary + self.stationary @ generator.T)
        values, vectors = np.linalg.eigh(0.5 * (drive + drive.T))
        drive = vectors * np.maximum(values, 1e-12 * values.max()) @ vectors.T
        stationary = solve_continuous_lyapunov(generator, -drive)
        stationary = 0.5 * (stationary + stationary.T)
        made = self.output @ stationary @ self.output
        return ModalMoment(self.blocks, self.output, stationary * (variance / made if made > 0.0 else 1.0))


def _separate_poles(matrix: np.ndarray):
    """Eigenvalues and eigenvectors; coinciding ones are nudged apart until the eigenvectors are a basis."""
    nudge, size = 0.0, np.abs(matrix).max()
    ramp = np.diag(np.linspace(-1.0, 1.0, matrix.shape[0]))
    for _ in range(12):
        values, vectors = eig(matrix + nudge * size * ramp)
        if np.linalg.cond(vectors) < WORST_CONDITION:
            break
        nudge = max(1e-9, 10.0 * nudge)
    return values, vectors


@cache
def markov_moment(variance: float, time: float) -> ModalMoment:
    """A second-order Markov moment of variance, rad^2/s^4, and time, s, one over the corner frequency.

    White noise through a second-order low-pass, slightly less than critically damped.
    """
    corner = 1.0 / time
    generator = np.array([[0.0, 1.0], [-corner * corner, -1.8 * corner]])
    stationary = variance * np.diag([1.0, corner * corner])
    return ModalMoment.from_discrete(expm(generator * time), np.array([1.0, 0.0]), stationary, time)


def sum_of_moments(moments: Sequence[ModalMoment], levels: Sequence[float] | np.ndarray) -> ModalMoment:
    """The sum of independent moments, each with its variance scaled."""
    return ModalMoment(
        np.concatenate([m.blocks for m in moments]),
        np.concatenate([m.output for m in moments]),
        block_diag(*[level * m.stationary for m, level in zip(moments, levels, strict=True)]),
    )
