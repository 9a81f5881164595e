"""The predictor: samples in, estimates and forecasts out. Live node and play-through run this object."""
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.motion.trial import AXES
from swath_sysid.prediction.ekf import AttitudeEstimate, AttitudeFilter, FilterSettings
from swath_sysid.prediction.excitation import ExcitationSettings
from swath_sysid.prediction.forecast import AxisForecast, Forecast
from swath_sysid.prediction.forecaster import Forecaster
from swath_sysid.prediction.quiescence import QuiescenceLimits
from swath_sysid.prediction.sensor_noise import NoiseMeter
from swath_sysid.prediction.staleness import ModelWatch
from swath_sysid.prediction.waves import WaveRequest

NAN = math.nan

DUPLICATE = 'duplicate-stamp'
OUT_OF_ORDER = 'out-of-order'
NOT_FINITE = 'not-finite'
ABSURD = 'absurd-value'
JUMPED_BACK = 'clock-jumped-back'
GAP = 'gap-predicted-through'
LONG_GAP = 'gap-too-long'
REJECTED = {axis: f'outlier-{axis}' for axis in AXES}
RESTARTED = {axis: f'gate-restarted-{axis}' for axis in AXES}
REASONS = (
    DUPLICATE, OUT_OF_ORDER, NOT_FINITE, ABSURD, JUMPED_BACK, GAP, LONG_GAP, *REJECTED.values(), *RESTARTED.values()
)  # fmt: skip

_DROPPED = {DUPLICATE, OUT_OF_ORDER, NOT_FINITE, ABSURD}

LARGEST_ANGLE = 2.0 * math.pi
LARGEST_RATE = 40.0
LARGEST_ACCELERATION = 400.0
_LARGEST = (LARGEST_ANGLE,) * 2 + (LARGEST_RATE,) * 2 + (LARGEST_ACCELERATION,) * 3
LARGEST_STAMP = 1e11
FASTEST_INTERVAL = 1e-5
SLOWEST_INTERVAL = 10.0
_GAP_FACTOR = 2.5
_STUBBORN_STAMPS = 20
_FASTEST_GROWTH = 1.0 / 0.95


class ImuSample(NamedTuple):
    """One sample of the sensor. NaN marks what it does not measure, or does not tell.

    Attributes
    ----------
    stamp : float
        s, from the header.
    roll, pitch : float
        rad.
    roll_rate, pitch_rate : float
        Euler rates, rad/s.
    accel_x, accel_y, accel_z : float
        Specific force, m/s^2.
    roll_variance, pitch_variance : float
        rad^2.
    roll_rate_variance, pitch_rate_variance : float
        rad^2/s^2.
    """

    stamp: float
    roll: float = NAN
    pitch: float = NAN
    roll_rate: float = NAN
    pitch_rate: float = NAN
    accel_x: float = NAN
    accel_y: float = NAN
    accel_z: float = NAN
    roll_variance: float = NAN
    pitch_variance: float = NAN
    roll_rate_variance: float = NAN
    pitch_rate_variance: float = NAN


@dataclass(frozen=True)
class PredictorSettings:
    """How the predictor works.

    Attributes
    ----------
    filter : FilterSettings
    leads : tuple of float
        s, increasing; the leads that are scored and calibrated.
    horizon : float
        s.
    horizon_step : float
        s.
    forecast_rate : float
        Forecasts a second (never more often than samples come).
    gap_limit : float
        s; a longer silence restarts the filter.
    backward_jump : float
        s; a stamp further back than this is a new start of the clock, a nearer one is late.
    window : float
        s; the past that the waves are learnt from.
    excitation_rate : float
        Hz; the grid of the waves' regression (a slower sensor's own rate, where that is less).
    excitation : ExcitationSettings
    first_refit, refit_interval : float
        s; when the waves are first fitted, and the least time between fits (more for a long window).
    refit_delay : float
        s from a request's stamp to its fit's use: the time that the background has for it.
    skill_memory : float
        s; past errors that weigh and calibrate the forecasts are forgotten with this time constant.
    quiescence : QuiescenceLimits or None
        Limits whose probability of being kept is forecast; None: it is not.
    """

    filter: FilterSettings = field(default_factory=FilterSettings)
    leads: tuple[float, ...] = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
    horizon: float = 5.0
    horizon_step: float = 0.1
    forecast_rate: float = 10.0
    gap_limit: float = 1.0
    backward_jump: float = 1.0
    window: float = 600.0
    excitation_rate: float = 10.0
    excitation: ExcitationSettings = field(default_factory=ExcitationSettings)
    first_refit: float = 8.0
    refit_interval: float = 5.0
    refit_delay: float = 0.5
    skill_memory: float = 300.0
    quiescence: QuiescenceLimits | None = None

    def __post_init__(self):
        if not self.leads or any(not b > a for a, b in zip((0.0, *self.leads), self.leads, strict=False)):
            raise InputError(f'leads must be positive and increasing, not {self.leads}')
        for name in (
            'horizon', 'horizon_step', 'forecast_rate', 'gap_limit', 'backward_jump', 'window', 'excitation_rate',
            'first_refit', 'refit_interval', 'skill_memory',
        ):  # fmt: skip
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} must be positive, not {getattr(self, name)}')
        if self.horizon < self.horizon_step:
            raise InputError('horizon must be at least one horizon_step')
        if self.quiescence is not None and not self.horizon_step <= self.quiescence.duration <= self.horizon:
            raise InputError(
                f'quiescence over {self.quiescence.duration:g} s needs a horizon at least as long ({self.horizon:g} s) '
                f'and steps no longer ({self.horizon_step:g} s): lengthen the horizon or shorten the duration'
            )
        if not self.refit_delay >= 0.0:
            raise InputError(f'refit_delay must not be negative, not {self.refit_delay}')


