"""Names for what disturbs a decay: a wave that returns, a second oscillation, a stiffness that drifts.

The effect of each on the motion is linear in its size as long as it is small. What least squares leaves is compared
with these effects, less what the hull's terms and the starts take up of them. What they take up is by how much the
disturbance falsifies the hull.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL, composed
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import LOWER, TERMS, UPPER
from swath_sysid.attitude.identification.fit_quality import unexplained_share
from swath_sysid.attitude.identification.motion_fit import (
    PERTURBATION,
    SEARCH_STEPS_PER_PERIOD,
    STARTING_TOLERANCE,
    Noise,
)
from swath_sysid.attitude.identification.problem import block_means, motion_fit
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import CRITERION_MARGIN
from swath_sysid.common.conventions import NEGLIGIBLE as ABSORBED

#: Code of each cause that has a name, and the share of what is left and no white noise that it must explain: the rest
#: may be another one. Waves and the fluid's memory often resemble a second oscillation, seldom a wave that returns.
CODES = {
    'returning': ('returning-wave', 0.6),
    'second': ('second-oscillation', 0.8),
    'drifting': ('drifting-stiffness', 0.8),
}
#: Periods after which a wave is looked for that returns from a wall; what acts sooner is the fluid's memory.
RETURNS = 0.9, 6.0
#: Frequencies and dampings, over those of the hull and critical, of a second oscillation.
LINES, LINE_DAMPINGS = np.arange(0.5, 1.71, 0.02), (0.0, 0.02, 0.05, 0.1)
OWN = 0.1  #: Share of the hull's frequency within which restoring of another shape or fluid memory looks like one.
FEWEST_PERIODS = 5.0  #: That show a rhythm beside that of the decay.
Moment = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def named(found: Identification) -> Identification:
    """The same fit with the disturbance that explains what it leaves, if one is certain to. The uncertainty then covers
    what this hides of the hull.
    """
    if found.objective == 'one-step' or not any(unexplained_share(found, name) for name in ('angle', 'rate')):
        return found
    with np.errstate(over='ignore', invalid='ignore'):
        left = Leftover(found)
    cause = left.told() if left.is_finite else None
    if cause is None:
        return found
    posterior = found.posterior
    if posterior is not None:
        posterior = replace(posterior, covariance=posterior.covariance + left.hidden_by(cause, posterior.equation))
    hidden = left.hidden_by(cause, found.model.equation)
    widened = replace(found, covariance=found.covariance + hidden, posterior=posterior)
    (*_, before), (_, damping, _, after) = (each.bands.at(found.reference_amplitude) for each in (found, widened))
    share = np.sqrt(max(after**2 - before**2, 0.0)) / damping
    size = float(np.linalg.norm(left.sizes_of(cause))) / cause.unit
    told = Advice.of(
        CODES[cause.kind][0], place=cause.place, periods=cause.place / left.period, size=size, hidden=share
    )
    return replace(widened, disturbance=told)


@dataclass(frozen=True)
class Cause:
    """The disturbance of one kind that explains most of what a fit leaves."""

    kind: str
    share: float  #: Of what is left, squared, that it explains.
    place: float  #: Delay or period, s, or the time in which the stiffness drifts.
    effects: np.ndarray  #: (N, k)
    unit: float  #: Of the size of the effects: the release, the damping, or one.


class Leftover:
    """What the least-squares fit of every hull term leaves of the decays, each channel weighted by its own rms."""

    def __init__(self, found: Identification) -> None:
        self._scales = found.problem.scales
        self.period = 2.0 * np.pi / self._scales.frequency
        self._step = self.period / SEARCH_STEPS_PER_PERIOD
        self._motions = tuple(block_means(m, self.period, SEARCH_STEPS_PER_PERIOD) for m in found.problem.motions)
        self._longest = max(motion.duration for motion in self._motions)
        equations = [found.model.equation, *([found.posterior.equation] if found.posterior else [])]
        terms = {*GENERAL_HULL.terms, *(name for equation in equations for name in equation.terms)}
        general = composed([name for name in TERMS if name in terms])
        limits = LOWER[general.indices], UPPER[general.indices]
        problem = replace(found.problem, motions=self._motions)
        parameters = motion_fit(problem, general).pack(found.model.ratios, found.states)
        for _ in range(2):
            fit = motion_fit(problem, general)
            parameters, _ = fit.refine(parameters, *limits, STARTING_TOLERANCE)
            self._noise = self._rms_of(problem.noise, fit.residuals_and_jacobian(parameters)[0])
            problem = replace(problem, noise=self._noise)
        fit = motion_fit(problem, general)
        residuals, slopes = fit.residuals_and_jacobian(parameters)
        ratios, self._states = fit.unpack(parameters)
        self._model = replace(found.model, equation=general, ratios=ratios, trim=0.0)
        self._slopes, every = np.concatenate(slopes), np.concatenate(residuals)
        self.is_finite = bool(np.isfinite(every).all() and np.isfinite(self._slopes).all())
        if self.is_finite:
            self._taken = _basis(self._slopes)
            self._residual = self._left(-every)

    def told(self) -> Cause | None:
        """The cause that explains most of what is left, if neither chance nor another kind explains as much."""
        *others, best = sorted(self.causes(), key=lambda each: each.share)
        if best.kind not in CODES or self._longest < FEWEST_PERIODS * self.period:
            return None
        rest = self._residual - self._explained(best.effects)
        # as many as a process of first order has
        alike = _likeness(rest)
        independent = max(2.0, rest.size * (1.0 - alike) / (1.0 + alike))
        # Bayesian information criterion; without a cause nothing is explained
        explained = [(0.0, 0), *((each.share, each.effects.shape[1]) for each in (others[-1], best))]
        *criteria, least = (independent * np.log(1.0 - share) + k * np.log(independent) for share, k in explained)
        is_certain = min(criteria) - least > CRITERION_MARGIN
        is_whole = best.share > CODES[best.kind][1] * _likeness(self._residual)
        return best if is_certain and is_whole else None

    def causes(self) -> list[Cause]:
        """The best of each kind, those that have no name included."""
        return [self._returning(), self._second_line(), self._drifting(), self._shaped()]

    def sizes_of(self, cause: Cause) -> np.ndarray:
        """Sizes (k,) of the effects of a cause."""
        return np.linalg.lstsq(self._left(cause.effects), self._residual, rcond=None)[0]

    def hidden_by(self, cause: Cause, equation: Equation) -> np.ndarray:
        """What is added to the covariance (n, n) of an equation's ratios, which a cause moves if it is left out."""
        places = [self._model.equation.terms.index(name) for name in equation.terms]
        slopes = np.column_stack([self._slopes[:, places], self._slopes[:, len(self._model.equation.terms) :]])
        # of parameters without effect, zero
        moved = np.linalg.lstsq(slopes, cause.effects @ self.sizes_of(cause), rcond=None)[0][: len(places)]
        ratios = moved * self._scales.ratio_units[equation.indices]
        return np.outer(ratios, ratios)

    def _left(self, effects: np.ndarray) -> np.ndarray:
        """What no hull term and no start takes up of effects, (N,) or (N, k)."""
        return effects - self._taken @ (self._taken.T @ effects)

    def _explained(self, effects: np.ndarray) -> np.ndarray:
        """The part of what is left that effects (N, k) explain, without those that the hull takes up nearly whole."""
        left = self._left(effects)
        basis = _basis(left[:, np.linalg.norm(left, axis=0) > ABSORBED * np.linalg.norm(effects, axis=0)])
        return basis @ (basis.T @ self._residual)

    def _best(self, kind: str, groups: Sequence[np.ndarray], places: np.ndarray, unit: float = 1.0) -> Cause:
        """Of effects (N, k) each, that which explains most."""
        shares = [float(self._residual @ self._explained(effects)) for effects in groups]
        best = int(np.argmax(shares))
        share = shares[best] / float(self._residual @ self._residual)
        return Cause(kind, min(share, 1.0 - PERTURBATION), float(places[best]), groups[best], unit)

    def _returning(self) -> Cause:
        """A moment that follows the rate with a delay, over that of the mean damping: the hull's own wave."""
        soonest, latest = RETURNS[0], max(1.0, min(RETURNS[1], 0.8 * self._longest / self.period))
        delays = np.arange(int(soonest * SEARCH_STEPS_PER_PERIOD), int(latest * SEARCH_STEPS_PER_PERIOD))

        def moment(time: np.ndarray, _: np.ndarray, rate: np.ndarray):
            past = np.arange(time.size)[:, None] - delays
            return np.where(past < 0, 0.0, rate[np.maximum(past, 0)])

        rate = self._scales.rate * np.linspace(0.1, 1.0, 10)
        damping = float(np.mean(self._model.acceleration(0.0, -rate) / rate))
        return self._best('returning', list(self._responses(moment).T[:, :, None]), delays * self._step, damping)

    def _second_line(self) -> Cause:
        """An oscillation of its own in each decay, which another mode couples into the motion, over the release."""
        speeds = np.array([ratio * (1j - damping) for ratio in LINES for damping in LINE_DAMPINGS])
        speeds = speeds * self._scales.frequency
        effects, end = np.zeros((self._residual.size, speeds.size, 2 * len(self._motions))), 0
        for place, motion in enumerate(self._motions):
            line = np.exp(speeds * (motion.time - motion.time[0])[:, None])
            for part, turned in enumerate((line, 1j * line)):
                rows = self._weighted(motion, turned.real, (speeds * turned).real)
                effects[end : end + len(rows), :, 2 * place + part] = rows
            end += len(rows)
        periods = 2.0 * np.pi / speeds.imag
        found = self._best('second', list(effects.transpose(1, 0, 2)), periods, self._scales.amplitude)
        return replace(found, kind='own') if abs(self.period / found.place - 1.0) < OWN else found

    def _drifting(self) -> Cause:
        """A stiffness that changes with time: of the whole by the end of the longest decay."""
        pace = self._scales.frequency**2 / self._longest
        effects = self._responses(lambda time, angle, _: -pace * (time * angle)[:, None])
        return self._best('drifting', [effects], np.array([self._longest]))

    def _shaped(self) -> Cause:
        """Restoring and damping of another shape than the hull's terms."""
        near = 0.2 * self._scales.amplitude

        def moment(_: np.ndarray, angle: np.ndarray, rate: np.ndarray):
            kinked = np.clip(angle, -near, near)
            shapes = np.abs(angle) * angle, angle**5, np.maximum(rate, 0.0) ** 2, np.abs(rate) * angle, kinked
            return np.column_stack([each / np.abs(each).max() for each in shapes])

        return self._best('shaped', [self._responses(moment)], np.zeros(1))

    def _responses(self, moment: Moment) -> np.ndarray:
        """What moments (T, k) over inertia add to the weighted channels, (N, k), given time (T,), angle and rate."""
        return np.concatenate(list(self._responses_each(moment)))

    def _responses_each(self, moment: Moment) -> Iterator[np.ndarray]:
        scales, small = self._scales, 1e-4
        for motion, state in zip(self._motions, self._states, strict=True):
            time = np.arange(0.0, motion.duration + self._step, self._step)
            angle, rate = simulate(self._model, state.x, state.rate, time)

            def slope(dx: float, dw: float, angle: np.ndarray = angle, rate: np.ndarray = rate):
                lower, upper = (self._model.acceleration(angle + way * dx, rate + way * dw) for way in (-1.0, 1.0))
                return 0.5 * (lower - upper) / (dx + dw)

            slopes = slope(small * scales.amplitude, 0.0), slope(0.0, small * scales.rate)
            added = linear_response(*slopes, self._step, moment(time, angle, rate))
            places = (motion.time - motion.time[0]) / self._step
            before = np.minimum(places.astype(int), time.size - 2)
            later = (places - before)[:, None]
            yield self._weighted(motion, *((1.0 - later) * each[before] + later * each[before + 1] for each in added))

    def _weighted(self, motion: AxisMotion, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Angle and rate (N, k), as far as they were measured, as the residuals have them."""
        bias = rate.mean(axis=0) if motion.angle is None else 0.0
        angles = [] if motion.angle is None else [angle / self._noise.angle]
        return np.concatenate(angles + ([] if motion.rate is None else [(rate - bias) / self._noise.rate]))

    def _rms_of(self, noise: Noise, residuals: Sequence[np.ndarray]) -> Noise:
        """The noise by which residuals, weighted by another one, have an rms of one in either quantity."""
        names = [name for m in self._motions for name in ('angle', 'rate') if getattr(m, name) is not None]
        found = {}
        for name in ('angle', 'rate'):
            own = [each for each, of in zip(residuals, names, strict=True) if of == name] or [np.ones(1)]
            found[name] = getattr(noise, name) * max(float(np.sqrt(np.mean(np.concatenate(own) ** 2))), PERTURBATION)
        return Noise(**found)


def linear_response(
    stiffness: np.ndarray, damping: np.ndarray, step: float, moment: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angle and rate (T, k), from rest, of x'' + c x' + k x = d, each (T,) but d (T, k), by the midpoint rule.
    Stiffness and moment are raised so that a free oscillation keeps its frequency.
    """
    k, c, d = (0.5 * (each[1:] + each[:-1]) for each in (stiffness, damping, moment))
    phase = 0.5 * step * np.sqrt(np.maximum(k, PERTURBATION / step**2))
    raised = (np.tan(phase) / phase) ** 2
    pull, push = step * raised * k, step * raised[:, None] * d
    scale = 1.0 / (1.0 + 0.5 * step * (c + 0.5 * pull))
    kept = (1.0 - 0.5 * step * (c + 0.5 * pull)) * scale
    angle, rate = np.zeros_like(moment), np.zeros_like(moment)
    for at in range(k.size):
        rate[at + 1] = kept[at] * rate[at] + (push[at] - pull[at] * angle[at]) * scale[at]
        angle[at + 1] = angle[at] + 0.5 * step * (rate[at] + rate[at + 1])
    return angle, rate


def _likeness(residual: np.ndarray) -> float:
    """Correlation of neighbouring residuals."""
    return float(residual[1:] @ residual[:-1] / (residual @ residual))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal columns that span those given; those that vanish, or that others span, have none."""
    size = np.linalg.norm(columns, axis=0)
    if not size.any():
        return np.empty((len(columns), 0))
    left, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return left[:, singular > PERTURBATION * singular[0]]
