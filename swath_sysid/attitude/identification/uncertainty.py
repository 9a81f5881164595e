"""Uncertainty of a fit: terms that a record cannot separate, and the expected error of the next release."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.amplitude import AmplitudeCurves, amplitude_curves
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.hull.scaling import Scales
from swath_sysid.attitude.hull.simulation import longest_step, runge_kutta_population
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, RESTORING_NAMES, TERM_NAMES, damping_moment
from swath_sysid.attitude.identification.motion_fit import PERTURBATION
from swath_sysid.common.covariance import NOT_SEPARABLE, correlation

UPPER_PART = 0.9  #: Share of the draws whose error is smaller than the stated error.
DRAWS = 100  #: Hulls of the posterior that are simulated, of ten times as many that are drawn.
RATES = 30  #: At which the sign of each hull's damping is checked.
RELEASE_PERIODS = 4.0  #: Length of the next release.


def known_together(terms: Sequence[str], covariance: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Groups of damping or of restoring terms that the covariance (n, n) of their ratios does not separate."""
    linked = np.abs(correlation(covariance)) > NOT_SEPARABLE
    groups: list[tuple[str, ...]] = []
    for names in (DAMPING_NAMES, RESTORING_NAMES):
        places = [k for k, name in enumerate(terms) if name in names]
        together = [terms[k] for k in places if linked[k, places].sum() > 1]
        groups += [tuple(together)] if together else []
    return tuple(groups)


@dataclass(frozen=True)
class AmplitudeBands:
    """Natural frequency and equivalent damping over the amplitudes seen, with standard deviations."""

    curves: AmplitudeCurves
    frequency_std: np.ndarray  #: (A,)
    damping_ratio_std: np.ndarray  #: (A,)

    def quantities_at(self, amplitude: float) -> list[tuple[float, ...]]:
        """Frequency and damping ratio at an amplitude, rad: value, std, slope of its logarithm by the amplitude's."""
        size, found = self.curves.amplitude, []
        columns = (self.curves.frequency, self.frequency_std), (self.curves.damping_ratio, self.damping_ratio_std)
        for values, std in columns:
            slope = np.gradient(np.log(np.maximum(values, 1e-300)), np.log(size))
            found.append(tuple(float(np.interp(amplitude, size, each)) for each in (values, std, slope)))
        return found

    def at(self, amplitude: float) -> tuple[float, float, float, float]:
        """Natural period, s, damping ratio, and the standard deviation of each, at an amplitude, rad."""
        (frequency, frequency_std, _), (damping, damping_std, _) = self.quantities_at(amplitude)
        period = 2.0 * np.pi / frequency
        return period, damping, period * frequency_std / frequency, damping_std


def amplitude_bands(
    model: DecayModel, covariance: np.ndarray, amplitude: np.ndarray, posterior: HullPosterior | None = None
) -> AmplitudeBands:
    """Curves against amplitude (A,), rad, with standard deviations by the covariance (n, n) of the model's ratios.

    Those of a pruned hull come from the posterior of every term, about which its own curves are off by what was pruned.
    """

    def curves_of(ratios: np.ndarray):
        found = amplitude_curves(ratios, amplitude, model.friction_rate)
        return found, np.array([found.frequency, found.damping_ratio])

    curves, own = curves_of(model.ratios)
    known = posterior or HullPosterior(model.equation, model.ratios[model.equation.indices], covariance)
    complete = np.zeros(len(TERM_NAMES))
    complete[known.equation.indices] = known.ratios
    slopes = []
    for index, spread in zip(known.equation.indices, np.sqrt(np.diag(known.covariance)), strict=True):
        step = np.zeros(complete.size)
        step[index] = PERTURBATION * max(abs(complete[index]), spread) or PERTURBATION
        slopes.append((curves_of(complete + step)[1] - curves_of(complete - step)[1]) / (2 * step[index]))
    variance = np.einsum('ika,ij,jka->ka', slopes, known.covariance, slopes)
    return AmplitudeBands(curves, *np.hypot(np.sqrt(np.maximum(variance, 0.0)), curves_of(complete)[1] - own))


def release_error(model: DecayModel, posterior: HullPosterior, trim_std: float, start: float, scales: Scales) -> float:
    """Error of the next release, from ``start``, rad from trim, that posterior and trim leave, a share of its motion.

    `UPPER_PART` of hulls drawn from the posterior, without those of negative damping, are nearer to the model. A NaN
    ``trim_std``, rad, is ignored. Infinite where most hulls do not return, or the posterior is not finite.
    """
    _, motion = drawn_releases(model, posterior, trim_std, start, scales)
    if motion.shape[1] < 2:
        return float('inf')
    with np.errstate(over='ignore', invalid='ignore'):
        error = np.sqrt(np.mean((motion[:, :-1] - motion[:, -1:]) ** 2, axis=0) / np.mean(motion[:, -1] ** 2))
    return float(np.quantile(np.where(np.isfinite(error), error, np.inf), UPPER_PART, method='higher'))


def drawn_releases(
    model: DecayModel, posterior: HullPosterior, trim_std: float, start: float, scales: Scales
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,), s, and angles (T, up to `DRAWS` + 1), rad from trim, of the next release; the model's last.

    The others are of hulls drawn from the posterior; arguments as of `release_error`.
    """
    active = tuple(a or b for a, b in zip(posterior.equation.active, model.equation.active, strict=True))
    hulls, trim = _drawn(posterior, active, model.friction_rate, scales.rate)
    trim = np.append(np.nan_to_num(trim_std) * trim[: hulls.shape[1]], 0.0)
    step = longest_step(model, start)
    steps = int(np.ceil(RELEASE_PERIODS * 2.0 * np.pi / scales.frequency / step))
    with np.errstate(over='ignore', invalid='ignore'):
        angles, _, _ = runge_kutta_population(
            start - trim,
            np.zeros(trim.size),
            np.column_stack([hulls, model.ratios]),
            active,
            model.friction_rate,
            step,
            steps,
        )
    return step * np.arange(len(angles)), angles + trim


def _drawn(posterior: HullPosterior, active: Sequence[bool], friction_rate: float, largest_rate: float):
    """Ratios (9, up to `DRAWS`) of a posterior, and as many standard normal values for the trim."""
    rng = np.random.default_rng(0)
    if not np.isfinite(posterior.covariance).all():
        return np.empty((len(TERM_NAMES), 0)), np.empty(0)
    # the covariance may be singular, and is badly scaled
    std = np.sqrt(np.diag(posterior.covariance))
    values, vectors = np.linalg.eigh(correlation(posterior.covariance))
    normal = rng.normal(size=(std.size, 10 * DRAWS))
    hulls = np.zeros((len(TERM_NAMES), normal.shape[1]))
    hulls[posterior.equation.indices] = posterior.ratios[:, None] + std[:, None] * (
        (vectors * np.sqrt(np.maximum(values, 0.0))) @ normal
    )
    rates = np.linspace(0.0, largest_rate, RATES)[1:, None]
    taken = damping_moment(rates, hulls[:, None, :], active, friction_rate)
    return hulls[:, (taken >= 0.0).all(axis=0)][:, :DRAWS], rng.normal(size=DRAWS)
