"""Whittle's (1953) likelihood of one linear hull in the waves of a record whose parts have excitations of their own.

The spectrum of the angle in a part is

    S(w) = exp(level + waves(w) + deviation(w)) / ((1 - (w / w0)^2)^2 + (2 zeta w / w0)^2) + noise.

The waves are a JONSWAP spectrum (Hasselmann et al. 1973) with a free tail, or the measured vertical acceleration times
a power of frequency. The deviation is a Gaussian process in log frequency, of which half the variance is common to the
parts; its standard deviation, the roughness, is averaged over. The evidence of each natural frequency w0 is Laplace's
approximation about the optimum of all other parameters: what the waves may have done widens the posterior of the hull.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.special import logsumexp

from swath_sysid.attitude.identification.log_posterior import NEAR
from swath_sysid.attitude.identification.sea_motion import SeaPart
from swath_sysid.common.cancelling import Progress, stop_if
from swath_sysid.common.conventions import NEGLIGIBLE

#: Standard deviations of the log of the excitation about the spectrum of its waves, each as likely as the others.
ROUGHNESS = (0.05, 0.2, 0.5, 1.0)
SMOOTH_OVER = 0.2  #: Correlation length of the deviation in log frequency.

GRID_STEP = 0.05  #: Of log natural frequency; divided by three in each refinement.
REFINEMENTS = 2
#: Of a search from each start, of which the best goes on; before them as many by least squares of logarithms, which
#: converge from anywhere.
FIRST_STEPS = 5
CONVERGED = 0.02  #: Decrease of the cost.


@dataclass(frozen=True)
class SeaHullPrior:
    """Means and standard deviations before the record is seen."""

    log_damping: float = float(np.log(0.12))
    log_damping_std: float = 1.0
    log_frequency: float = 0.0  #: Of the natural frequency, rad/s.
    log_frequency_std: float = np.inf


@dataclass(frozen=True)
class Waves:
    """A family of wave spectra: parameters with their means, standard deviations and those of their change between
    parts, and where a search begins: peak frequency over that of the motion, and damping ratio.
    """

    name: str
    mean: tuple[float, ...]
    std: tuple[float, ...]
    change: tuple[float, ...]
    starts: tuple[tuple[float, float], ...]


#: Log peak frequency over that of the motion, log of the peakedness, tail (1: wave slope in deep water), log
#: of the floor over the peak: what a nonlinear hull adds to the excitation.
JONSWAP = Waves(
    'jonswap',
    (0.0, 0.8, 3.0, -8.0),
    (0.5, 0.6, 1.5, 2.0),
    (0.15, 0.25, 0.7, 0.5),
    ((0.5, 0.1), (0.7, 0.1), (0.85, 0.1), (1.05, 0.1), (1.05, 0.4), (1.4, 0.1)),
)
#: Power of the frequency, log of the floor over the largest.
HEAVE = Waves('heave', (0.0, -8.0), (1.0, 2.0), (0.3, 0.5), ((1.0, 0.1), (1.0, 0.4)))


def jonswap_shape(frequency: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log of JONSWAP at frequency (B,), rad/s, one at its peak but for the peakedness, and its derivatives by the
    parameters of `JONSWAP` but the floor, (P, B) and (P, B, 3), at P shapes (P, 3).
    """
    peak, log_peakedness, tail = shape.T[:, :, None]
    log_u = np.log(frequency) - peak
    u = np.exp(np.clip(log_u, -5.0, 5.0))
    width = np.where(u <= 1.0, 0.07, 0.09)
    bump = np.exp(-0.5 * ((u - 1.0) / width) ** 2)
    # below there is no wave: what moves the craft there is left to the deviation
    flank = np.maximum(u, 0.4) ** -4.0
    value = log_peakedness * (bump - 1.0) - tail * log_u - 1.25 * (flank - 1.0)
    slope = -log_peakedness * bump * (u - 1.0) / width**2 * u - tail + 5.0 * flank * (u > 0.4)
    return value, np.stack([-slope, bump - 1.0, np.broadcast_to(-log_u, bump.shape)], axis=-1)


