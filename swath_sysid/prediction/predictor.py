"""The predictor: samples in, estimates and forecasts out. Live node and play-through run this object."""
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.motion.trial import AXES
from swath_sysid.prediction.ekf import AttitudeEstimate, AttitudeFilter, FilterSettings
from swath_sysid.prediction.free_forecast import carry_on, longest_horizon_step, spread_table
from swath_sysid.prediction.sensor_noise import NoiseMeter

NAN = math.nan
CENTRAL_INTERVALS = (0.5, 0.9, 0.99)
_NORMAL_QUANTILES = np.array([0.6744897501960817, 1.6448536269514722, 2.5758293035489004])

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

LARGEST_ANGLE = 2.0 * math.pi
LARGEST_RATE = 40.0
LARGEST_ACCELERATION = 400.0
_LARGEST = (LARGEST_ANGLE,) * 2 + (LARGEST_RATE,) * 2 + (LARGEST_ACCELERATION,) * 3
LARGEST_STAMP = 1e11
FASTEST_INTERVAL = 1e-5
SLOWEST_INTERVAL = 10.0
_GAP_FACTOR = 2.5
_STUBBORN_STAMPS = 20


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
    """

    filter: FilterSettings = field(default_factory=FilterSettings)
    leads: tuple[float, ...] = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
    horizon: float = 5.0
    horizon_step: float = 0.1
    forecast_rate: float = 10.0
    gap_limit: float = 1.0
    backward_jump: float = 1.0

    def __post_init__(self):
        if not self.leads or any(not b > a for a, b in zip((0.0, *self.leads), self.leads, strict=False)):
            raise InputError(f'leads must be positive and increasing, not {self.leads}')
        for name in ('horizon', 'horizon_step', 'forecast_rate', 'gap_limit', 'backward_jump'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} must be positive, not {getattr(self, name)}')
        if self.horizon < self.horizon_step:
            raise InputError('horizon must be at least one horizon_step')


@dataclass(frozen=True)
class AxisForecast:
    """The forecast of one axis at L leads.

    Attributes
    ----------
    angle, rate : ndarray, shape (L,)
        rad, rad/s.
    covariance : ndarray, shape (L, 2, 2)
        Of angle and rate.
    half_width : ndarray, shape (L, 3)
        Half widths of the central 50, 90 and 99 % intervals of the angle, rad.
    """

    angle: np.ndarray
    rate: np.ndarray
    covariance: np.ndarray
    half_width: np.ndarray


@dataclass(frozen=True)
class Forecast:
    """Forecasts issued at one stamp.

    Attributes
    ----------
    stamp : float
        When issued, s; entry i is for ``stamp + leads[i]``.
    leads : ndarray, shape (L,)
        s.
    axes : dict of str to AxisForecast
        The axes that the sensor gives.
    """

    stamp: float
    leads: np.ndarray
    axes: dict[str, AxisForecast]


@dataclass(frozen=True)
class Step:
    """What one sample led to.

    Attributes
    ----------
    stamp : float
        Of the sample.
    used : bool
        False: the sample was dropped, for the reason in ``reasons``.
    reasons : tuple of str
        From `REASONS`; what was counted.
    estimates : dict of str to AttitudeEstimate
        By axis; empty where dropped.
    next : Forecast or None
        One sample ahead (one lead).
    forecast, horizon : Forecast or None
        At the configured leads and over the horizon, when due.
    advice : tuple of Advice
    """

    stamp: float
    used: bool
    reasons: tuple[str, ...] = ()
    estimates: dict[str, AttitudeEstimate] = field(default_factory=dict)
    next: Forecast | None = None
    forecast: Forecast | None = None
    horizon: Forecast | None = None
    advice: tuple[Advice, ...] = ()


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
    advice : tuple of Advice
    """

    samples: int
    counts: dict[str, int]
    sample_interval: float
    has_model: dict[str, bool]
    nis_ratio: dict[str, float]
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
        self._counts = dict.fromkeys(REASONS, 0)
        self._samples = 0
        self._grid = self.settings.horizon_step
        self._grid_count = math.ceil(max(self.settings.horizon, self.settings.leads[-1]) / self._grid - 1e-9)
        self._grid_leads = self._grid * np.arange(self._grid_count + 1)
        self._leads = np.array(self.settings.leads)
        self._tables = {}
        self._interval = NAN
        self._restart_clock()
        for axis in AXES:
            self.set_model(axis, None)

    def _restart_clock(self):
        self._last = NAN
        self._stubborn = 0
        self._due = -math.inf

    def set_model(self, axis, model):
        """Swap the hull of an axis under the running filter.

        Parameters
        ----------
        axis : str
        model : DecayModel or None
            None: none is known.
        """
        if axis not in AXES:
            raise InputError(f"there is no axis '{axis}': choose one of {', '.join(AXES)}")
        attitude = self._filters[axis]
        attitude.set_model(model)
        tau = self.settings.filter.disturbance_time
        self._tables[axis] = (
            longest_horizon_step(attitude.model, self._grid),
            spread_table(attitude.model, tau, self._grid, self._grid_count),
        )

    def observe(self, sample):
        """Take in one sample.

        Parameters
        ----------
        sample : ImuSample

        Returns
        -------
        Step
        """
        stamp = sample.stamp
        reason, values = _quality(sample)
        if reason is None:
            reason = self._stamp_reason(stamp)
        if reason in (DUPLICATE, OUT_OF_ORDER, NOT_FINITE, ABSURD):
            self._counts[reason] += 1
            return Step(stamp, False, (reason,))
        reasons = [] if reason is None else [reason]
        if reason == JUMPED_BACK:
            self._restart_clock()
        restart = reason in (JUMPED_BACK, LONG_GAP)
        elapsed = stamp - self._last
        if elapsed > 0.0:
            self._follow_interval(elapsed)
        self._last = stamp
        self._samples += 1
        estimates = self._estimate(stamp, values, sample, elapsed, restart, reasons)
        for counted in reasons:
            self._counts[counted] += 1
        forecast = horizon = None
        if stamp >= self._due and estimates:
            self._schedule(stamp)
            forecast, horizon = self._forecasts(stamp)
        advice = tuple(a for e in estimates.values() for a in e.advice)
        return Step(stamp, True, tuple(reasons), estimates, self._next(stamp), forecast, horizon, advice)

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
            self._interval *= min(max(elapsed / self._interval, 0.95), 1.0 / 0.95)

    def _schedule(self, stamp):
        period = 1.0 / self.settings.forecast_rate
        slack = 0.25 * min(period, self._interval if self._interval == self._interval else period)
        following = self._due + period
        self._due = following if stamp - slack < following <= stamp + period else stamp + period - slack

    def _estimate(self, stamp, values, sample, elapsed, restart, reasons):
        estimates = {}
        for index, axis in enumerate(AXES):
            angle, rate = values[index], values[index + 2]
            attitude = self._filters[axis]
            if not attitude.is_started and angle != angle and rate != rate:
                continue
            even = 0.7 * self._interval < elapsed < 1.5 * self._interval
            angle_variance, rate_variance = self._noise(
                axis, angle, rate, sample[8 + index], sample[10 + index], even
            )
            if restart or not attitude.is_started:
                attitude.start(stamp, angle, rate, angle_variance, rate_variance)
                estimates[axis] = attitude.estimate(restarted=True)
                continue
            attitude.advance(elapsed)
            attitude.stamp = stamp
            estimate = attitude.correct(angle, rate, angle_variance, rate_variance)
            estimates[axis] = estimate
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

    def _next(self, stamp):
        lead = self._interval
        if lead != lead:
            return None
        axes = {}
        for axis, attitude in self._filters.items():
            if attitude.is_started:
                angle, rate, covariance = attitude.ahead(lead)
                width = math.sqrt(covariance[0, 0]) * _NORMAL_QUANTILES
                axes[axis] = AxisForecast(np.array([angle]), np.array([rate]), covariance[None], width[None])
        return Forecast(stamp, np.array([lead]), axes)

    def _forecasts(self, stamp):
        """At the leads and over the horizon."""
        at_leads, over_horizon = {}, {}
        count = round(self.settings.horizon / self._grid)
        for axis, attitude in self._filters.items():
            if not attitude.is_started:
                continue
            angles, rates, covariance = self._hull_alone(axis)
            over_horizon[axis] = _axis_forecast(angles[1:count + 1], rates[1:count + 1], covariance[1:count + 1])
            place = self._leads / self._grid
            at_leads[axis] = _axis_forecast(
                np.interp(place, np.arange(angles.size), angles),
                np.interp(place, np.arange(angles.size), rates),
                _interpolate_rows(covariance, place),
            )
        return (
            Forecast(stamp, self._leads, at_leads),
            Forecast(stamp, self._grid_leads[1:count + 1], over_horizon),
        )

    def _hull_alone(self, axis):
        attitude = self._filters[axis]
        (step, per_grid), table = self._tables[axis]
        angle, rate, trim, disturbance = attitude.x.tolist()
        decay = np.exp(-self._grid_leads / self.settings.filter.disturbance_time)
        if not attitude.has_model:
            # a disturbance that is the whole acceleration says nothing for longer than a sample
            disturbance = 0.0
        angles, rates = carry_on(attitude.model, angle, rate, trim, (disturbance * decay).tolist(), step, per_grid)
        return angles, rates, table.covariance(attitude.P, attitude.disturbance_variance)

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
        return PredictorDiagnostics(
            self._samples,
            dict(self._counts),
            self._interval,
            {axis: f.has_model for axis, f in self._filters.items()},
            {axis: f.nis_ratio for axis, f in started.items()},
            advice,
        )


def _quality(sample):
    """Reason to drop a sample (None: good) and its seven values."""
    if not -LARGEST_STAMP < sample.stamp < LARGEST_STAMP:
        return (ABSURD if math.isfinite(sample.stamp) else NOT_FINITE), ()
    values = sample[1:8]
    useful = False
    for value, largest in zip(values, _LARGEST, strict=True):
        if value != value:
            continue
        if not -largest <= value <= largest:
            return (NOT_FINITE if math.isinf(value) else ABSURD), ()
        useful = True
    return (None, values) if useful else (NOT_FINITE, ())


def _axis_forecast(angle, rate, covariance):
    width = np.sqrt(covariance[:, 0, 0])[:, None] * _NORMAL_QUANTILES
    return AxisForecast(angle, rate, covariance, width)


def _interpolate_rows(rows, place):
    before = np.minimum(place.astype(int), rows.shape[0] - 2)
    fraction = (place - before)[:, None, None]
    return (1.0 - fraction) * rows[before] + fraction * rows[before + 1]
