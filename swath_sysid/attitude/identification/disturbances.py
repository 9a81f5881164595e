"""Names for what disturbs a decay: a wave that returns, a second oscillation, a stiffness that drifts.

The effect of each on the motion is linear in its size as long as it is small. What least squares leaves is compared
with these effects, less what the hull's terms and the starts take up of them. What they take up is by how much the
disturbance falsifies the hull.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import LOWER, UPPER
from swath_sysid.attitude.identification.fit_quality import unexplained_share
from swath_sysid.attitude.identification.hull_terms import WITH_FRICTION
from swath_sysid.attitude.identification.motion_fit import (
    SEARCH_STEPS_PER_PERIOD,
    STARTING_TOLERANCE,
    Noise,
)
from swath_sysid.attitude.identification.problem import Problem, block_means, motion_fit
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import CRITERION_MARGIN

#: Periods after which a wave is looked for that returns from a wall; what acts sooner is the fluid's memory.
RETURNS = 0.9, 6.0
#: Frequencies and dampings, over those of the hull and critical, of a second oscillation.
LINES, LINE_DAMPINGS = np.arange(0.5, 1.71, 0.02), (0.0, 0.02, 0.05, 0.1)


EXPLAINED = 0.6  #: Share of what is left and no white noise that a cause must explain: what remains may be another one.
FEWEST_PERIODS = 5.0  #: That show a rhythm beside that of the decay.
CODES = {'returning': 'returning-wave', 'second': 'second-oscillation', 'drifting': 'drifting-stiffness'}


@dataclass(frozen=True)
class Cause:
    """The disturbance of one kind that explains most of what a fit leaves."""

    kind: str
    share: float  #: Of what is left, squared, that it explains.
    place: float  #: Delay or period, s, or the time in which the stiffness drifts.
    columns: np.ndarray  #: (N, k); its effects.
    unit: float  #: Of the size in the columns: of the release, the damping or the stiffness.


def named(found: Identification) -> Identification:
    """The same fit with the disturbance that explains what it leaves, if one is certain to, and with an uncertainty that
    covers what this hides of the hull.
    """
    if found.objective == 'one-step' or not any(unexplained_share(found, name) for name in ('angle', 'rate')):
        return found
    with np.errstate(over='ignore', invalid='ignore'):
        left = Leftover(found)
    cause = left.told() if np.isfinite(left.residual).all() else None
    if cause is None:
        return found
    size, posterior = left.size_of(cause), found.posterior
    hidden = left.hidden_by(cause, found.model.equation)
    widened = replace(found, covariance=found.covariance + np.outer(hidden, hidden))
    if posterior is not None:
        away = left.hidden_by(cause, posterior.equation)
        posterior = replace(posterior, covariance=posterior.covariance + np.outer(away, away))
        widened = replace(widened, posterior=posterior)
    (*_, before), (_, damping, _, after) = (each.bands.at(found.reference_amplitude) for each in (found, widened))
    told = Advice.of(
        CODES[cause.kind],
        place=cause.place,
        periods=cause.place / left.period,
        size=size,
        hidden=np.sqrt(max(after**2 - before**2, 0.0)) / damping,
    )
    return replace(widened, disturbance=told)


class Leftover:
    """What the least-squares fit of every hull term leaves of the decays, each channel weighted by its own rms."""

    def __init__(self, found: Identification) -> None:
        self.period = 2.0 * np.pi / found.problem.scales.frequency
        thin = tuple(block_means(m, self.period, SEARCH_STEPS_PER_PERIOD) for m in found.problem.motions)
        self.problem = replace(found.problem, motions=thin)
        general = WITH_FRICTION if 'b0' in found.model.equation.terms else GENERAL_HULL
        fit = motion_fit(self.problem, general)
        parameters = fit.pack(found.model.ratios, found.states)
        limits = LOWER[general.indices], UPPER[general.indices]
        for _ in range(2):
            parameters, _ = fit.refine(parameters, *limits, STARTING_TOLERANCE)
            residuals, slopes = fit.residuals_and_jacobian(parameters)
            self.problem = replace(self.problem, noise=_rms_of(self.problem, residuals))
            fit = motion_fit(self.problem, general)
        residuals, slopes = fit.residuals_and_jacobian(parameters)
        self.slopes = np.concatenate(slopes)
        self.ratios, self.states = fit.unpack(parameters)
        self.model = replace(found.model, equation=general, ratios=self.ratios, trim=0.0)
        self.taken = _basis(self.slopes)
        self.residual = self.left(-np.concatenate(residuals))

    def left(self, effect: np.ndarray) -> np.ndarray:
        """What no hull term and no start takes up of an effect, (N,) or (N, K)."""
        return effect - self.taken @ (self.taken.T @ effect)

    def responses(self, moment: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> Iterator[np.ndarray]:
        """The weighted channels (N_k, K) of each record that moments (T, K) over inertia add, given time (T,), angle and
        rate on a grid of `SEARCH_STEPS_PER_PERIOD`.
        """
        step, scales = self.period / SEARCH_STEPS_PER_PERIOD, self.problem.scales
        for motion, state in zip(self.problem.motions, self.states, strict=True):
            time = np.arange(0.0, motion.duration + step, step)
            angle, rate = simulate(self.model, state.x, state.rate, time)
            stiffness, damping = (
                (self.model.acceleration(angle - dx, rate - dw) - self.model.acceleration(angle + dx, rate + dw)) / width
                for dx, dw, width in (
                    (1e-4 * scales.amplitude, 0.0, 2e-4 * scales.amplitude),
                    (0.0, 1e-4 * scales.rate, 2e-4 * scales.rate),
                )
            )
            added = _linear_response(stiffness, damping, step, moment(time, angle, rate))
            places = (motion.time - motion.time[0]) / step
            yield self.weighted(motion, *(_at(places, each) for each in added))

    def weighted(self, motion: AxisMotion, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Angle and rate (N, K), as far as they were measured, as the residuals have them."""
        noise = self.problem.noise
        angles = [] if motion.angle is None else [angle / noise.angle]
        bias = rate.mean(axis=0) if motion.angle is None else 0.0
        rates = [] if motion.rate is None else [(rate - bias) / noise.rate]
        return np.concatenate(angles + rates)


    def told(self) -> Cause | None:
        """The cause that explains most of what is left, if neither chance nor another kind explains as much."""
        *others, best = sorted(self.causes(), key=lambda each: each.share)
        if best.kind not in CODES or self.longest < FEWEST_PERIODS * self.period:
            return None
        rest = self.residual - _projected(self.left(best.columns), self.residual)
        # as many as a process of first order has
        alike = float(rest[1:] @ rest[:-1] / (rest @ rest))
        independent = max(2.0, rest.size * (1.0 - alike) / (1.0 + alike))
        smooth = float(self.residual[1:] @ self.residual[:-1] / (self.residual @ self.residual))
        # Bayesian information criterion; without a cause nothing is explained
        explained = [(0.0, 0), *((each.share, each.columns.shape[1]) for each in (others[-1], best))]
        *criteria, least = (independent * np.log(1.0 - share) + k * np.log(independent) for share, k in explained)
        certain = min(criteria) - least > CRITERION_MARGIN
        return best if certain and best.share > EXPLAINED * smooth else None

    def size_of(self, cause: Cause) -> float:
        """Of the effects of a cause: over those in its columns."""
        sizes = np.linalg.lstsq(self.left(cause.columns), self.residual, rcond=None)[0]
        return float(np.linalg.norm(sizes)) / cause.unit

    def hidden_by(self, cause: Cause, equation: Equation) -> np.ndarray:
        """By how much a cause moves the ratios (n,) of an equation that are fitted without it."""
        places = [self.model.equation.terms.index(name) for name in equation.terms]
        states = range(len(self.model.equation.terms), self.slopes.shape[1])
        slopes = self.slopes[:, [*places, *states]]
        known = np.linalg.norm(slopes, axis=0) > 0.0
        sizes = np.linalg.lstsq(self.left(cause.columns), self.residual, rcond=None)[0]
        moved = np.zeros(known.size)
        moved[known] = np.linalg.lstsq(slopes[:, known], cause.columns @ sizes, rcond=None)[0]
        return moved[: len(places)] * self.problem.scales.ratio_units[equation.indices]

    def causes(self) -> list[Cause]:
        """The best of each kind, those that have no name included."""
        return [self._returning(), self._second_line(), self._drifting(), self._shaped()]

    @property
    def frequency(self) -> float:
        """By which the motion is scaled, rad/s."""
        return self.problem.scales.frequency

    @property
    def longest(self) -> float:
        """Duration of the longest decay, s."""
        return max(motion.duration for motion in self.problem.motions)

    def _best(self, kind: str, groups: Sequence[np.ndarray], places: Sequence[float], unit: float = 1.0) -> Cause:
        """Of effects (N, k), that which explains most."""
        total = float(self.residual @ self.residual)
        shares = []
        for columns in groups:
            shares.append(float(self.residual @ _projected(self.left(columns), self.residual)) / total)
        best = int(np.argmax(shares))
        return Cause(kind, shares[best], float(places[best]), groups[best], unit)

    def _returning(self) -> Cause:
        """A moment that follows the rate with a delay: the hull's own wave."""
        latest = min(RETURNS[1], 0.8 * self.longest / self.period)
        delays = np.arange(int(RETURNS[0] * SEARCH_STEPS_PER_PERIOD), max(latest, 1.0) * SEARCH_STEPS_PER_PERIOD).astype(int)

        def moment(time: np.ndarray, _: np.ndarray, rate: np.ndarray):
            past = np.arange(time.size)[:, None] - delays
            return np.where(past < 0, 0.0, rate[np.maximum(past, 0)])

        effects = np.concatenate(list(self.responses(moment)))
        places = delays * self.period / SEARCH_STEPS_PER_PERIOD
        return self._best('returning', list(effects.T[:, :, None]), places, self._damping)

    @property
    def _damping(self) -> float:
        """Mean damping moment over inertia in a decay, over the rate, rad/s."""
        rate = self.problem.scales.rate * np.linspace(0.1, 1.0, 10)
        return float(np.mean(self.model.acceleration(0.0, -rate) / rate))

    def _second_line(self) -> Cause:
        """An oscillation of its own in each decay, which another mode couples into the motion."""
        speeds = np.array([ratio * (1j - damping) for ratio in LINES for damping in LINE_DAMPINGS]) * self.frequency
        sizes = [sum(getattr(m, name) is not None for name in ('angle', 'rate')) * m.size for m in self.problem.motions]
        ends = np.cumsum(sizes)
        effects = np.zeros((ends[-1], speeds.size, 2 * len(sizes)))
        for place, (motion, size, end) in enumerate(zip(self.problem.motions, sizes, ends, strict=True)):
            line = np.exp(speeds * (motion.time - motion.time[0])[:, None])
            for part, turned in enumerate((line, 1j * line)):
                rows = self.weighted(motion, turned.real, (speeds * turned).real)
                effects[end - size : end, :, 2 * place + part] = rows
        release = self.problem.scales.amplitude
        return self._best('second', list(effects.transpose(1, 0, 2)), 2.0 * np.pi / speeds.imag, release)

    def _drifting(self) -> Cause:
        """A stiffness that changes with time: of the whole by the end of the longest decay."""
        stiffness = self.frequency**2 / self.longest
        effects = self.responses(lambda time, angle, _: -stiffness * (time * angle)[:, None])
        return self._best('drifting', [np.concatenate(list(effects))], [self.longest])

    def _shaped(self) -> Cause:
        """Restoring and damping of another shape than the hull's terms."""
        near = 0.2 * self.problem.scales.amplitude

        def moment(_: np.ndarray, angle: np.ndarray, rate: np.ndarray):
            shapes = np.abs(angle) * angle, angle**5, np.maximum(rate, 0.0) ** 2, np.abs(rate) * angle
            return np.column_stack([*(each / np.abs(each).max() for each in shapes), np.clip(angle, -near, near) / near])

        return self._best('shaped', [np.concatenate(list(self.responses(moment)))], [0.0])


