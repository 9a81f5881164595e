"""Natural period and equivalent linear damping from motion in waves, by Whittle's (1953) likelihood of hull and sea.

The moment over inertia d = w' + b1 w + b2 |w| w + r1 x + r2 x^2 + r3 x^3 must have the spectrum of a sea plus a floor:
that of the vertical acceleration times a power of frequency, or JONSWAP (Hasselmann et al. 1973) with a free tail.

The result is the linear hull at amplitude sqrt(2) std: one record does not show how damping depends on amplitude.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel, amplitude_curves
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import AT, TERM_NAMES
from swath_sysid.attitude.identification.log_posterior import Evaluation, LogPosterior
from swath_sysid.attitude.identification.motion_fit import PERTURBATION
from swath_sysid.attitude.identification.sea_motion import (
    GAUSSIAN_RATE,
    Heave,
    SeaMotion,
    heave_spectrum,
    sea_motion,
    term_spectra,
)
from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import Progress, ShouldCancel, stop_if
from swath_sysid.common.conventions import UNCERTAIN
from swath_sysid.common.errors import InputError

#: Parameters of hull and level, with mean and standard deviation before the record is seen; those of the sea's shape
#: follow. Frequency over that of the spectrum's peak; nonlinear terms as parts of the linear one.
HULL_PRIORS = {
    'log frequency': (0.0, 1.0),
    'log damping': (np.log(0.15), 1.2),
    'quadratic damping': (0.0, 0.5),
    'quadratic restoring': (0.0, 0.3),
    'cubic restoring': (0.0, 0.1),
    'log level': (0.0, inf),
}
_FREQUENCY, _DAMPING, _QUADRATIC, _EVEN, _CUBIC, _LEVEL = range(len(HULL_PRIORS))
_NONLINEAR = slice(_QUADRATIC, _LEVEL)

#: Of the sea's shape, the log of the floor over its peak last. JONSWAP: log peak frequency over that of the spectrum,
#: log of its peakedness less one (with less than its mean, 3.3, a hull near resonance takes part of the sea's peak for
#: its own), tail; the measured heave: power of the frequency.
SEA_PRIORS = {'jonswap': ((0.0, 0.5), (np.log(2.3), 1.0), (3.0, 2.0), (-7.0, 2.0)), 'heave': ((0.0, 1.0), (-7.0, 2.0))}

MISSING_TOGETHER = 12  #: Neighbouring bands whose misfits may be correlated.


def excitation_spectrum(frequency: np.ndarray, peak: Any, peakedness: Any, tail: Any) -> np.ndarray:
    """JONSWAP (Hasselmann et al. 1973) with a tail frequency^-tail, one at its peak; frequency (B,) and peak in rad/s.
    The tail is 5 where the moment follows wave height, 1 where it follows wave slope in deep water.
    """
    u = frequency / peak
    width = np.where(u <= 1.0, 0.07, 0.09)
    log_peak = np.log(peakedness) * (np.exp(-0.5 * ((u - 1.0) / width) ** 2) - 1.0)
    return np.exp(log_peak - tail * np.log(u) - 1.25 * (u**-4 - 1.0))


class SeaPosterior(LogPosterior):
    """Whittle's likelihood of one record in waves: in a JONSWAP sea, or one as the vertical acceleration shows it.
    ``shown`` is the spectrum of that acceleration at the bands, (B,), or None. Parameters (p,) are those of
    `HULL_PRIORS` and of the sea's shape, the floor last.
    """

    def __init__(
        self, sea: SeaMotion, shown: np.ndarray | None = None, should_cancel: Callable[[], bool] | None = None
    ) -> None:
        self.sea, self.spectra, self._should_cancel = sea, term_spectra(sea), should_cancel
        self.noise = sea.noise(self.spectra.frequency)
        self._shown = None if shown is None else shown / shown.max()
        self.name = 'jonswap' if shown is None else 'heave'  #: Source of the sea's spectrum.
        self._in_peaks = [_FREQUENCY, *([len(HULL_PRIORS)] if shown is None else [])]
        mean, std = np.array([*HULL_PRIORS.values(), *SEA_PRIORS[self.name]]).T
        mean[self._in_peaks] += np.log(sea.peak)
        super().__init__(EQUATIONS['linear'], mean, std)

    def _waves(self, shape: np.ndarray):
        """Spectrum (P, B) of the sea of P shapes, one about its peak."""
        w, floor = self.spectra.frequency, np.exp(shape[:, -1:])
        if self._shown is not None:
            return self._shown * (w / self.sea.peak) ** shape[:, :1] + floor
        return excitation_spectrum(w, np.exp(shape[:, :1]), 1.0 + np.exp(shape[:, 1:2]), shape[:, 2:3]) + floor

    def _weights(self, points: np.ndarray):
        """Coefficients (P, 6) of the terms in the exciting moment."""
        frequency, damping = np.exp(points[:, [_FREQUENCY, _DAMPING]].T)
        b, r = 2.0 * damping * frequency, frequency**2
        return np.column_stack([np.ones_like(b), b, r, points[:, _NONLINEAR] * np.column_stack([b, r, r])])

    def parts(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of P points, each (P, B): spectra of the moment that the hull needs and that the sea gives, and the hull's
        squared stiffness.
        """
        own, w = self._weights(points), self.spectra.frequency
        needed = (own[:, :, None] * own[:, None, :]).reshape(len(own), -1) @ self.spectra.matrices.reshape(w.size, -1).T
        stiffness = (own[:, 2:3] - w**2) ** 2 + (own[:, 1:2] * w) ** 2
        given = np.exp(points[:, [_LEVEL]]) * self._waves(points[:, len(HULL_PRIORS) :])
        return needed, given + stiffness * self.noise, stiffness

    def likelihoods(self, points: np.ndarray) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
        """Whittle's, at points (P, p), all at once."""
        stop_if(self._should_cancel)
        size, counts = self.mean.size, self.spectra.counts
        moved = points[:, None] + PERTURBATION * np.vstack([np.zeros(size), np.eye(size)])
        parts = (np.split(part, len(points)) for part in self.parts(moved.reshape(-1, size)))
        for z, needed, given, stiffness in zip(points, *parts, strict=True):
            # the bands are those of the measured angle: the change of variables to the moment is the stiffness
            logs = np.log(given / stiffness), np.log(needed / given)
            ratio = needed[0] / given[0]
            by_given, by_ratio = ((log[1:] - log[0]) / PERTURBATION for log in logs)
            cost, gradient = float(counts @ (logs[0][0] + ratio)), (by_given + ratio * by_ratio) @ counts
            # a nonlinear term has nothing in common with the sea that the hull needs otherwise: it adds to it
            by_ratio[_NONLINEAR] = 0.0
            information = (by_ratio * counts) @ by_ratio.T
            units = self._weights(z[None])[0, [1, 2, 2]]
            added = np.tensordot(2.0 * counts / given[0], self.spectra.matrices[:, 3:, 3:], 1)
            information[_NONLINEAR, _NONLINEAR] += added * np.outer(units, units)
            yield cost, gradient, information

    def starts(self) -> list[np.ndarray]:
        """Parameters (p,) of hulls and seas of several frequencies, with the level that suits them."""
        found = []
        for of_hull in np.geomspace(0.5, 5.6, 8):
            for of_sea in (0.7, 1.0, 1.4) if self._shown is None else (None,):
                start = self.mean.copy()
                start[self._in_peaks] += np.log([of_hull, *([of_sea] if of_sea else [])])
                needed, given, _ = self.parts(start[None])
                weight = self.spectra.counts * self.spectra.angle
                start[_LEVEL] = np.log(np.average((needed / given)[0], weights=weight))
                found.append(start)
        return found

    def hull(self, z: np.ndarray) -> np.ndarray:
        """Ratios (9,) of the nonlinear hull about its angle of rest."""
        _, b, r, quadratic, even, cubic = self._weights(z[None])[0]
        s, q, x = self.sea.angle.std(), self.sea.rate.std(), self.sea.angle
        mean = -even * s - cubic * np.mean(x**3) / s**2
        restoring = np.polynomial.Polynomial([mean, r - 3.0 * cubic, even / s, cubic / s**2])
        rest = 0.0
        for _ in range(5):
            slope = restoring.deriv()(rest)
            if slope <= 0.0:
                rest = 0.0
                break
            rest -= restoring(rest) / slope
        ratios = np.zeros(len(TERM_NAMES))
        ratios[AT.b1], ratios[AT.b2] = b - GAUSSIAN_RATE * quadratic, quadratic / q
        for power, place in enumerate((AT.r1, AT.r2, AT.r3), 1):
            ratios[place] = restoring.deriv(power)(rest) / (1.0, 2.0, 6.0)[power - 1]
        return ratios

    def estimate(self, z: np.ndarray) -> np.ndarray:
        """Logarithms of natural frequency, rad/s, and damping ratio at the record's amplitude."""
        curves = amplitude_curves(self.hull(z), np.array([np.sqrt(2.0) * self.sea.angle.std()]), 1e-6)
        frequency, damping = float(curves.frequency[0]), float(curves.damping_ratio[0])
        # without a closed orbit of that size, what remains is the Gaussian linearisation
        is_known = np.isfinite(frequency) and damping > 0.0
        return np.log([frequency, damping]) if is_known else z[[_FREQUENCY, _DAMPING]]

    def _ratio(self, point: Evaluation):
        needed, given, _ = self.parts(point.z[None])
        return (needed / given)[0]

    def deviance(self, point: Evaluation) -> float:
        """Deviance a degree of freedom."""
        ratio = self._ratio(point)
        total = 2.0 * self.spectra.counts @ (ratio - np.log(ratio) - 1.0)
        return float(total / max(1, ratio.size - point.z.size))

    def inflation(self, point: Evaluation) -> float:
        """Variance of the parameters over that of a perfect fit, at least one. The deviance times the summed
        autocorrelation of neighbouring bands' residuals (as Newey and West 1987): where the sea has another shape,
        neighbouring bands miss together.
        """
        residual = np.sqrt(self.spectra.counts) * (self._ratio(point) - 1.0).clip(-1.0, 3.0)
        residual = residual - residual.mean()
        together = 1.0
        for lag in range(1, MISSING_TOGETHER):
            share = 2.0 * (1.0 - lag / MISSING_TOGETHER)
            together += share * (residual[lag:] @ residual[:-lag]) / (residual @ residual)
        return max(1.0, self.deviance(point) * max(1.0, together))