class Ahead(NamedTuple):
    """What comes one sample later, as plain numbers.

    Attributes
    ----------
    lead : float
        s.
    axes : dict of str to tuple of 5 floats
        By axis: angle, rate, angle variance, covariance of angle and rate, rate variance.
    """

    lead: float
    axes: dict[str, tuple[float, float, float, float, float]]


class Step(NamedTuple):
    """What one sample led to.

    Attributes
    ----------
    stamp : float
        Of the sample.
    used : bool
        False: the sample was dropped, for the reason in ``reasons``.
    reasons : tuple of str
        From `REASONS`; what was counted.
    estimates : mapping of str to AttitudeEstimate
        By axis; empty where dropped.
    ahead : Ahead or None
        One sample ahead.
    forecast, horizon : Forecast or None
        At the configured leads and over the horizon, when due.
    refit : WaveRequest or None
        A window to fit: give it to `fit_waves` (in the background) and the result to `Predictor.install`.
    advice : tuple of Advice
    """

    stamp: float
    used: bool
    reasons: tuple[str, ...] = ()
    estimates: Mapping[str, AttitudeEstimate] = MappingProxyType({})
    ahead: Ahead | None = None
    forecast: Forecast | None = None
    horizon: Forecast | None = None
    refit: WaveRequest | None = None
    advice: tuple[Advice, ...] = ()

    @property
    def next(self):
        """One sample ahead, as a `Forecast` with one lead; None at the first sample."""
        if self.ahead is None:
            return None
        axes = {
            axis: AxisForecast.normal(np.array([angle]), np.array([rate]), np.array([[[first, both], [both, second]]]))
            for axis, (angle, rate, first, both, second) in self.ahead.axes.items()
        }
        return Forecast(self.stamp, np.array([self.ahead.lead]), axes)


@dataclass(frozen=True)
class PredictorDiagnostics:
    """The running state of a predictor, for people.

    Attributes
    ----------
    samples : int
        Used.
    counts : dict of str to int
        By reason.
    sample_interval : float
        s; NaN before the second sample.
    has_model : dict of str to bool
        By axis.
    nis_ratio : dict of str to float
        Innovations squared over their expectation, by axis; one is healthy.
    innovations_outside, innovations_alike : dict of str to float
        Share of the innovations beyond where 95 % are expected, and with the sign of the one before; 0.05 and
        0.5 are healthy.
    has_waves : bool
        Whether the waves have been fitted.
    skill : ndarray, shape (A, L)
        Running forecast error over the size of the motion, by axis and lead.
    coverage : ndarray, shape (A, L, 3)
        Share of the 50, 90 and 99 % intervals that have held.
    weights : ndarray, shape (A, L, E)
        What each of `forecaster.EXPERTS` contributes now.
    advice : tuple of Advice
    """

    samples: int
    counts: dict[str, int]
    sample_interval: float
    has_model: dict[str, bool]
    nis_ratio: dict[str, float]
    innovations_outside: dict[str, float]
    innovations_alike: dict[str, float]
    has_waves: bool
    skill: np.ndarray
    coverage: np.ndarray
    weights: np.ndarray
    advice: tuple[Advice, ...]