def log_response(part: SeaPart, frequency: np.ndarray, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log of the mean of |H|^2 over the lines of each band and its derivative by log damping, each (P, B), of hulls of
    natural frequencies, rad/s, and damping ratios (P,).
    """
    squared = (part.lines / frequency[:, None]) ** 2
    damped = 4.0 * damping[:, None] ** 2 * squared
    response = 1.0 / ((1.0 - squared) ** 2 + damped)
    total = np.add.reduceat(response, part.first_lines, axis=1)
    slope = np.add.reduceat(-2.0 * damped * response**2, part.first_lines, axis=1)
    counts = np.diff(np.append(part.first_lines, part.lines.size))
    return np.log(total / counts), slope / total


@dataclass(frozen=True)
class Optima:
    """The optimum at each of P natural frequencies for each of R roughnesses."""

    log_evidence: np.ndarray  #: (R, P)
    z: np.ndarray  #: (R, P, q); parameters, log damping first.
    variance: np.ndarray  #: (R, P); of log damping.

    @property
    def damping(self) -> np.ndarray:
        """Log damping, (R, P)."""
        return self.z[..., 0]


class SeaLikelihood:
    """The likelihood of one record. Parameters (q,): log damping ratio at the reference rate, its power of the rms
    rate, level of each part, shape of the waves, its change in each part, coefficients of the deviation.
    """

    def __init__(
        self,
        parts: Sequence[SeaPart],
        reference_rate: float,
        prior: SeaHullPrior,
        should_cancel: Callable[[], bool] | None = None,
    ) -> None:
        self.parts, self._should_cancel = tuple(parts), should_cancel
        self.waves = JONSWAP if any(part.heave is None for part in parts) else HEAVE
        self._frequency, self._spectrum, self._noise = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ('frequency', 'spectrum', 'noise')
        )
        #: Independent values in each band; the measured waves are as scattered as the motion.
        self._counts = np.concatenate([part.counts for part in parts]) / (1.0 if self.waves is JONSWAP else 2.0)
        of_part = np.repeat(np.arange(len(parts)), [part.frequency.size for part in parts])
        self._is_in = (of_part[:, None] == np.arange(len(parts))).astype(float)
        self._log_rates = np.log([part.rate / reference_rate for part in parts])
        self._peak = float(np.mean([np.log(part.frequency[part.spectrum.argmax()]) for part in parts]))
        distance = np.subtract.outer(np.log(self._frequency), np.log(self._frequency)) / SMOOTH_OVER
        alike = 0.5 + 0.5 * (of_part[:, None] == of_part)
        values, vectors = np.linalg.eigh(np.exp(-0.5 * distance**2) * alike)
        kept = values > NEGLIGIBLE
        self._basis = vectors[:, kept] * np.sqrt(values[kept])
        self._set_prior(prior)

    def _set_prior(self, prior: SeaHullPrior) -> None:
        waves, count = self.waves, len(self.parts)
        size, self._level = len(waves.mean), slice(2, 2 + count)
        self._shape = slice(2 + count, 2 + count + size)
        changes = size * count if count > 1 else 0
        self._change = slice(self._shape.stop, self._shape.stop + changes)
        self._deviation = slice(self._change.stop, self._change.stop + self._basis.shape[1])
        mean, std = np.zeros(self._deviation.stop), np.ones(self._deviation.stop)
        # quadratic damping alone would have the power one, linear damping zero
        mean[:2], std[:2] = (prior.log_damping, 0.5), (prior.log_damping_std, 0.3)
        std[self._level] = np.inf
        mean[self._shape], std[self._shape] = waves.mean, waves.std
        if waves is JONSWAP:
            mean[self._shape.start] += self._peak
        std[self._change] = waves.change * (count if changes else 0)
        self._mean, self._weight = mean, std**-2.0

    def _model(self, log_frequency: np.ndarray, z: np.ndarray, roughness: float) -> tuple[np.ndarray, np.ndarray]:
        """Log of the spectrum without its noise, (P, B), and its derivatives (P, B, q)."""
        found, slopes = np.zeros((len(z), self._frequency.size)), np.zeros((len(z), *self._frequency.shape, z.shape[1]))
        end, size = 0, len(self.waves.mean)
        for place, part in enumerate(self.parts):
            bands = slice(end, end + part.frequency.size)
            end = bands.stop
            damping = np.exp(np.clip(z[:, 0] + z[:, 1] * self._log_rates[place], -7.0, 2.0))
            response, by_damping = log_response(part, np.exp(log_frequency), damping)
            change = slice(self._change.start + size * place, self._change.start + size * (place + 1))
            shape = z[:, self._shape] + (z[:, change] if len(self.parts) > 1 else 0.0)
            if self.waves is JONSWAP or part.heave is None:
                waves, by_waves = jonswap_shape(part.frequency, shape[:, :-1])
            else:
                log_u = np.log(part.frequency) - self._peak
                waves = np.log(part.heave / part.heave.max()) + shape[:, :1] * log_u
                by_waves = np.broadcast_to(log_u[:, None], (*waves.shape, 1))
            value = np.logaddexp(waves, shape[:, -1:])
            share = np.exp(waves - value)[..., None]
            by_shape = np.concatenate([share * by_waves, 1.0 - share], axis=-1)
            found[:, bands] = response + value
            slopes[:, bands, 0], slopes[:, bands, 1] = by_damping, by_damping * self._log_rates[place]
            slopes[:, bands, self._shape] = by_shape
            if len(self.parts) > 1:
                slopes[:, bands, change] = by_shape
        slopes[:, :, self._level], slopes[:, :, self._deviation] = self._is_in, roughness * self._basis
        found += z[:, self._level] @ self._is_in.T + z[:, self._deviation] @ (roughness * self._basis).T
        return np.clip(found, -200.0, 60.0), slopes

    def _evaluate(self, log_frequency: np.ndarray, z: np.ndarray, roughness: float):
        """Cost (P,), gradient (P, q) and information (P, q, q)."""
        found, slopes = self._model(log_frequency, z, roughness)
        own = np.exp(found)
        total = own + self._noise
        ratio, away = self._spectrum / total, z - self._mean
        cost = (ratio - np.log(ratio) - 1.0) @ self._counts + 0.5 * away**2 @ self._weight
        root = np.sqrt(self._counts)
        slopes *= (own / total * root)[:, :, None]
        gradient = self._weight * away + np.einsum('pb,pbi->pi', root * (1.0 - ratio), slopes)
        return cost, gradient, slopes.transpose(0, 2, 1) @ slopes + np.diag(self._weight)

    def start(self, log_frequency: np.ndarray, peak: float, damping: float, roughness: float) -> np.ndarray:
        """Parameters (P, q) from which a search may begin, after some steps by least squares of logarithms."""
        z = np.tile(self._mean, (log_frequency.size, 1))
        z[:, 0] = np.log(damping)
        if self.waves is JONSWAP:
            z[:, self._shape.start] = self._peak + np.log(peak)
        measured = np.log(np.maximum(self._spectrum - self._noise, 0.2 * self._spectrum))
        weight = self._counts * np.sqrt(self._spectrum)
        missing = (measured - self._model(log_frequency, z, roughness)[0]) * weight
        z[:, self._level] = missing @ self._is_in / (weight @ self._is_in)
        for _ in range(FIRST_STEPS):
            found, slopes = self._model(log_frequency, z, roughness)
            weighted = slopes * self._counts[:, None]
            information = weighted.transpose(0, 2, 1) @ slopes + np.diag(self._weight + 1e-3)
            gradient = self._weight * (z - self._mean) - np.einsum('pb,pbi->pi', measured - found, weighted)
            z = z - np.clip(np.linalg.solve(information, gradient[..., None])[..., 0], -0.7, 0.7)
        return z

    def _minimise(self, log_frequency: np.ndarray, z: np.ndarray, roughness: float, steps: float = np.inf):
        """Log evidence (P,), optimum (P, q) and variance of log damping (P,), by scoring with Levenberg's damping."""
        cost, gradient, information = self._evaluate(log_frequency, z, roughness)
        damping, diagonal = np.full(cost.size, 0.03), np.arange(z.shape[1])
        for step in count(1):
            stop_if(self._should_cancel)
            damped = information.copy()
            damped[:, diagonal, diagonal] *= 1.0 + damping[:, None]
            trial = z - np.linalg.solve(damped, gradient[..., None])[..., 0]
            tried = self._evaluate(log_frequency, trial, roughness)
            better = tried[0] < cost
            gained = np.where(better, cost - tried[0], 0.0).max()
            z = np.where(better[:, None], trial, z)
            cost, gradient = np.where(better, tried[0], cost), np.where(better[:, None], tried[1], gradient)
            information = np.where(better[:, None, None], tried[2], information)
            damping = np.where(better, damping / 5.0, damping * 6.0)
            if step >= steps or gained < CONVERGED:
                break
        volume = 0.5 * np.sum(np.log(self._weight[self._weight > 0.0])) - 0.5 * np.linalg.slogdet(information)[1]
        return volume - cost, z, np.linalg.inv(information)[:, 0, 0]

    def _begin(self, log_frequency: np.ndarray, roughness: float) -> np.ndarray:
        """The most likely parameters (P, q) that a few steps from each of `Waves.starts` lead to."""
        starts = [self.start(log_frequency, *each, roughness) for each in self.waves.starts]
        tried = [self._minimise(log_frequency, each, roughness, FIRST_STEPS) for each in starts]
        best = np.argmax([each[0] for each in tried], axis=0)
        return np.array([each[1] for each in tried])[best, np.arange(log_frequency.size)]

    def optima(self, log_frequency: np.ndarray, begin: np.ndarray | None = None) -> Optima:
        """At natural frequencies (P,), begun from parameters (R, P, q) or from `Waves.starts`."""
        found: list[tuple[np.ndarray, ...]] = []
        for place, roughness in enumerate(ROUGHNESS):
            if begin is not None:
                z = begin[place]
            else:
                # what led to the best optima of one roughness leads to those of the next
                z = found[-1][1] if found else self._begin(log_frequency, roughness)
            found.append(self._minimise(log_frequency, z, roughness))
        return Optima(*map(np.array, zip(*found, strict=True)))

    def fitted(self, log_frequency: float, z: np.ndarray, roughness: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each part the fitted spectrum of the angle (B,) and the squared response of the hull (B,)."""
        at, ends = np.array([log_frequency]), np.cumsum([part.frequency.size for part in self.parts])[:-1]
        total = np.exp(self._model(at, z[None], roughness)[0][0]) + self._noise
        damping = np.exp(z[0] + z[1] * self._log_rates)
        responses = [
            np.exp(log_response(part, np.exp(at), damping[k : k + 1])[0][0]) for k, part in enumerate(self.parts)
        ]
        return list(zip(np.split(total, ends), responses, strict=True))


@dataclass(frozen=True)
class FrequencyPosterior:
    """The posterior of log natural frequency and log damping ratio on a grid of P frequencies."""

    log_frequency: np.ndarray  #: (P,); rad/s.
    weight: np.ndarray  #: (P,); sums to one.
    damping: np.ndarray  #: (P,); mean of the log of the damping ratio at each frequency.
    variance: np.ndarray  #: (P,); of that.
    roughness: np.ndarray  #: (R,); weights of `ROUGHNESS` in the record where the roughest counts most.
    optima: tuple[Optima, ...]  #: Of each record.

    @property
    def is_smooth(self) -> bool:
        """Whether the excitation is smoother than any hull's peak."""
        return bool(self.roughness[-1] < 0.5)

    @property
    def mean(self) -> np.ndarray:
        """Of log frequency and log damping, (2,)."""
        return np.array([self.weight @ self.log_frequency, self.weight @ self.damping])

    @property
    def covariance(self) -> np.ndarray:
        """Of log frequency and log damping, (2, 2)."""
        away = np.array([self.log_frequency, self.damping]) - self.mean[:, None]
        return (self.weight * away) @ away.T + np.diag([0.0, self.weight @ self.variance])


def hull_posterior(
    records: Sequence[SeaLikelihood], prior: SeaHullPrior, low: float, high: float, progress: Progress
) -> FrequencyPosterior:
    """The hull that several records share, of a natural frequency between two, rad/s."""
    grid = np.arange(np.log(low), np.log(high), GRID_STEP)
    share, found = np.zeros(grid.size), [record.optima(grid) for record in records]
    for level in range(1, REFINEMENTS + 1):
        progress(level / (REFINEMENTS + 1))
        log_posterior = _joint(found, prior, grid)[0]
        near = np.flatnonzero((log_posterior > log_posterior.max() - NEAR) & (share == level - 1))
        step = GRID_STEP / 3**level
        begin = [np.repeat(each.z[:, near], 2, axis=1) for each in found]
        added = (grid[near][:, None] + np.array([-step, step])).ravel()
        finer = [record.optima(added, z) for record, z in zip(records, begin, strict=True)]
        found = [_appended(*pair) for pair in zip(found, finer, strict=True)]
        share[near] = level
        grid, share = np.append(grid, added), np.append(share, np.full(added.size, level))
    log_posterior, damping, variance = _joint(found, prior, grid)
    weight = np.exp(log_posterior - share * np.log(3.0) - log_posterior.max())
    weight /= weight.sum()
    shares = [np.exp(each.log_evidence - logsumexp(each.log_evidence, axis=0)) @ weight for each in found]
    return FrequencyPosterior(grid, weight, damping, variance, max(shares, key=lambda each: each[-1]), tuple(found))


def _appended(one: Optima, other: Optima) -> Optima:
    names = 'log_evidence', 'z', 'variance'
    return Optima(*(np.concatenate([getattr(one, name), getattr(other, name)], axis=1) for name in names))


def _joint(found: Sequence[Optima], prior: SeaHullPrior, log_frequency: np.ndarray):
    """Log posterior of records together, mean and variance of log damping, each (P,): the product of what each record
    says of the damping, in which the prior counts once.
    """
    again = len(found) - 1
    precision = np.full(log_frequency.size, -again / prior.log_damping_std**2)
    pull = precision * prior.log_damping
    total = -0.5 * pull * prior.log_damping + again * np.log(prior.log_damping_std)
    for each in found:
        weight = np.exp(each.log_evidence - logsumexp(each.log_evidence, axis=0))
        mean = np.sum(weight * each.damping, axis=0)
        variance = np.sum(weight * (each.variance + (each.damping - mean) ** 2), axis=0)
        precision, pull = precision + 1.0 / variance, pull + mean / variance
        total = total + logsumexp(each.log_evidence, axis=0) - 0.5 * (mean**2 / variance + np.log(variance))
    total = total + 0.5 * (pull**2 / precision - np.log(precision))
    away = (log_frequency - prior.log_frequency) / prior.log_frequency_std
    return total - 0.5 * away**2, pull / precision, 1.0 / precision