AT_SEA = 'motion in waves'  #: Marks a model identified at sea, as ``provenance['identified_from']``.
MIN_WAVES = 50  #: Peak periods that a record must hold.

MIN_FADING = 6.0  #: A free decay must fade by exp of this within the record; otherwise it is a tone.

#: Relative standard deviation of the period above which the result is unusable, as it is with uncertain damping; from
#: half of either the sea is reported to hide the hull.
PERIOD_USABLE = 0.10
POOR_FIT = 2.0  #: Misfit over that of another spectrum, or of chance.


@dataclass(frozen=True)
class FittedSpectra:
    """Measured and fitted spectra, one-sided, per rad/s."""

    frequency: np.ndarray  #: (B,); rad/s.
    measured: np.ndarray  #: (B,); of the angle, rad^2 s.
    fitted: np.ndarray  #: (B,); of the angle, rad^2 s; its nonlinear part is the measured one.
    excitation: np.ndarray  #: (B,); of the exciting moment over inertia that the hull needs, (rad/s^2)^2 s.
    fitted_excitation: np.ndarray  #: (B,); of the fitted sea, (rad/s^2)^2 s.


@dataclass(frozen=True)
class AtSeaIdentification:
    """A hull as identified from a record in waves."""

    model: DecayModel  #: Linear; its trim is the mean angle.
    natural_period: float  #: s, at ``amplitude``.
    natural_period_std: float  #: s.
    damping_ratio: float  #: Equivalent linear damping over critical damping, at ``amplitude``.
    damping_ratio_std: float
    amplitude: float  #: rad; sqrt(2) standard deviations of the angle.
    amplitude_std: float  #: rad.
    trim_std: float  #: rad; NaN where no angle was measured.
    estimate_covariance: np.ndarray  #: (2, 2); Of natural period (s) and damping ratio.
    covariance: np.ndarray  #: (2, 2); Of the ratios b1 and r1.
    misfit: float  #: Deviance per degree of freedom of the fitted spectrum; 1 where hull and sea explain it.
    sea: str  #: Source of the sea's spectrum: ``heave`` or ``jonswap``.
    peak_period: float  #: Of the fitted excitation, s.
    duration: float  #: Of the stretch used, s.
    spectra: FittedSpectra
    motion: AxisMotion
    holds_decay: bool  #: Whether a free decay was found in it too.

    @property
    def has_period(self) -> bool:
        """Whether the natural period is known well enough to be used."""
        return self.natural_period_std < PERIOD_USABLE * self.natural_period

    @property
    def is_usable(self) -> bool:
        """Whether period and damping are known well enough."""
        return self.has_period and self.damping_ratio_std < UNCERTAIN * self.damping_ratio

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def advice(self) -> tuple[Advice, ...]:
        """What must be known to use it."""
        found = [Advice.of('equivalent-linear', amplitude=np.degrees(self.amplitude))]
        period = 100.0 * self.natural_period_std / self.natural_period
        damping = 100.0 * self.damping_ratio_std / self.damping_ratio
        if period > 50.0 * PERIOD_USABLE or damping > 50.0 * UNCERTAIN:
            peak, minutes = self.peak_period, self.duration / 60
            found.append(Advice.of('sea-hides-hull', peak=peak, period=period, damping=damping, minutes=minutes))
        if self.holds_decay:
            found.append(Advice.of('holds-decay'))
        if self.misfit > POOR_FIT:
            found.append(Advice.of('sea-not-fitted', misfit=self.misfit))
        return tuple(found)

    def gain_over(self, model: DecayModel) -> float:
        """Rise of the log-likelihood from a linear model to this one, to second order in the logarithms of the ratios.
        Twice that is chi-squared with two degrees of freedom if the model is true (Wald 1943).
        """
        # half and twice are equally far away
        away = [value * np.log(max(model.terms[name] / value, 1e-4)) for name, value in self.model.terms.items()]
        return 0.5 * float(np.array(away) @ np.linalg.solve(self.covariance, away))

    def identified_model(self, provenance: dict) -> IdentifiedModel:
        """The content of a model file; ``provenance`` is the caller's record of the sources, and gets `AT_SEA`."""
        metrics = {
            'natural_period_s': self.natural_period,
            'natural_period_std_s': self.natural_period_std,
            'damping_ratio': self.damping_ratio,
            'damping_ratio_std': self.damping_ratio_std,
            'misfit': self.misfit,
        }
        how = {
            'identified_from': AT_SEA,
            'equivalent_linear_at_amplitude_rad': self.amplitude,
            'segments_s': [[float(self.motion.time[0]), float(self.motion.time[-1])]],
            'sea': self.sea,
            'peak_period_s': self.peak_period,
            'advice': [a.code for a in self.advice],
        }
        # a linear equivalent is valid at its amplitude only
        seen = (float(self.amplitude), float(self.amplitude))
        return IdentifiedModel(self.model, self.covariance, self.trim_std, seen, metrics, {**provenance, **how})


