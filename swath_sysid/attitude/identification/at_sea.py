"""Natural period and equivalent linear damping from motion in waves, by the Whittle (1953) likelihood.

The moment over inertia d = w' + b1 w + b2 |w| w + r1 x + r2 x^2 + r3 x^3 must have the spectrum of a sea plus a floor:
that of the vertical acceleration times a power of frequency, or JONSWAP (Hasselmann et al. 1973) with a free tail.
The result is the linear hull at amplitude sqrt(2) std: one record does not show how damping depends on amplitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.amplitude import amplitude_curves
from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import TERM_INDEX, TERM_NAMES
from swath_sysid.attitude.identification.sea_motion import (
    EDGE_PERIODS,
    GAUSSIAN_RATE,
    Heave,
    SeaMotion,
    TermSpectra,
    heave_spectrum,
    random_decrement,
    sea_motion,
    term_spectra,
)
from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.stopping import Cancelled, Progress, ShouldCancel

AT_SEA = 'motion in waves'  #: Marks a model identified at sea, as ``provenance['identified_from']``.
MIN_WAVES = 50  #: Peak periods that a record must hold.

#: Parameters of hull and level; those of the sea's shape follow.
PARAMETERS = (
    'log frequency',
    'log damping',
    'quadratic damping',
    'quadratic restoring',
    'cubic restoring',
    'log level',
)
_FREQUENCY, _DAMPING, _QUADRATIC, _EVEN, _CUBIC, _LEVEL = range(6)
_PRIOR_STD = (1.0, 1.2, 0.5, 0.3, 0.1, np.inf)

#: JONSWAP's mean. With less, a hull near resonance takes part of the sea's peak for its own.
MEAN_PEAKEDNESS = 3.3

_FLOOR_PRIOR = (-7.0, 2.0)
_FREQUENCY_STARTS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
_PEAK_STARTS = (0.7, 1.0, 1.4)

#: The measured heave spectrum is used unless its misfit is this many times that of JONSWAP.
HEAVE_PREFERRED = 1.5

_FIRST_DAMPING = 0.15
_REFINED = 8  #: Number of best starts that are refined.
_MODE_DEPTH = 8.0  #: Other optima add to the uncertainty unless their log-likelihood is this much worse.
MIN_FADING = 6.0  #: A free decay must fade by exp of this within the record; otherwise it is a tone.

#: Std of the log natural frequency above the highest band, where nothing can be seen.
EDGE_SOFTNESS = 0.1

MISSING_TOGETHER = 12  #: Neighbouring bands whose misfits may be correlated.

_DECREMENT_PERIODS = 3.0
#: Relative standard deviations above which the result is unusable; from half of them the sea is reported to hide the
#: hull.
PERIOD_USABLE, DAMPING_USABLE = 0.10, 0.50
POOR_FIT = 2.0


@dataclass(frozen=True)
class FittedSpectra:
    """Measured and fitted spectra, one-sided, per rad/s."""

    frequency: np.ndarray  #: (B,); rad/s.
    measured: np.ndarray  #: (B,); of the angle, rad^2 s.
    fitted: np.ndarray  #: (B,); of the angle, rad^2 s; its nonlinear part is the measured one.
    excitation: np.ndarray  #: (B,); of the exciting moment over inertia that the hull needs, (rad/s^2)^2 s.
    fitted_excitation: np.ndarray  #: (B,); of the fitted sea, (rad/s^2)^2 s.
    response: np.ndarray  #: (B,); angle over the static angle of the same moment.


@dataclass(frozen=True)
class Decrement:
    """The random decrement signature and what the fit predicts for it."""

    lag: np.ndarray  #: (L,); s.
    measured: np.ndarray  #: (L,); rad.
    fitted: np.ndarray  #: (L,); Autocorrelation of the fitted spectrum, to the same level.
    free_decay: np.ndarray  #: (L,); Of the identified hull in still water, from the same level.


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
    decrement: Decrement
    motion: AxisMotion
    advice: tuple[Advice, ...]

    @property
    def has_period(self) -> bool:
        """Whether the natural period is known well enough to be used."""
        return self.natural_period_std < PERIOD_USABLE * self.natural_period

    @property
    def is_usable(self) -> bool:
        """Whether period and damping are known well enough."""
        return self.has_period and self.damping_ratio_std < DAMPING_USABLE * self.damping_ratio

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

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
    fit, modes = _best_fit(motion, heave, progress, should_cancel)
    return _identification(motion, fit, modes, not searched and bool(find_decays(motion)))


def gain_over(
    model: DecayModel, motion: AxisMotion, heave: Heave | None = None, *, should_cancel: ShouldCancel | None = None
) -> float:
    """Rise of a record's log-likelihood when the hull is fitted to it instead of given by a linear model.

    Twice that is chi-squared with two degrees of freedom if the model is true (Wilks 1938), after division by the fit's
    `inflation`.
    """
    fit, modes = _best_fit(motion, heave, None, should_cancel)
    free = modes[0]
    held = _Fit(fit.sea, fit.spectra, fit.waves, np.log([model.natural_frequency, max(model.damping_ratio, 1e-4)]))
    given = held.optima(should_cancel=should_cancel)[0]
    return float((given.fun - free.fun) / fit.inflation(free.x))


def excitation_spectrum(frequency: np.ndarray, peak: float, peakedness: float, tail: float) -> np.ndarray:
    """JONSWAP (Hasselmann et al. 1973) with a tail frequency^-tail, one at its peak; frequency (B,) and peak in rad/s.

    The tail is 5 where the moment follows wave height, 1 where it follows wave slope in deep water.
    """
    u = frequency / peak
    width = np.where(u <= 1.0, 0.07, 0.09)
    log_peak = np.log(peakedness) * (np.exp(-0.5 * ((u - 1.0) / width) ** 2) - 1.0)
    return np.exp(np.clip(log_peak - np.clip(tail, -20.0, 20.0) * np.log(u) - 1.25 * (u**-4 - 1.0), -80.0, 80.0))


def _best_fit(motion: AxisMotion, heave: Heave | None, progress: Progress | None, should_cancel: ShouldCancel | None):
    """The likelihood with the sea that is to be used, and its optima, the best first."""
    report = progress or (lambda share: None)
    sea, spectra = _prepared(motion)
    plain = _Fit(sea, spectra, _Jonswap(sea))
    others = plain.optima(lambda share: report(0.5 * share), should_cancel)
    shown = heave_spectrum(heave, sea, spectra)
    if shown is None:
        report(1.0)
        return plain, others
    seen = _Fit(sea, spectra, _Heaving(sea, spectra, shown))
    optima = seen.optima(lambda share: report(0.5 + 0.5 * share), should_cancel)
    if seen.deviance(optima[0].x) > HEAVE_PREFERRED * max(1.0, plain.deviance(others[0].x)):
        return plain, others
    return seen, optima


def _prepared(motion: AxisMotion):
    if motion.size < 64:
        raise InputError(
            f'the {motion.axis} has only {motion.size} samples there: give at least 10 minutes of motion in waves'
        )
    sea = sea_motion(motion)
    period = 2.0 * np.pi / sea.peak
    needed = (MIN_WAVES + 2.0 * EDGE_PERIODS) * period
    if sea.duration < MIN_WAVES * period:
        raise InputError(
            f'the {motion.axis} holds {sea.duration:.0f} s of motion in waves, whose spectrum peaks at {period:.3g} s: '
            f'too few waves to separate hull and sea: record at least {np.ceil(needed):.0f} s, better three times as '
            'long'
        )
    return sea, term_spectra(sea)


class _Jonswap:
    """A sea of which only the kind of shape is known: log peak frequency, log (peakedness - 1), tail, log floor."""

    name = 'jonswap'

    def __init__(self, sea: SeaMotion):
        self.prior = np.array([np.log(sea.peak), np.log(MEAN_PEAKEDNESS - 1.0), 3.0, _FLOOR_PRIOR[0]])
        self.prior_std = np.array([0.5, 1.0, 2.0, _FLOOR_PRIOR[1]])

    def starts(self):
        for factor in _PEAK_STARTS:
            yield self.prior + np.array([np.log(factor), 0.0, 0.0, 0.0])

    def spectrum(self, frequency: np.ndarray, parameters: np.ndarray):
        peak, peakedness, floor = np.exp(np.clip(parameters[[0, 1, 3]], -60.0, 60.0))
        return excitation_spectrum(frequency, peak, 1.0 + peakedness, parameters[2]) + floor


class _Heaving:
    """The sea as the vertical acceleration shows it: power of the frequency, log floor."""

    name = 'heave'

    def __init__(self, sea: SeaMotion, spectra: TermSpectra, shown: np.ndarray):
        self.prior, self.prior_std = np.array([0.0, _FLOOR_PRIOR[0]]), np.array([1.0, _FLOOR_PRIOR[1]])
        self._shown, self._relative = shown / shown.max(), spectra.frequency / sea.peak

    def starts(self):
        yield self.prior.copy()

    def spectrum(self, frequency: np.ndarray, parameters: np.ndarray):
        floor = np.exp(np.clip(parameters[1], -60.0, 60.0))
        return self._shown * self._relative ** np.clip(parameters[0], -20.0, 20.0) + floor


class _Fit:
    """The likelihood of one record with one kind of sea; with the hull's parameters held, if given."""

    def __init__(
        self, sea: SeaMotion, spectra: TermSpectra, waves: _Jonswap | _Heaving, held: np.ndarray | None = None
    ):
        self.sea, self.spectra, self.waves, self.held = sea, spectra, waves, held
        self.noise, self.highest = sea.noise(spectra.frequency), np.log(spectra.frequency[-1])
        hull = [np.log(sea.peak), np.log(_FIRST_DAMPING), 0.0, 0.0, 0.0, 0.0]
        self.prior = np.concatenate([hull, waves.prior])
        self.prior_std = np.concatenate([_PRIOR_STD, waves.prior_std])

    def weights(self, parameters: np.ndarray):
        """Coefficients of the terms in the exciting moment, shape (6,)."""
        frequency, damping = np.exp(np.clip(parameters[:2], -60.0, 60.0))
        b, r = 2.0 * damping * frequency, frequency**2
        return np.array([1.0, b, r, parameters[_QUADRATIC] * b, parameters[_EVEN] * r, parameters[_CUBIC] * r])

    def parts(self, parameters: np.ndarray):
        """Spectra of the moment that the hull needs and that the sea gives, and the hull's squared stiffness."""
        own, w = self.weights(parameters), self.spectra.frequency
        needed = self.spectra.matrices @ own @ own
        stiffness = (own[2] - w**2) ** 2 + (own[1] * w) ** 2
        level = np.exp(np.clip(parameters[_LEVEL], -60.0, 60.0))
        given = level * self.waves.spectrum(w, parameters[len(PARAMETERS) :])
        return needed, given + stiffness * self.noise, stiffness

    def __call__(self, parameters: np.ndarray):
        """Negative log posterior."""
        needed, given, stiffness = self.parts(parameters)
        # the bands are those of the measured angle: the change of variables to the moment is the stiffness
        value = self.spectra.counts @ (np.log(given / stiffness) + needed / given)
        value += 0.5 * np.sum(((parameters - self.prior) / self.prior_std) ** 2)
        value += 0.5 * (max(parameters[_FREQUENCY] - self.highest, 0.0) / EDGE_SOFTNESS) ** 2
        return value if np.isfinite(value) else 1e12

    def optima(self, progress: Progress | None = None, should_cancel: ShouldCancel | None = None):
        """Local optima as scipy's results, the best first."""
        starts = sorted(self._starts(), key=self)[:_REFINED]
        found = []
        for number, start in enumerate(starts):
            if should_cancel is not None and should_cancel():
                raise Cancelled
            found.append(self._refined(start))
            if progress is not None:
                progress((number + 1.0) / len(starts))
        return sorted(found, key=lambda result: result.fun)

    def _refined(self, start: np.ndarray):
        fixed = start[:0] if self.held is None else self.held
        from scipy.optimize import minimize

        result = minimize(
            lambda rest: self(np.concatenate([fixed, rest])),
            start[fixed.size :],
            method='BFGS',
            options={'gtol': 1e-2, 'maxiter': 300},
        )
        result.x = np.concatenate([fixed, result.x])
        return result

    def _starts(self):
        for waves in self.waves.starts():
            for factor in _FREQUENCY_STARTS:
                start = np.concatenate([self.prior[: len(PARAMETERS)], waves])
                start[_FREQUENCY] += np.log(factor)
                if self.held is not None:
                    start[: self.held.size] = self.held
                needed, given, _ = self.parts(start)
                start[_LEVEL] = np.log(np.average(needed / given, weights=self.spectra.counts * self.spectra.angle))
                yield start

    def hull(self, parameters: np.ndarray):
        """Ratios (9,) of the nonlinear hull about its angle of rest."""
        one, b, r, quadratic, even, cubic = self.weights(parameters)
        s, q, x = self.sea.angle_std, self.sea.rate_std, self.sea.angle
        restoring = np.polynomial.Polynomial(
            [
                -even * s - cubic * np.mean(x**3) / s**2,
                r - 3.0 * cubic,
                even / s,
                cubic / s**2,
            ]
        )
        rest = 0.0
        for _ in range(5):
            slope = restoring.deriv()(rest)
            if slope <= 0.0:
                rest = 0.0
                break
            rest -= restoring(rest) / slope
        ratios = np.zeros(len(TERM_NAMES))
        ratios[TERM_INDEX['b1']], ratios[TERM_INDEX['b2']] = b - GAUSSIAN_RATE * quadratic, quadratic / q
        for power, name in enumerate(('r1', 'r2', 'r3'), 1):
            ratios[TERM_INDEX[name]] = restoring.deriv(power)(rest) / (1.0, 2.0, 6.0)[power - 1]
        return ratios

    def estimate(self, parameters: np.ndarray):
        """Logarithms of natural period, s, and damping ratio at the record's amplitude."""
        amplitude = np.sqrt(2.0) * self.sea.angle_std
        curves = amplitude_curves(self.hull(parameters), np.array([amplitude]), 1e-6)
        frequency, damping = float(curves.frequency[0]), float(curves.damping_ratio[0])
        if not (np.isfinite(frequency) and damping > 0.0):
            # no closed orbit of that size: what remains is the Gaussian linearisation
            frequency, damping = np.exp(parameters[:2])
        return np.array([np.log(2.0 * np.pi / frequency), np.log(damping)])

    def deviance(self, parameters: np.ndarray):
        """Deviance a degree of freedom."""
        needed, given, _ = self.parts(parameters)
        ratio = needed / given
        total = 2.0 * self.spectra.counts @ (ratio - np.log(ratio) - 1.0)
        return float(total / max(1, self.spectra.counts.size - parameters.size))

    def inflation(self, parameters: np.ndarray):
        """Variance of the parameters over that of a perfect fit, at least one.

        The deviance times the summed autocorrelation of neighbouring bands' residuals (as Newey and West 1987): where
        the sea has another shape, neighbouring bands miss together.
        """
        needed, given, _ = self.parts(parameters)
        residual = np.sqrt(self.spectra.counts) * (needed / given - 1.0).clip(-1.0, 3.0)
        residual = residual - residual.mean()
        variance = residual @ residual
        together = 1.0
        for lag in range(1, MISSING_TOGETHER):
            together += 2.0 * (1.0 - lag / MISSING_TOGETHER) * (residual[lag:] @ residual[:-lag]) / variance
        return max(1.0, self.deviance(parameters) * max(1.0, together))

    def covariance(self, parameters: np.ndarray):
        """Inverse of the Hessian of the negative log posterior, by differences."""
        size, spread = parameters.size, self.prior_std
        step = 1e-3 * np.where(np.isfinite(spread), np.maximum(spread, 0.3), 1.0)
        hessian = np.empty((size, size))
        for i in range(size):
            for j in range(i + 1):
                value = 0.0
                for sign_i in (1.0, -1.0):
                    for sign_j in (1.0, -1.0):
                        moved = parameters.copy()
                        moved[i] += sign_i * step[i]
                        moved[j] += sign_j * step[j]
                        value += sign_i * sign_j * self(moved)
                hessian[i, j] = hessian[j, i] = value / (4.0 * step[i] * step[j])
        values, vectors = np.linalg.eigh(hessian)
        least = np.min(spread[np.isfinite(spread)] ** -2.0)
        # no direction is known less well than before the record
        return (vectors / np.maximum(values, least)) @ vectors.T