def _at(places: np.ndarray, values: np.ndarray) -> np.ndarray:
    before = np.clip(places.astype(int), 0, len(values) - 2)
    after = (places - before)[:, None]
    return (1.0 - after) * values[before] + after * values[before + 1]


def _linear_response(stiffness: np.ndarray, damping: np.ndarray, step: float, moment: np.ndarray):
    """Angle and rate (T, K) from rest of x'' + c x' + k x = d, c and k (T,), d (T, K), by the midpoint rule, whose
    stiffness is raised so that a free oscillation keeps its frequency.
    """
    k, c, d = (0.5 * (each[1:] + each[:-1]) for each in (stiffness, damping, moment))
    phase = 0.5 * step * np.sqrt(np.maximum(k, 1e-12))
    k = k * (np.tan(phase) / phase) ** 2
    d = d * (np.tan(phase) / phase)[:, None] ** 2
    kept, pull = 1.0 - 0.5 * step * c - 0.25 * step**2 * k, step * k
    scale = 1.0 / (1.0 + 0.5 * step * c + 0.25 * step**2 * k)
    angle, rate = np.zeros_like(moment), np.zeros_like(moment)
    for at in range(len(k)):
        rate[at + 1] = (kept[at] * rate[at] + step * d[at] - pull[at] * angle[at]) * scale[at]
        angle[at + 1] = angle[at] + 0.5 * step * (rate[at] + rate[at + 1])
    return angle, rate


def _rms_of(problem: Problem, residuals: Sequence[np.ndarray]) -> Noise:
    """The noise that gives the residuals of either quantity, which are weighted by the problem's, an rms of one."""
    names = [name for m in problem.motions for name in ('angle', 'rate') if getattr(m, name) is not None]
    found = {}
    for name in ('angle', 'rate'):
        own = [each for each, of in zip(residuals, names, strict=True) if of == name] or [np.ones(1)]
        rms = float(np.sqrt(np.mean(np.concatenate(own) ** 2)))
        found[name] = getattr(problem.noise, name) * max(rms, 1e-9)
    return Noise(**found)


def _projected(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The part of values (N,) that columns (N, k) explain."""
    basis = _basis(columns)
    return basis @ (basis.T @ values)


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span those given, scaled; those that others span or that vanish have none."""
    size = np.linalg.norm(columns, axis=0)
    left, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]