def is_at_sea(identified: IdentifiedModel) -> bool:
    """Whether an `IdentifiedModel` is the linear equivalent that a record in waves gave."""
    provenance = identified.provenance
    # a model file may say anything there
    return isinstance(provenance, dict) and provenance.get('identified_from') == AT_SEA


def identify_at_sea(
    motion: AxisMotion,
    heave: Heave | None = None,
    start: float | None = None,
    end: float | None = None,
    *,
    searched: bool = False,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> AtSeaIdentification:
    """Natural period and equivalent linear damping from a record in waves, used from ``start`` to ``end``, s.
    ``searched`` says that the record is known to hold no free decay. Raises `InputError` where the record is too short
    or cannot be used, and `Cancelled`.
    """
    motion = motion.between(start, end)
    report = progress or (lambda share: None)
    sea = sea_of(motion)
    fit = SeaPosterior(sea, None, should_cancel)
    optima = fit.minimise(fit.starts())
    report(0.5)
    shown = heave_spectrum(heave, sea, fit.spectra)
    if shown is not None:
        seen = SeaPosterior(sea, shown, should_cancel)
        found = seen.minimise(seen.starts())
        # what was measured, unless it fits poorly beside JONSWAP
        if seen.deviance(found[0]) <= POOR_FIT * max(1.0, fit.deviance(optima[0])):
            fit, optima = seen, found
    report(1.0)
    return _identification(motion, fit, optima, not searched and bool(find_decays(motion)))


def sea_of(motion: AxisMotion) -> SeaMotion:
    """The motion in waves, with enough of them to separate hull and sea."""
    sea = sea_motion(motion)
    period = 2.0 * np.pi / sea.peak
    # one at each end is left out
    needed = (MIN_WAVES + 2) * period
    if sea.duration < MIN_WAVES * period:
        short = Advice.of(
            'too-few-waves', axis=motion.axis, duration=sea.duration, period=period, needed=np.ceil(needed)
        )
        raise InputError(short.message, short.code)
    return sea


def _identification(motion: AxisMotion, fit: SeaPosterior, optima: Sequence[Evaluation], holds_decay: bool):
    sea, spectra, best = fit.sea, fit.spectra, optima[0]
    misfit = fit.deviance(best)
    logs, log_covariance = _estimate_with_covariance(fit, optima)
    frequency, damping = np.exp(logs)
    period = 2.0 * np.pi / frequency
    covariance = log_covariance * np.outer([-period, damping], [-period, damping])
    if frequency > 0.95 * spectra.frequency[-1]:
        raise InputError(
            f'the {motion.axis} follows the waves as far as it is known (down to periods of '
            f'{2.0 * np.pi / spectra.frequency[-1]:.3g} s), so the natural period is shorter and stays hidden: record '
            'in shorter waves, with a quieter sensor, or a free decay in still water'
        )
    if damping * frequency * sea.duration < MIN_FADING:
        raise InputError(
            f'the {motion.axis} oscillates with a period of {period:.3g} s like a pure tone, as in regular waves, '
            'which say nothing about the damping: give motion in irregular waves, or record a free decay in still water'
        )
    b1, r1 = 2.0 * damping * frequency, frequency**2
    # derivatives of b1 and r1 by log frequency and log damping
    slopes = np.array([[b1, b1], [2.0 * r1, 0.0]])
    trim = 0.0 if np.isnan(sea.mean) else sea.mean
    needed, given, stiffness = (part[0] for part in fit.parts(best.z[None]))
    fitted = FittedSpectra(
        frequency=spectra.frequency,
        measured=spectra.angle,
        fitted=spectra.angle * given / needed,
        excitation=needed,
        fitted_excitation=given - stiffness * fit.noise,
    )
    band = np.gradient(spectra.frequency)
    variance = float(band @ spectra.angle)
    amplitude = np.sqrt(2.0) * sea.angle.std()
    # variance of a variance: 2 pi / T int S^2 (one-sided), of a mean: pi / T S(0)
    amplitude_std = 0.5 * amplitude * np.sqrt(2.0 * np.pi / sea.duration * (band @ spectra.angle**2)) / variance
    trim_std = np.sqrt(np.pi / sea.duration * np.median(spectra.angle[spectra.frequency < 0.5 * sea.peak]))
    period_std, damping_std = np.sqrt(np.diag(covariance)).tolist()
    return AtSeaIdentification(
        model=DecayModel.from_terms(EQUATIONS['linear'], {'b1': b1, 'r1': r1}, trim=trim, axis=motion.axis),
        natural_period=float(period),
        natural_period_std=period_std,
        damping_ratio=float(damping),
        damping_ratio_std=damping_std,
        amplitude=float(amplitude),
        amplitude_std=float(amplitude_std),
        trim_std=float('nan') if np.isnan(sea.mean) else float(trim_std),
        estimate_covariance=covariance,
        covariance=slopes @ log_covariance @ slopes.T,
        misfit=misfit,
        sea=fit.name,
        peak_period=2.0 * np.pi / float(fitted.frequency[fitted.fitted_excitation.argmax()]),
        duration=float(sea.duration),
        spectra=fitted,
        motion=motion,
        holds_decay=holds_decay,
    )


def _estimate_with_covariance(fit: SeaPosterior, optima: Sequence[Evaluation]):
    """`estimate` and its covariance (2, 2), the spread over other optima included."""
    best, inflation = optima[0], fit.inflation(optima[0])
    steps = PERTURBATION * np.eye(best.z.size)
    slopes = np.array([fit.estimate(best.z + step) - fit.estimate(best.z - step) for step in steps]).T / (
        2.0 * PERTURBATION
    )
    apart: list[tuple[float, np.ndarray]] = []
    for each in optima:
        found = fit.estimate(each.z)
        # optima reached twice are one
        if all(np.abs(found - other).max() > 0.01 for _, other in apart):
            apart.append((np.exp((best.cost - each.cost) / inflation), found))
    weights, logs = np.array([weight for weight, _ in apart]), np.array([found for _, found in apart])
    shifts = logs - logs[0]
    covariance = inflation * slopes @ np.linalg.inv(best.information) @ slopes.T
    return logs[0], covariance + (weights / weights.sum() * shifts.T) @ shifts