def _identification(motion: AxisMotion, fit: _Fit, modes: Sequence[Any], holds_decay: bool):
    sea, spectra, best = fit.sea, fit.spectra, modes[0]
    misfit = fit.deviance(best.x)
    logs, log_covariance = _estimate_with_covariance(fit, modes, fit.inflation(best.x))
    period, damping = np.exp(logs)
    scale = np.array([period, damping])
    covariance = log_covariance * np.outer(scale, scale)
    frequency = 2.0 * np.pi / period
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
    # derivatives of (log b1, log r1) by (log period, log damping)
    to_ratios = np.array([[-1.0, 1.0], [-2.0, 0.0]])
    ratio_covariance = to_ratios @ log_covariance @ to_ratios.T * np.outer([b1, r1], [b1, r1])
    trim = 0.0 if np.isnan(sea.mean) else sea.mean
    model = DecayModel.from_terms(EQUATIONS['linear'], {'b1': b1, 'r1': r1}, trim=trim, axis=motion.axis)
    fitted = _fitted_spectra(fit, best.x)
    band = np.gradient(spectra.frequency)
    variance = float(band @ spectra.angle)
    amplitude = np.sqrt(2.0) * sea.angle_std
    # variance of a variance: 2 pi / T int S^2 (one-sided), of a mean: pi / T S(0)
    amplitude_std = 0.5 * amplitude * np.sqrt(2.0 * np.pi / sea.duration * (band @ spectra.angle**2)) / variance
    trim_std = np.sqrt(np.pi / sea.duration * np.median(spectra.angle[spectra.frequency < 0.5 * sea.peak]))
    peak_period = 2.0 * np.pi / float(fitted.frequency[fitted.fitted_excitation.argmax()])
    advice = _advice(holds_decay, sea, period, damping, covariance, misfit, peak_period, amplitude)
    return AtSeaIdentification(
        model=model,
        natural_period=float(period),
        natural_period_std=float(np.sqrt(covariance[0, 0])),
        damping_ratio=float(damping),
        damping_ratio_std=float(np.sqrt(covariance[1, 1])),
        amplitude=float(amplitude),
        amplitude_std=float(amplitude_std),
        trim_std=float('nan') if np.isnan(sea.mean) else float(trim_std),
        estimate_covariance=covariance,
        covariance=ratio_covariance,
        misfit=misfit,
        sea=fit.waves.name,
        peak_period=peak_period,
        duration=float(sea.duration),
        spectra=fitted,
        decrement=_decrement(sea, fitted, model),
        motion=motion,
        advice=advice,
    )


