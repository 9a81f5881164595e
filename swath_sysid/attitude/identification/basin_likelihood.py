"""Coefficients and their intervals in a basin that still moves: the likelihood of a filter's innovations.

Least squares takes what a residual wave does to the craft for the craft's own. Here the disturbance, a drift of trim,
the gyro's bias and the colour of the sensors' noise are part of the model (see `innovations`), their levels and spectra
fitted together with the hull's ratios (the filter-error method: Maine and Iliff 1981; Jategaonkar 2015, chapter 5).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, LINEAR_RESTORING, restoring_slope
from swath_sysid.attitude.identification.innovations import BlockedRecord, Hulls, innovations
from swath_sysid.attitude.identification.log_posterior import LINEAR_PRIOR, Evaluation, LogPosterior
from swath_sysid.attitude.identification.motion_fit import PERTURBATION, SEARCH_STEPS_PER_PERIOD, InitialState
from swath_sysid.attitude.identification.problem import Problem
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.conventions import CONFIDENCE
from swath_sysid.common.signals import MODEL_FLOOR, white_noise

BIAS_PRIOR = float(np.radians(2.0))  #: rad/s: an uncalibrated gyro's.
#: Name, mean and standard deviation of the logarithm of each of the basin's and the sensors' parameters.
BASIN_PRIORS = (
    ('level', np.log(3e-4), 3.0),  # of the restoring moment at the first amplitude: most basins are quiet
    ('frequency', 0.0, 0.4),  # of the hull's
    ('damping', np.log(0.15), 1.0),
    ('spread', np.log(0.15), 0.7),
    ('angle_white', 0.0, 1.0),  # of what third differences show
    ('rate_white', 0.0, 1.0),
    ('angle_colour', np.log(0.3), 1.5),  # of the white noise
    ('angle_memory', np.log(0.15), 1.0),  # of the period
    ('rate_colour', np.log(0.3), 1.5),
    ('rate_memory', np.log(0.1), 1.0),
    ('drift', np.log(5e-4), 1.0),  # of the first amplitude, in the square root of a period
)
#: Of the disturbance, as its prior: the first two from the first estimate, the last two from a linear hull as well.
STARTING_LEVELS = 0.003, 0.05, 0.3
UNLIKELY = 3.0  #: Logarithm of the probability below the largest from which an optimum is left out.
#: Steps from an optimum to disturbances over which the posterior is summed; the probability of the first is half as
#: unlikely, that of the second twice.
GRID = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if i * i + j * j <= 4]
FARTHEST = 7.0  #: Standard deviations of its prior beyond which no parameter of the basin is looked for.
LARGEST_SHAPE = 0.9  #: Damping and spread of the disturbance stay below this.
MIN_NOISE = 1e-4  #: Of the amplitude: white noise where third differences show none.
NORMAL = float(ndtri(0.5 * (1.0 + CONFIDENCE)))


def blocked(motion: AxisMotion, frequency: float) -> BlockedRecord:
    """Means of a motion over even blocks, a part of the period of ``frequency``, rad/s, long."""
    interval = motion.sample_interval
    samples = max(1, round(2.0 * np.pi / frequency / SEARCH_STEPS_PER_PERIOD / interval))
    step = samples * interval
    block = np.floor((motion.time - motion.time[0]) / step + 0.5 / samples).astype(int)
    count = np.bincount(block).astype(float)
    filled = count > 0.0
    middle = motion.time[0] + step * np.flatnonzero(filled) + 0.5 * (samples - 1) * interval
    late = np.bincount(block, motion.time)[filled] / count[filled] - middle
    means = [np.zeros(count.size), np.zeros(count.size)]
    for mean, values in zip(means, (motion.angle, motion.rate), strict=True):
        if values is not None:
            mean[filled] = np.bincount(block, values)[filled] / count[filled]
            # samples that come at uneven times are not centred on their block
            mean[filled] -= late * np.gradient(mean[filled], middle + late)
    measured = [motion.angle is not None, motion.rate is not None]
    counts = count[:, None] * np.array(measured, dtype=float)
    return BlockedRecord(step, (samples**2 - 1) * interval**2 / 24.0, means[0], means[1], counts)


@dataclass(frozen=True)
class BasinFit:
    """The optimum of the likelihood's posterior, and the spread of the whole about it."""

    ratios: np.ndarray  #: (9,)
    covariance: np.ndarray  #: (n, n); Of the ratios in use.
    basin: np.ndarray  #: (11,); See `innovations`.
    trim_std: float  #: rad; root mean square over the records.


