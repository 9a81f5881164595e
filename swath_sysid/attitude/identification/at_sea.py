"""Natural period and equivalent linear damping from motion in waves, by the likelihood of hull and waves.

The result is the linear hull that is equivalent in a Gaussian motion, as in an oscillation with an amplitude of two
standard deviations: one record does not show how damping depends on amplitude.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Self

import numpy as np

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel, amplitude_curves
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, mounting_of
from swath_sysid.attitude.identification.sea_likelihood import (
    ROUGHNESS,
    FrequencyPosterior,
    SeaHullPrior,
    SeaLikelihood,
    hull_posterior,
)
from swath_sysid.attitude.identification.sea_motion import Heave, SeaMotion, SeaPart, heave_of, sea_motion, sea_part
from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import Progress, ShouldCancel
from swath_sysid.common.conventions import UNCERTAIN
from swath_sysid.common.errors import InputError

AT_SEA = 'motion in waves'  #: Marks a model identified at sea, as ``provenance['identified_from']``.
MIN_WAVES = 50  #: Peak periods that a record must hold.

MIN_FADING = 6.0  #: A free decay must fade by exp of this within the record; otherwise it is a tone.

#: Relative standard deviation of the period above which the result is unusable, as it is with uncertain damping; from
#: half of either the sea is reported to hide the hull.
PERIOD_USABLE = 0.035
LONGEST_EXCESS = 2.0  #: Times that deviation up to which a record four times as long of the same sea is advised.
FASTEST_HULL = 1.5  #: Highest natural frequency that is tried, over the highest at which the motion is known.
#: Amplitude over standard deviation: a cubic term is as large in an oscillation of twice the deviation as in a Gaussian
#: motion, a quadratic one within 6 %.
EQUIVALENT = 2.0
PARTS = 2  #: Of equal length, where no heading tells them apart.
AGREE = 1.96  #: Standard deviations of their difference within which parts must agree.

#: Standard deviation of the logarithm of a model's damping for the craft as it sails now: half and twice are likely.
DAMPING_KNOWN = np.log(2.0)
FREQUENCY_KNOWN = 0.2  #: The same of its natural frequency: a change of stiffness by half is likely.
TURN = np.radians(15.0)  #: Change of heading that makes another part.


@dataclass(frozen=True)
class SeaRecord:
    """A record in waves; each of its parts has an excitation of its own."""

    motion: AxisMotion
    heave: Heave | None = None
    bounds: tuple[float, ...] = ()  #: Times between its parts, s; empty: `PARTS` of equal length.

    @classmethod
    def of(cls, trial: Trial, axis: str) -> Self:
        """One axis of a trial, divided where the craft turned. Raises `InputError` where its channels contradict it."""
        refuse_contradictions(trial, axis)
        return cls(trial.axis(axis), heave_of(trial), turns_of(trial))


@dataclass(frozen=True)
class FittedSpectra:
    """Measured and fitted spectra, one-sided, per rad/s."""

    frequency: np.ndarray  #: (B,); rad/s.
    measured: np.ndarray  #: (B,); of the angle, rad^2 s.
    fitted: np.ndarray  #: (B,); of the angle, rad^2 s.
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
    amplitude: float  #: rad; two standard deviations of the angle, without its slow part.
    amplitude_std: float  #: rad.
    trim_std: float  #: rad; NaN where no angle was measured.
    estimate_covariance: np.ndarray  #: (2, 2); Of natural period (s) and damping ratio.
    covariance: np.ndarray  #: (2, 2); Of the ratios b1 and r1.
    roughness: float  #: Standard deviation of the log of the excitation about the spectrum of the waves.
    is_smooth: bool  #: Whether that is less than any hull's peak.
    apart: float  #: Largest difference between periods of parts, or records, fitted alone, in standard deviations.
    sea: str  #: Source of the sea's spectrum: ``heave`` or ``jonswap``.
    peak_period: float  #: Of the fitted excitation, s.
    duration: float  #: Of the stretch used, s.
    slow_share: float  #: Of the variance of the angle, what is no wave: a heel that changes.
    spectra: tuple[FittedSpectra, ...]  #: Of each part.
    motions: tuple[AxisMotion, ...]
    holds_decay: bool  #: Whether a free decay was found in it too.

    @property
    def has_period(self) -> bool:
        """Whether the natural period is known well enough to be used."""
        return self.is_consistent and self.natural_period_std < PERIOD_USABLE * self.natural_period

    @property
    def is_usable(self) -> bool:
        """Whether period and damping are known well enough; the standard deviations of others are not to be trusted."""
        return not self.shortcomings

    @property
    def is_consistent(self) -> bool:
        """Whether one hull and smooth waves explain every part."""
        return self.is_smooth and self.apart < AGREE

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def advice(self) -> tuple[Advice, ...]:
        """What must be known to use it."""
        found = [Advice.of('equivalent-linear', amplitude=np.degrees(self.amplitude)), *self.shortcomings]
        if self.slow_share:
            found.append(Advice.of('slow-heel', axis=self.model.axis, share=self.slow_share))
        if 0.5 < self._excess < 1.0:
            found.append(self._hidden('sea-hides-hull'))
        return (*found, Advice.of('holds-decay')) if self.holds_decay else tuple(found)

    @property
    def shortcomings(self) -> tuple[Advice, ...]:
        """The conditions of a usable result that it fails, and what record would do."""
        found, minutes = [], self.duration / 60
        if not self._excess < 1.0:
            is_near = self._excess < LONGEST_EXCESS
            found.append(self._hidden('sea-hides-hull: longer' if is_near else 'sea-hides-hull: elsewhere'))
        if not self.is_smooth:
            found.append(Advice.of('sea-not-fitted', roughness=self.roughness, minutes=minutes))
        if not self.apart < AGREE:
            found.append(Advice.of('parts-disagree', apart=self.apart, usable=AGREE, minutes=minutes))
        return tuple(found)

    @property
    def _excess(self) -> float:
        """Standard deviation of period or damping, whichever is larger, over that of a usable result."""
        damping = self.damping_ratio_std / self.damping_ratio
        return float(max(self.natural_period_std / self.natural_period / PERIOD_USABLE, damping / UNCERTAIN))

    def _hidden(self, sentence: str) -> Advice:
        """That the waves show little of the hull; the variance falls with the length of the record."""
        return Advice.of(
            sentence,
            peak=self.peak_period,
            period=self.natural_period_std / self.natural_period,
            damping=self.damping_ratio_std / self.damping_ratio,
            usable_period=PERIOD_USABLE,
            usable_damping=UNCERTAIN,
            minutes=self.duration / 60,
            needed=np.ceil(self._excess**2 * self.duration / 60),
        )

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
            'roughness': self.roughness,
        }
        how = {
            'identified_from': AT_SEA,
            'equivalent_linear_at_amplitude_rad': self.amplitude,
            'segments_s': [[float(each.time[0]), float(each.time[-1])] for each in self.motions],
            'sea': self.sea,
            'peak_period_s': self.peak_period,
            'advice': [a.code for a in self.advice],
            **mounting_of(self.motions),
        }
        # a linear equivalent is valid at its amplitude only
        seen = (float(self.amplitude), float(self.amplitude))
        return IdentifiedModel(self.model, self.covariance, self.trim_std, seen, metrics, {**provenance, **how})


def is_at_sea(identified: IdentifiedModel) -> bool:
    """Whether an `IdentifiedModel` is the linear equivalent that a record in waves gave."""
    provenance = identified.provenance
    # a model file may say anything there
    return isinstance(provenance, dict) and provenance.get('identified_from') == AT_SEA


def identify_seas(
    records: Sequence[SeaRecord],
    prior: SeaHullPrior | None = None,
    *,
    searched: bool = False,
    checks_parts: bool = True,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> AtSeaIdentification:
    """The hull that records of one craft in waves share. ``searched``: they are known to hold no free decay;
    ``checks_parts``: whether parts, or records, that are fitted alone must agree. Raises `InputError` where one is too
    short or cannot be used, and `Cancelled`.
    """
    prior, report = prior or SeaHullPrior(), progress or (lambda share: None)
    seas = [sea_of(record.motion) for record in records]
    parts = [parts_of(sea, record) for sea, record in zip(seas, records, strict=True)]
    every = [part for each in parts for part in each]
    rate = float(np.sqrt(np.mean([part.rate**2 for part in every])))
    reach = np.exp(prior.log_frequency + 3.0 * prior.log_frequency_std * np.array([-1.0, 1.0]))
    low = max(min(part.frequency[0] for part in every), reach[0])
    high = min(FASTEST_HULL * max(part.frequency[-1] for part in every), reach[1])
    likelihoods = [SeaLikelihood(each, rate, prior, should_cancel) for each in parts]
    number = sum(map(len, parts)) if len(records) == 1 else len(records)
    fits = 1 + (number if checks_parts and number > 1 else 0)

    def fitted(place: int, of: Sequence[SeaLikelihood]):
        return hull_posterior(of, prior, low, high, lambda share: report((place + share) / fits))

    found = fitted(0, likelihoods)
    if not found.is_smooth and any(record.heave is not None for record in records):
        # the vertical acceleration that does not explain the excitation is left out
        without = [replace(record, heave=None) for record in records]
        return identify_seas(
            without, prior, searched=searched, checks_parts=checks_parts, progress=progress, should_cancel=should_cancel
        )
    # apart: the parts of one record, or several records
    apart = [SeaLikelihood([part], rate, prior, should_cancel) for part in every] if len(records) == 1 else likelihoods
    alone = [fitted(place, [each]) for place, each in enumerate(apart, 1)] if fits > 1 else []
    holds_decay = not searched and any(bool(find_decays(record.motion)) for record in records)
    return _identification(records, seas, likelihoods, found, _apart(alone), holds_decay)


def prior_of(identified: IdentifiedModel, motion: AxisMotion) -> SeaHullPrior:
    """What a model of an earlier release says of the hull in a motion of this size."""
    size = EQUIVALENT * np.nanstd(motion.primary)
    if motion.angle is None:
        size /= identified.model.natural_frequency
    curves = amplitude_curves(identified.model.ratios, np.array([size]), identified.model.friction_rate)
    frequency, damping = float(curves.frequency[0]), float(curves.damping_ratio[0])
    if not (np.isfinite(frequency) and damping > 0.0):
        return SeaHullPrior()
    return SeaHullPrior(float(np.log(damping)), DAMPING_KNOWN, float(np.log(frequency)), FREQUENCY_KNOWN)


def turns_of(trial: Trial) -> tuple[float, ...]:
    """Times, s, at which a craft took another heading, by its yaw rate, which may have a bias."""
    if trial.heading is None:
        return ()
    heading = trial.heading[:, 1]
    places = np.linspace(0, trial.time.size - 1, min(trial.time.size, 1000)).astype(int)
    turns: list[float] = []
    for turn in _turns(trial.time[places], heading[places]):
        # a slow turn is one, too
        if not turns or turn - turns[-1] > 0.1 * np.ptp(trial.time):
            turns.append(turn)
    return tuple(turns)


def _turns(time: np.ndarray, heading: np.ndarray) -> list[float]:
    """The time of the largest step of a heading with a drift, and those before and after it."""
    places = np.linspace(0, time.size, 102).astype(int)[1:-1]
    if time.size < 2 * places.size:
        return []
    drift = np.stack([np.ones(time.size), time - time[0]], axis=1)
    found = []
    for place in places:
        steps = np.column_stack([drift, np.arange(time.size) >= place])
        fit, residual, *_ = np.linalg.lstsq(steps, heading, rcond=None)
        found.append((float(residual[0]) if residual.size else np.inf, abs(float(fit[2])), place))
    left, step, place = min(found)
    if step < max(TURN, 3.0 * np.sqrt(left / time.size)):
        return []
    halves = slice(None, place), slice(place, None)
    before, after = (_turns(time[half], heading[half]) for half in halves)
    return [*before, float(time[place]), *after]


def parts_of(sea: SeaMotion, record: SeaRecord) -> list[SeaPart]:
    """The spectra of the parts of a motion; parts that hold too few waves, or only calm, are left out."""
    end = sea.start + sea.duration
    inner = record.bounds or tuple(np.linspace(sea.start, end, PARTS + 1)[1:-1])
    bounds = [sea.start, *(each for each in sorted(inner) if sea.start < each < end), end]
    long = [pair for pair in pairwise(bounds) if pair[1] - pair[0] >= MIN_WAVES / PARTS * 2.0 * np.pi / sea.peak]
    parts = [sea_part(sea.between(*pair), record.heave) for pair in long or [(sea.start, end)]]
    # calm is clear of the noise in a single band at most
    waves = [part for part in parts if part.frequency.size > 1]
    if not waves:
        raise _too_few_waves(sea, record.motion.axis)
    return waves


def _apart(alone: Sequence[FrequencyPosterior]) -> float:
    """The largest difference of log frequencies over its standard deviation, between parts that were fitted alone."""
    found = [(each.mean[0], each.covariance[0, 0]) for each in alone]
    return max((abs(a[0] - b[0]) / np.sqrt(a[1] + b[1]) for a, b in combinations(found, 2)), default=0.0)


def sea_of(motion: AxisMotion) -> SeaMotion:
    """The motion in waves, with enough of them to separate hull and sea."""
    sea = sea_motion(motion)
    if sea.duration * sea.peak < 2.0 * np.pi * MIN_WAVES:
        raise _too_few_waves(sea, motion.axis)
    return sea


def _too_few_waves(sea: SeaMotion, axis: str) -> InputError:
    period = 2.0 * np.pi / sea.peak
    # one at each end is left out
    needed = np.ceil((MIN_WAVES + 2) * period)
    short = Advice.of('too-few-waves', axis=axis, duration=sea.duration, period=period, needed=needed)
    return InputError(short.message, short.code)


def _identification(
    records: Sequence[SeaRecord],
    seas: Sequence[SeaMotion],
    likelihoods: Sequence[SeaLikelihood],
    found: FrequencyPosterior,
    apart: float,
    holds_decay: bool,
) -> AtSeaIdentification:
    axis, (log_frequency, log_damping) = records[0].motion.axis, found.mean
    frequency, damping = float(np.exp(log_frequency)), float(np.exp(log_damping))
    period, duration = 2.0 * np.pi / frequency, sum(sea.duration for sea in seas)
    highest = max(part.frequency[-1] for each in likelihoods for part in each.parts)
    if found.weight[found.log_frequency > np.log(0.95 * highest)].sum() > 0.5:
        raise InputError(
            f'the {axis} follows the waves as far as it is known (down to periods of '
            f'{2.0 * np.pi / highest:.3g} s), so the natural period is shorter and stays hidden: record '
            'in shorter waves, with a quieter sensor, or a free decay in still water'
        )
    if damping * frequency * duration < MIN_FADING:
        raise InputError(
            f'the {axis} oscillates with a period of {period:.3g} s like a pure tone, as in regular waves, '
            'which say nothing about the damping: give motion in irregular waves, or record a free decay in still water'
        )
    b1, r1 = 2.0 * damping * frequency, frequency**2
    # derivatives of b1 and r1 by log frequency and log damping
    slopes = np.array([[b1, b1], [2.0 * r1, 0.0]])
    spectra = _spectra(likelihoods, found, frequency)
    strongest = max(spectra, key=lambda each: each.fitted_excitation.max())
    motion = float(np.mean([sea.angle.var() for sea in seas]))
    waves = float(np.mean([sea.angle.var() * (1.0 - sea.slow_share) for sea in seas]))
    amplitude, variance = EQUIVALENT * np.sqrt(waves), 0.0
    for each in spectra:
        # variance of a variance: 2 pi / T int S^2 (one-sided)
        variance += float(np.gradient(each.frequency) @ each.measured**2) * 2.0 * np.pi * len(spectra) / duration
    own, measured = np.array([-period, damping]), [sea.mean for sea in seas if not np.isnan(sea.mean)]
    trim = float(np.mean(measured)) if measured else 0.0
    return AtSeaIdentification(
        model=DecayModel.from_terms(EQUATIONS['linear'], {'b1': b1, 'r1': r1}, trim=trim, axis=axis),
        natural_period=period,
        natural_period_std=float(period * np.sqrt(found.covariance[0, 0])),
        damping_ratio=damping,
        damping_ratio_std=float(damping * np.sqrt(found.covariance[1, 1])),
        amplitude=float(amplitude),
        amplitude_std=float(0.5 * EQUIVALENT**2 * np.sqrt(variance) / len(spectra) / amplitude),
        trim_std=_trim_std(spectra, seas, duration) if measured else float('nan'),
        estimate_covariance=found.covariance * np.outer(own, own),
        covariance=slopes @ found.covariance @ slopes.T,
        roughness=float(found.roughness @ ROUGHNESS),
        is_smooth=found.is_smooth,
        apart=float(apart),
        sea=likelihoods[0].waves.name,
        peak_period=2.0 * np.pi / float(strongest.frequency[strongest.fitted_excitation.argmax()]),
        duration=float(duration),
        slow_share=1.0 - waves / motion,
        spectra=spectra,
        motions=tuple(record.motion for record in records),
        holds_decay=holds_decay,
    )


def _trim_std(spectra: Sequence[FittedSpectra], seas: Sequence[SeaMotion], duration: float):
    """Of the mean angle, rad: its variance is pi / T S(0)."""
    slow = [each.measured[each.frequency <= max(0.5 * seas[0].peak, each.frequency[0])] for each in spectra]
    return float(np.sqrt(np.pi / duration * np.median(np.concatenate(slow))))


def _spectra(likelihoods: Sequence[SeaLikelihood], found: FrequencyPosterior, frequency: float):
    """Measured and fitted spectra of every part at the most likely natural frequency."""
    spectra, best = [], int(found.weight.argmax())
    for likelihood, optima in zip(likelihoods, found.optima, strict=True):
        roughness = int(optima.log_evidence[:, best].argmax())
        fits = likelihood.fitted(found.log_frequency[best], optima.z[roughness, best], ROUGHNESS[roughness])
        for part, (fitted, response) in zip(likelihood.parts, fits, strict=True):
            # the response is one at rest: times the stiffness the excitation is the moment over inertia
            own = frequency**4 / response
            excitation = own * part.spectrum, own * np.maximum(fitted - part.noise, 0.0)
            spectra.append(FittedSpectra(part.frequency, part.spectrum, fitted, *excitation))
    return tuple(spectra)