def _estimate_with_covariance(fit: _Fit, modes: Sequence[Any], inflation: float):
    """Logarithms of period and damping with their covariance, the spread over other optima included."""
    best = modes[0]
    within = inflation * fit.covariance(best.x)
    slopes = np.empty((2, best.x.size))
    for index in range(best.x.size):
        step = np.zeros(best.x.size)
        step[index] = 1e-4
        slopes[:, index] = (fit.estimate(best.x + step) - fit.estimate(best.x - step)) / 2e-4
    logs = fit.estimate(best.x)
    covariance = slopes @ within @ slopes.T
    depths = np.array([(mode.fun - best.fun) / inflation for mode in modes])
    likely = [
        (np.exp(-depth), fit.estimate(mode.x) - logs)
        for depth, mode in zip(depths, modes, strict=True)
        if depth < _MODE_DEPTH
    ]
    # optima reached twice are one
    apart: list[tuple] = []
    for weight, shift in likely:
        if all(np.abs(shift - other).max() > 0.01 for _, other in apart):
            apart.append((weight, shift))
    total = sum(weight for weight, _ in apart)
    covariance += sum(weight / total * np.outer(shift, shift) for weight, shift in apart)
    return logs, covariance


def _fitted_spectra(fit: _Fit, parameters: np.ndarray):
    needed, given, stiffness = fit.parts(parameters)
    own = fit.weights(parameters)
    return FittedSpectra(
        frequency=fit.spectra.frequency,
        measured=fit.spectra.angle,
        fitted=fit.spectra.angle * given / needed,
        excitation=needed,
        fitted_excitation=given - stiffness * fit.noise,
        response=own[2] / np.sqrt(stiffness),
    )