class BasinLikelihood(LogPosterior):
    """Negative log posterior of an equation's dimensionless ratios and the basin's parameters on a problem's records.

    On their undisturbed motion; the first estimates of their states are the same for every equation that is compared.
    ``ratio_prior`` (n,) are the standard deviations of the dimensionless ratios before the record is seen.
    """

    def __init__(self, problem: Problem, equation: Equation, ratio_prior: np.ndarray | float = LINEAR_PRIOR) -> None:
        motions, scales = problem.observed, problem.scales
        self._records = [blocked(m, scales.frequency) for m in motions]
        self._active, self._terms, self._friction_rate = equation.active, equation.indices, problem.friction_rate
        self._ratio_units = scales.ratio_units[self._terms]
        amplitude, rate, w = scales.amplitude, scales.rate, scales.frequency
        angles, rates = (
            [v for v in each if v is not None] for each in zip(*((m.angle, m.rate) for m in motions), strict=True)
        )
        white = _white(angles, MIN_NOISE * amplitude), _white(rates, MIN_NOISE * rate)
        self._floor = MODEL_FLOOR * np.array([max(map(np.std, each), default=0.0) for each in (angles, rates)])
        period = 2.0 * np.pi / w
        self._basin_units = np.array(
            [w * rate, w, 1.0, 1.0, *white, white[0], period, white[1], period, amplitude / np.sqrt(period)]
        )
        self._state_units = np.array([amplitude, rate, amplitude])
        n, m = self._terms.size, len(self._records)
        expected = np.array([float(name in LINEAR_RESTORING) for name in equation.terms])
        _, means, stds = zip(*BASIN_PRIORS, strict=True)
        # states about the first estimates by the first amplitude: the same for every equation that is compared
        super().__init__(
            equation,
            np.concatenate([expected, means, self._first_states(problem.states)]),
            np.concatenate([np.broadcast_to(ratio_prior, n), stds, np.ones(3 * m)]),
            [name in DAMPING_NAMES for name in equation.terms],
        )
        self._shared = n + len(BASIN_PRIORS)
        self._disturbance = np.array([n, n + 1])  # level and frequency
        others = np.setdiff1d(np.arange(self.mean.size), self._disturbance)
        self._others = np.ix_(others, others)

    def start(self, ratios: np.ndarray, level: float, states: Sequence[InitialState] | None = None) -> np.ndarray:
        """Parameters (n + 11 + 3 M,) of given ratios (9,), the rest at its prior mean.

        ``level`` is that of the disturbance over its unit; ``states`` are those at the first sample of each record.
        The disturbance begins at the frequency of those ratios, where it does most: from elsewhere its motion is taken
        for coloured noise of the sensors.
        """
        n = self._terms.size
        z = self.mean.copy()
        z[:n] = ratios[self._terms] / self._ratio_units
        z[n] = np.log(level)
        stiffness = restoring_slope(0.0, ratios, self._active)
        if stiffness > 0.0:
            z[n + 1] = np.log(np.sqrt(stiffness) / self._basin_units[1])
        if states is not None:
            z[self._shared :] = self._first_states(states)
        return z

    def _first_states(self, states: Sequence[InitialState]):
        """States (3 M,) in the middle of each first block, dimensionless."""
        return np.concatenate(
            [
                np.array([s.x + 0.5 * r.step * s.rate, s.rate, s.trim]) / self._state_units
                for s, r in zip(states, self._records, strict=True)
            ]
        )

    def unpack(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ratios (9,), basin parameters (11,) and initial states (M, 3) of parameters, or of B of them."""
        n, shared = self._terms.size, self._shared
        ratios = self.equation.complete(z[..., :n] * self._ratio_units)
        mean, reach = self.mean[n:shared], FARTHEST * self._weight[n:shared] ** -0.5
        basin = np.exp(mean + reach * np.tanh((z[..., n:shared] - mean) / reach))
        shape = basin[..., 2:4]
        shape[...] = LARGEST_SHAPE * shape / (LARGEST_SHAPE + shape)
        states = z[..., shared:].reshape(*z.shape[:-1], -1, 3) * self._state_units
        return ratios, basin * self._basin_units, states

    def likelihoods(self, points: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """At points (P, p), all in one pass of the filter."""
        count, size = points.shape
        costs, gradients, informations = [0.0] * count, np.zeros((count, size)), np.zeros((count, size, size))
        shared = np.arange(self._shared)
        for index, record in enumerate(self._records):
            places = np.concatenate([shared, self._shared + 3 * index + np.arange(3)])
            moved = np.repeat(points[:, None], places.size + 1, axis=1)
            moved[:, 1 + np.arange(places.size), places] += PERTURBATION
            ratios, basin, states = self.unpack(moved.reshape(-1, size))
            hulls = Hulls(ratios.T, self._active, self._friction_rate)
            found = innovations(hulls, basin.T, states[:, index].T, BIAS_PRIOR, self._floor, record)
            for k, own in enumerate(np.split(found.reshape(2, -1, len(ratios)), count, axis=-1)):
                e, s = own[..., 0]
                slopes = (own[..., 1:] - own[..., :1]) / PERTURBATION
                by_e, by_s = slopes[0].T / np.sqrt(s), slopes[1].T / (np.sqrt(2.0) * s)
                costs[k] += 0.5 * float(np.sum(np.log(s) + e * e / s))
                gradients[k][places] += by_e @ (e / np.sqrt(s)) + by_s @ ((1.0 - e * e / s) / np.sqrt(2.0))
                informations[k][np.ix_(places, places)] += by_e @ by_e.T + by_s @ by_s.T
        return list(zip(costs, gradients, informations, strict=True))

    def is_upright(self, point: Evaluation) -> bool:
        """Whether the craft returns to its upright position."""
        return restoring_slope(0.0, self.unpack(point.z)[0], self._active) > 0.0

    def starts(self, ratios: np.ndarray, states: Sequence[InitialState]) -> list[np.ndarray]:
        """Parameters of given ratios (9,) and states, and of a linear hull, in quiet and in moving basins."""
        linear = self.mean[: self._terms.size].copy()
        if 'b1' in self.equation.terms:
            linear[self.equation.terms.index('b1')] = 1.0
        starts = [self.start(ratios, level, states) for level in STARTING_LEVELS[:2]]
        for level in STARTING_LEVELS[1:]:
            start = self.start(ratios, level, states)
            start[: linear.size], start[linear.size + 1] = linear, 0.0
            starts.append(start)
        return starts

    def described(self, optima: Sequence[Evaluation]) -> BasinFit:
        """The likeliest of some optima, which is the first, and the spread of the whole posterior about it.

        The posterior is skewed: where the basin moves much, its mean is of larger coefficients than are likely. It is a
        mixture over levels and frequencies of the disturbance: few records determine both, and what the ratios are
        and how well they are known changes with them, since a moment at resonance moves the craft as another stiffness
        would. For each pair the other parameters have the probability of a Gaussian of its height and covariance (Rue,
        Martino and Chopin 2009).
        """
        heights, nodes = zip(*self._over_disturbances(optima), strict=True)
        weights = np.exp(np.array(heights) - max(heights))
        weights /= weights.sum()
        points = np.array([each.z for each in nodes])
        best = optima[0].z
        covariance = (weights * (points - best).T) @ (points - best)
        others = self._others
        covariance[others] += sum(w * np.linalg.inv(e.information[others]) for w, e in zip(weights, nodes, strict=True))
        n, units = self._terms.size, self._ratio_units
        trim_std = float(np.sqrt(np.mean(np.diag(covariance)[self._shared + 2 :: 3]))) * self._state_units[2]
        ratios, basin, _ = self.unpack(best)
        return BasinFit(ratios, covariance[:n, :n] * np.outer(units, units), basin, trim_std)

    def _over_disturbances(self, optima: Sequence[Evaluation]):
        """Log probability, but for what all share, and optimum at disturbances about each likely optimum."""
        place = self._disturbance
        held = np.isin(np.arange(self.mean.size), place)
        heights = [_height(optimum, optimum.information) for optimum in optima]
        nodes: list[tuple[float, Evaluation]] = []
        for optimum in (o for height, o in zip(heights, optima, strict=True) if height > max(heights) - UNLIKELY):
            variances, axes = np.linalg.eigh(np.linalg.inv(optimum.information)[np.ix_(place, place)])
            points = np.tile(optimum.z, (len(GRID), 1))
            points[:, held] += np.array(GRID) @ (axes * np.sqrt(UNLIKELY * variances)).T
            found = self.search_each(list(points), [held] * len(points))
            others = [other for _, other in nodes]
            area = 0.5 * float(np.sum(np.log(variances)))
            nodes += [
                (area + _height(e, e.information[self._others]), e)
                for e in found
                if e.is_finite and not any(self._is_at(e, other) for other in others)
            ]
        return nodes or [(0.0, optima[0])]


def _height(optimum: Evaluation, information: np.ndarray) -> float:
    """Log probability of an optimum, the parameters of the information integrated, but for what all optima share."""
    return -optimum.cost - 0.5 * float(np.linalg.slogdet(information)[1])


def interval(value: float, std: float, bounded: bool) -> tuple[float, float]:
    """95 % of a Gaussian, or, where that reaches below a bound at zero, of what of it lies above: from zero up."""
    if bounded and value < NORMAL * std:
        return 0.0, float(value - std * ndtri((1.0 - CONFIDENCE) * ndtr(value / std)))
    return value - NORMAL * std, value + NORMAL * std


def _white(channels: Sequence[np.ndarray], least: float):
    return max(float(np.median([white_noise(c) for c in channels])) if channels else 0.0, least)