class Predictor:
    """Attitude of both axes, now and ahead, from the samples of an IMU.

    Pure and causal: time is the stamps; the same samples give the same numbers.

    Parameters
    ----------
    settings : PredictorSettings
    """

    def __init__(self, settings=None):
        self.settings = settings or PredictorSettings()
        self._filters = {axis: AttitudeFilter(self.settings.filter) for axis in AXES}
        s = self.settings.filter
        self._meters = {axis: (NoiseMeter(s.angle_noise), NoiseMeter(s.rate_noise)) for axis in AXES}
        self._watches = {axis: ModelWatch() for axis in AXES}
        self._foretold = {}
        self._counts = dict.fromkeys(REASONS, 0)
        self._samples = 0
        self._interval = NAN
        self._forecaster = Forecaster(self.settings, self._filters)
        self._restart_clock()
        for axis in AXES:
            self.set_model(axis, None)

    def _restart_clock(self):
        self._last = NAN
        self._stubborn = 0
        self._due = -math.inf

    def set_model(self, axis, model, largest_amplitude=math.inf):
        """Swap the hull of an axis under the running filter.

        Parameters
        ----------
        axis : str
        model : DecayModel or None
            None: none is known.
        largest_amplitude : float
            The largest that the model was identified at, rad.
        """
        if axis not in AXES:
            raise InputError(f"there is no axis '{axis}': choose one of {', '.join(AXES)}")
        self._filters[axis].set_model(model)
        self._forecaster.set_model(axis)
        self._watches[axis].restart(largest_amplitude)

    def install(self, fit):
        """Take in the fit of a window that a `Step` asked for.

        It is used from its stamp plus ``refit_delay`` on, so that a live run whose background is quick
        enough forecasts what an offline run does.

        Parameters
        ----------
        fit : WaveFit
        """
        self._forecaster.install(fit)

    def observe(self, sample, on_ahead=None):
        """Take in one sample.

        Parameters
        ----------
        sample : ImuSample
        on_ahead : callable, optional
            Called with the `Ahead` of a used sample as soon as it is known: the leads take longer.

        Returns
        -------
        Step
        """
        stamp = sample.stamp
        reason, values = _quality(sample)
        if reason is None:
            reason = self._stamp_reason(stamp)
        if reason in _DROPPED:
            self._counts[reason] += 1
            return Step(stamp, False, (reason,))
        reasons = [] if reason is None else [reason]
        if reason == JUMPED_BACK:
            self._restart_clock()
            self._forecaster.clear()
        restart = reason in (JUMPED_BACK, LONG_GAP)
        elapsed = stamp - self._last
        if elapsed > 0.0:
            self._follow_interval(elapsed)
        self._last = stamp
        self._samples += 1
        estimates = self._estimate(stamp, values, sample, elapsed, restart, reasons)
        for counted in reasons:
            self._counts[counted] += 1
        ahead = self._ahead()
        if on_ahead is not None and ahead is not None:
            on_ahead(ahead)
        forecast = horizon = refit = None
        if estimates:
            interval = self._interval if self._interval == self._interval else SLOWEST_INTERVAL
            self._forecaster.take(sample, interval, estimates)
            if stamp >= self._due:
                self._schedule(stamp)
                forecast, horizon = self._forecaster.issue(stamp, interval)
                refit = self._forecaster.refit_request(stamp, interval)
        advice = ()
        for estimate in estimates.values():
            if estimate.advice:
                advice += estimate.advice
        return Step(stamp, True, tuple(reasons), estimates, ahead, forecast, horizon, refit, advice)

    def _stamp_reason(self, stamp):
        if self._last != self._last:
            return None
        elapsed = stamp - self._last
        if elapsed > 0.0:
            self._stubborn = 0
            interval = self._interval
            usual = interval if interval == interval else SLOWEST_INTERVAL
            if elapsed > max(self.settings.gap_limit, 5.0 * usual):
                return LONG_GAP
            return GAP if elapsed > _GAP_FACTOR * interval else None
        self._stubborn += 1
        if elapsed < -self.settings.backward_jump or self._stubborn >= _STUBBORN_STAMPS:
            return JUMPED_BACK
        return DUPLICATE if elapsed == 0.0 else OUT_OF_ORDER

    def _follow_interval(self, elapsed):
        # a step of at most 5 % towards the newest: one gap hardly moves it, a new rate is followed in 50 samples
        elapsed = min(max(elapsed, FASTEST_INTERVAL), SLOWEST_INTERVAL)
        if self._interval != self._interval:
            self._interval = elapsed
        else:
            self._interval *= min(max(elapsed / self._interval, 0.95), _FASTEST_GROWTH)

    def _schedule(self, stamp):
        period = 1.0 / self.settings.forecast_rate
        slack = 0.25 * min(period, self._interval if self._interval == self._interval else period)
        following = self._due + period
        self._due = following if stamp - slack < following <= stamp + period else stamp + period - slack

    def _estimate(self, stamp, values, sample, elapsed, restart, reasons):
        estimates = {}
        interval = self._interval
        even = 0.7 * interval < elapsed < 1.5 * interval
        for index, (axis, attitude) in enumerate(self._filters.items()):
            angle, rate = values[index], values[index + 2]
            is_started = attitude.is_started
            if not is_started and angle != angle and rate != rate:
                continue
            angle_variance, rate_variance = sample[8 + index], sample[10 + index]
            if not (even and angle_variance > 0.0 and rate_variance > 0.0):
                angle_variance, rate_variance = self._noise(axis, angle, rate, angle_variance, rate_variance, even)
            if restart or not is_started:
                attitude.start(stamp, angle, rate, angle_variance, rate_variance)
                estimates[axis] = attitude.estimate(restarted=True)
                continue
            estimate = attitude.observe(stamp, angle, rate, angle_variance, rate_variance, interval)
            estimates[axis] = estimate
            foretold = self._foretold.get(axis)
            if even and estimate.measured and foretold is not None:
                innovation = rate - foretold[1] if rate == rate else angle - foretold[0]
                self._watches[axis].take(
                    elapsed, estimate.nis, estimate.measured, innovation, estimate.angle - estimate.trim
                )
            if estimate.rejected:
                reasons.append(REJECTED[axis])
            elif estimate.restarted:
                reasons.append(RESTARTED[axis])
        return estimates

    def _noise(self, axis, angle, rate, angle_variance, rate_variance, even):
        """The sensor's own variances, or what the meters say where it does not tell."""
        by_angle, by_rate = self._meters[axis]
        if not even:
            by_angle.restart()
            by_rate.restart()
        return (
            angle_variance if angle_variance > 0.0 else by_angle.take(angle),
            rate_variance if rate_variance > 0.0 else by_rate.take(rate),
        )

    def _ahead(self):
        lead = self._interval
        if lead != lead:
            return None
        self._foretold = {axis: f.moments_ahead(lead) for axis, f in self._filters.items() if f.is_started}
        return Ahead(lead, self._foretold)

    def set_quiescence(self, limits):
        """Ask for the probability of keeping other limits, over the duration that was configured.

        Parameters
        ----------
        limits : QuiescenceLimits
        """
        self._forecaster.set_quiescence(limits)

    def quiescence_reliability(self):
        """How the told probabilities of quiescence came true so far.

        Returns
        -------
        Reliability or None
            None where no limits are configured.
        """
        return self._forecaster.quiescence_reliability()

    def diagnostics(self):
        """The running state, for people.

        Returns
        -------
        PredictorDiagnostics
        """
        started = {axis: f for axis, f in self._filters.items() if f.is_started}
        advice = tuple(
            Advice('no-model', f'no {axis} model has arrived, so the forecast is constant rate: identify the hull')
            for axis, attitude in started.items()
            if not attitude.has_model
        )
        advice += tuple(told for axis, f in started.items() if f.has_model for told in self._watches[axis].advice(axis))
        return PredictorDiagnostics(
            self._samples,
            dict(self._counts),
            self._interval,
            {axis: f.has_model for axis, f in self._filters.items()},
            {axis: f.nis_ratio for axis, f in started.items()},
            {axis: self._watches[axis].outside for axis in started},
            {axis: self._watches[axis].alike for axis in started},
            self._forecaster.has_waves,
            self._forecaster.skill,
            self._forecaster.coverage,
            self._forecaster.weights.copy(),
            advice,
        )


def _quality(sample):
    """Reason to drop a sample (None: good) and its seven values."""
    if not -LARGEST_STAMP < sample[0] < LARGEST_STAMP:
        return (ABSURD if math.isfinite(sample[0]) else NOT_FINITE), ()
    values = sample[1:8]
    roll, pitch, roll_rate, pitch_rate, *accelerations = values
    if (
        -LARGEST_ANGLE <= roll <= LARGEST_ANGLE and -LARGEST_ANGLE <= pitch <= LARGEST_ANGLE
        and -LARGEST_RATE <= roll_rate <= LARGEST_RATE and -LARGEST_RATE <= pitch_rate <= LARGEST_RATE
        and -LARGEST_ACCELERATION <= min(accelerations) and max(accelerations) <= LARGEST_ACCELERATION
    ):  # fmt: skip
        return None, values
    return _quality_of_each(values)


def _quality_of_each(values):
    useful = False
    for value, largest in zip(values, _LARGEST, strict=True):
        if value != value:
            continue
        if not -largest <= value <= largest:
            return (NOT_FINITE if math.isinf(value) else ABSURD), ()
        useful = True
    return (None, values) if useful else (NOT_FINITE, ())