def _decrement(sea: SeaMotion, spectra: FittedSpectra, model: DecayModel):
    lag, measured = random_decrement(sea, _DECREMENT_PERIODS * 2.0 * np.pi / min(sea.peak, model.natural_frequency))
    level = np.sqrt(2.0) * sea.angle_std
    power = np.gradient(spectra.frequency) * spectra.fitted
    fitted = level * np.cos(np.outer(lag, spectra.frequency)) @ (power / power.sum())
    decay, _ = simulate(model.with_trim(0.0), level, 0.0, lag)
    return Decrement(lag, measured, fitted, decay)


def _advice(
    holds_decay: bool,
    sea: SeaMotion,
    period: float,
    damping: float,
    covariance: np.ndarray,
    misfit: float,
    peak_period: float,
    amplitude: float,
):
    found = [Advice.of('equivalent-linear', amplitude=np.degrees(amplitude))]
    period_spread, damping_spread = np.sqrt(np.diag(covariance)) / (period, damping)
    if holds_decay:
        found.append(Advice.of('holds-decay'))
    if period_spread > 0.5 * PERIOD_USABLE or damping_spread > 0.5 * DAMPING_USABLE:
        found.append(
            Advice.of(
                'sea-hides-hull',
                peak=peak_period,
                period=100 * period_spread,
                damping=100 * damping_spread,
                minutes=sea.duration / 60,
            )
        )
    if misfit > POOR_FIT:
        found.append(Advice.of('sea-not-fitted', misfit=misfit))
    return tuple(found)
