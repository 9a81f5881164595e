"""From the filters and the past to calibrated forecasts at every lead.

Six experts forecast each axis: its mean, constant rate, the hull alone, the waves (a regression on
all channels), the axis by itself (a regression on its own past), and the hull driven by the moments
of the waves.  Their past errors weigh them lead
by lead and calibrate the result.  What an expert lacks (a hull, enough past, a gap-free stretch)
only takes that expert away.  In still water the hull alone forecasts (`Stillness`).
"""
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from swath_sysid.motion.trial import AXES
from swath_sysid.prediction.calibration import NORMAL_QUANTILES, Calibrator
from swath_sysid.prediction.combination import Combiner
from swath_sysid.prediction.forecast import AxisForecast, Forecast
from swath_sysid.prediction.free_forecast import carry_on, longest_horizon_step, spread_table
from swath_sysid.prediction.history import History
from swath_sysid.prediction.quiescence import Quiescence
from swath_sysid.prediction.stillness import Stillness
from swath_sysid.prediction.waves import CHANNELS, WaveRequest

EXPERTS = ('mean', 'constant-rate', 'hull', 'waves', 'axis-alone', 'hull-and-waves')
MEAN, RATE, HULL, WAVES, ALONE, HULL_AND_WAVES = range(len(EXPERTS))

_FINEST = 0.009
_ACTIVITY_TIME = 5.0
_LEAST_ACTIVITY = 1e-4
_LARGEST_FORECAST = math.pi
_PRIOR_TRUST = 5.0
_EARLY = 5.0
_INFANCY = 60.0
_FOREIGN = 0.04
_IDLE_TIME_A_ROW = 0.02
_FASTEST_EVEN = 0.05


_COLUMNS = len(EXPERTS)
COMBINED, ANGLE, RATE_TOLD, DEVIATION, QUANTILES, ACTIVITY, CLAIM, NOMINAL, LEVEL, MEAN_LEVEL, PAST_LEVEL, STILL = (
    *range(_COLUMNS, _COLUMNS + 5), *range(_COLUMNS + 7, _COLUMNS + 14)
)  # fmt: skip
_WIDTH = STILL + 1


class _Issued(NamedTuple):
    """A forecast whose errors are not all known yet: everything of it by axis and lead, in columns."""

    stamp: float
    table: np.ndarray


class Forecaster:
    """Forecasts of both axes.

    Parameters
    ----------
    settings : PredictorSettings
    filters : dict of str to AttitudeFilter
        By axis; read, never changed.
    """

    def __init__(self, settings, filters):
        self.settings = settings
        self._filters = filters
        self._leads = np.array(settings.leads)
        count = round(settings.horizon / settings.horizon_step)
        self._horizon = settings.horizon_step * np.arange(1, count + 1)
        self._all = np.unique(np.round(np.concatenate([self._leads, self._horizon]), 9))
        self._at_leads = np.searchsorted(self._all, self._leads - 1e-6)
        self._at_horizon = np.searchsorted(self._all, self._horizon - 1e-6)
        # weights change over ratios of leads, deviations grow from now on
        self._between = _interpolation(np.log(self._leads), np.log(self._all))
        self._from_now = _interpolation(np.concatenate([[0.0], self._leads]), self._all)
        shape = len(AXES), self._leads.size
        self._combiner = Combiner(*shape, len(EXPERTS), settings.skill_memory, 2.0 + self._leads)
        # errors of another kind in still water: intervals of their own
        self._calibrator = Calibrator((2, *shape))
        self._stillness = [
            Stillness(self._leads, settings.skill_memory, settings.filter.disturbance_initial) for _ in AXES
        ]
        self._history = History(settings.window + 2.0 * self._all[-1] + 10.0, _FINEST, len(CHANNELS) + 2)
        limits = settings.quiescence
        self._quiescence = None if limits is None else Quiescence(limits, self._horizon)
        self._steps = {}
        self._tables = {}
        self._fit = self._waiting = None
        self._usable = set()
        self._pace = {}
        self.clear()

    def clear(self):
        """Forget the past motion (the clock has jumped); what was learnt of the sea stays."""
        self._history.clear()
        if self._quiescence is not None:
            self._quiescence.clear()
        self._issued = []
        self._first_issued = 0
        self._next_due = np.zeros(self._leads.size, dtype=int)
        self._last = math.nan
        self._begun = math.nan
        self._refit_due = -math.inf
        self._lowpass = [math.nan] * 3
        self._mean = np.full(len(AXES), math.nan)
        self._variance = np.zeros(len(AXES))
        self._rate_square = np.zeros(len(AXES))
        self._acceleration_square = np.zeros(len(AXES))
        self._activity_square = np.zeros(len(AXES))
        self._joint = np.zeros((len(AXES), self._leads.size, 3))
        self._joint_time = np.zeros((len(AXES), self._leads.size))

    def set_model(self, axis):
        """Take notice of the filter's new model."""
        attitude, place = self._filters[axis], AXES.index(axis)
        self._tables[axis] = spread_table(attitude.model, self.settings.filter.disturbance_time, self._leads)
        self._steps.clear()
        self._pace[axis] = _natural_frequency(attitude.model)
        for expert in (HULL, HULL_AND_WAVES):
            self._combiner.forget_expert(place, expert)
            for issued in self._issued:
                # what the hull before it foretold says nothing of this one
                issued.table[place, :, expert] = math.nan
                issued.table[place, :, CLAIM] = 0.0
        self._stillness[place].forget()
        self._find_usable()
        self._refit_due = -math.inf

    def take(self, sample, interval, estimates):
        """Remember a sample.

        Parameters
        ----------
        sample : ImuSample
        interval : float
            The sensor's usual interval, s.
        estimates : dict of str to AttitudeEstimate
        """
        stamp = sample.stamp
        fast = interval <= 0.5 / self.settings.excitation_rate
        row = [math.nan] * 9
        for place, axis in enumerate(AXES):
            estimate = estimates.get(axis)
            if estimate is None:
                continue
            angle, rate = sample[1 + place], sample[3 + place]
            trusted = not estimate.rejected
            known = estimate.angle_variance < 0.02
            if fast or not trusted:
                row[place] = estimate.angle if known else math.nan
                row[place + 2] = estimate.rate
            else:
                row[place] = angle if angle == angle else (estimate.angle if known else math.nan)
                row[place + 2] = rate
            row[place + 7] = (angle if angle == angle else row[place]) if trusted else math.nan
        gain = min(1.0, 2.0 * interval * self.settings.excitation_rate) if fast else 1.0
        for k in range(3):
            value, before = sample[5 + k], self._lowpass[k]
            if value == value:
                before = value if before != before else before + gain * (value - before)
                self._lowpass[k] = before
                row[4 + k] = before
        self._history.append(stamp, row)
        if self._begun != self._begun:
            self._begun = stamp

    def install(self, fit):
        """Use a fit from its stamp plus ``refit_delay`` on.

        Parameters
        ----------
        fit : WaveFit
        """
        self._waiting = fit

    def refit_request(self, stamp, interval):
        """The window to fit, when a fit is due at this stamp; else None.

        Returns
        -------
        WaveRequest or None
        """
        s = self.settings
        elapsed = stamp - self._begun
        if stamp < self._refit_due or elapsed < s.first_refit:
            return None
        step = self._grid_step()
        count = int(min(s.window, elapsed) / step + 1e-6) + 1
        # a fit costs in proportion to its rows: the background is to be idle nearly always
        self._refit_due = stamp + max(s.refit_interval, _IDLE_TIME_A_ROW * count)
        if count < 20:
            return None
        values = self._history.back(step, count, interval)[::-1, :len(CHANNELS)]
        models = {axis: f.model for axis, f in self._filters.items() if f.has_model and f.is_started}
        trims = {axis: float(self._filters[axis].x[2]) for axis in models}
        return WaveRequest(stamp, step, values, self._all, models, trims, s.excitation)

    def _grid_step(self):
        target = 1.0 / self.settings.excitation_rate
        usual = float(np.median(np.diff(self._history.time[-200:])))
        if usual < 0.25 * target:
            return target
        # a slow sensor: whole intervals, so that lags fall on samples
        return round(max(1, round(target / usual)) * usual, 4)

    def issue(self, stamp, interval):
        """Score what has become known, then forecast.

        Parameters
        ----------
        stamp, interval : float
            Now, and the sensor's usual interval, s.

        Returns
        -------
        at_leads, over_horizon : Forecast
        """
        elapsed = stamp - self._last if self._last == self._last else 0.0
        elapsed = min(elapsed, 2.0)
        self._last = stamp
        if self._waiting is not None and stamp >= self._waiting.stamp + self.settings.refit_delay - 1e-9:
            self._adopt()
        self._follow_motion(stamp, elapsed)
        self._score(stamp, interval, elapsed)
        self._follow_excitation(stamp, elapsed)
        angles, rates = self._experts(interval)
        activity = np.maximum(np.sqrt(self._activity_square), _LEAST_ACTIVITY)
        spread = {
            axis: table.covariance(self._filters[axis].P, self._filters[axis].disturbance_variance)
            for axis, table in self._tables.items()
        }  # fmt: skip
        nominal = self._nominal(angles, spread) / activity[:, None, None] ** 2
        weights, variance = self._combiner.follow(nominal)
        angle, rate = _combine(angles, rates, weights, self._between)
        deviation = np.sqrt(np.maximum(variance, 1e-12)) * activity[:, None]
        at = self._at_leads
        combined = angle[:, at]
        claims, believed, nominal, hull_deviation = self._still(deviation**2)
        is_still = believed > 0.5
        if believed.any():
            share = believed @ self._between.T
            angle = np.where(share > 0.0, angle + share * (angles[:, HULL] - angle), angle)
            rate = np.where(share > 0.0, rate + share * (rates[:, HULL] - rate), rate)
            deviation = np.where(is_still, believed * hull_deviation + (1.0 - believed) * deviation, deviation)
        quantiles = np.where(is_still[..., None], self._calibrator.quantiles[1], self._calibrator.quantiles[0])
        table = np.empty((len(AXES), self._leads.size, _WIDTH))
        table[:, :, :_COLUMNS] = angles[:, :, at].transpose(0, 2, 1)
        table[:, :, COMBINED], table[:, :, ANGLE], table[:, :, RATE_TOLD] = combined, angle[:, at], rate[:, at]
        table[:, :, DEVIATION], table[:, :, QUANTILES:ACTIVITY] = deviation, quantiles
        table[:, :, ACTIVITY], table[:, :, STILL] = activity[:, None], is_still
        table[:, :, CLAIM], table[:, :, NOMINAL] = claims, nominal
        for place, stillness in enumerate(self._stillness):
            table[place, :, LEVEL] = stillness.excitation_variance
            table[place, :, MEAN_LEVEL] = stillness.mean_level
            table[place, :, PAST_LEVEL] = stillness.past_level
        self._issued.append(_Issued(stamp, table))
        at_leads, over_horizon = self._as_forecasts(stamp, angle, rate, deviation[..., None] * quantiles, spread)
        if self._quiescence is None:
            return at_leads, over_horizon
        quiet = self._stays_quiet(over_horizon, activity, interval)
        return replace(at_leads, quiescence=quiet), replace(over_horizon, quiescence=quiet)

    def _follow_excitation(self, stamp, elapsed):
        for (axis, attitude), stillness in zip(self._filters.items(), self._stillness, strict=True):
            if attitude.is_started and attitude.has_model:
                stillness.follow(
                    stamp, elapsed, float(attitude.x[3]), float(attitude.P[3, 3]), attitude.disturbance_variance,
                    2.0 * math.pi / self._pace[axis],
                )  # fmt: skip

    def _still(self, combination):
        """Whether the water is still: claimed and believed, and the hull's nominal and likely deviation, (A, L)."""
        claims, believed, nominal, deviation = np.zeros((4, len(AXES), self._leads.size))
        for place, axis in enumerate(AXES):
            attitude = self._filters[axis]
            if not (attitude.is_started and attitude.has_model):
                continue
            covariance, stillness = attitude.P, self._stillness[place]
            if not stillness.is_conceivable:
                continue
            # of the disturbance that is believed in here, all is to come
            covariance = covariance.copy()
            covariance[3] = covariance[:, 3] = 0.0
            covariance[3, 3] = level = stillness.excitation_variance
            variance = self._tables[axis].covariance(covariance, level)[:, 0, 0] + 1e-12
            nominal[place], deviation[place] = np.sqrt(variance), np.sqrt(variance * stillness.scale)
            claims[place] = stillness.claims(deviation[place] ** 2, combination[place])
            believed[place] = claims[place] * stillness.trust
        return claims, believed, nominal, deviation

    def _stays_quiet(self, horizon, activity, interval):
        motion, deviation = np.full((2, self._horizon.size, len(AXES), 2), np.nan)
        for place, axis in enumerate(AXES):
            told = horizon.axes.get(axis)
            if told is not None:
                motion[:, place] = np.column_stack([told.angle, told.rate])
                deviation[:, place] = np.sqrt(told.covariance[:, (0, 1), (0, 1)])
        tolerance = 0.6 * interval
        self._quiescence.learn(
            horizon.stamp, lambda stamps: self._history.at(stamps, tolerance)[:, [[7, 2], [8, 3]]]
        )
        return self._quiescence.probability(horizon.stamp, motion, deviation, activity)

    def set_quiescence(self, limits):
        """Other limits of quiescence over the same duration."""
        self._quiescence.set_limits(limits)

    def quiescence_reliability(self):
        """How the told probabilities came true so far; None where no limits are configured."""
        return None if self._quiescence is None else self._quiescence.record.diagram()

    def _adopt(self):
        fit, self._waiting = self._waiting, None
        if self._fit is None or self._fit.hulls.keys() != fit.hulls.keys():
            self._steps.clear()
        self._fit = fit
        self._find_usable()

    def _find_usable(self):
        """The axes whose hull is still the one that the fit knew."""
        hulls = {} if self._fit is None else self._fit.hulls
        self._usable = {axis for axis, model in hulls.items() if self._filters[axis].model == model}

    def _follow_motion(self, stamp, elapsed):
        """Running mean, size and speed of the motion."""
        age = stamp - self._begun
        slow = min(1.0, elapsed / min(self.settings.window, age + _EARLY))
        quick = min(1.0, max(elapsed / _ACTIVITY_TIME, elapsed / age if age > 0.0 else 1.0))
        for place, axis in enumerate(AXES):
            attitude = self._filters[axis]
            if not attitude.is_started:
                continue
            angle, rate, trim, disturbance = attitude.x.tolist()
            acceleration = disturbance + float(attitude.model.acceleration(angle + attitude.model.trim - trim, rate))
            if self._mean[place] != self._mean[place]:
                # before anything is known of it, the craft is taken to lie at the trim it was identified at
                self._mean[place] = trim
            self._mean[place] += slow * (angle - self._mean[place])
            square = (angle - self._mean[place]) ** 2
            self._variance[place] += slow * (square - self._variance[place])
            self._rate_square[place] += slow * (rate * rate - self._rate_square[place])
            self._acceleration_square[place] += quick * (acceleration**2 - self._acceleration_square[place])
            # both halves of the oscillation's energy, so that the size does not swing with the phase
            share = self._variance[place] / self._rate_square[place] if self._rate_square[place] > 0.0 else 0.0
            size = 0.5 * (square + share * rate * rate)
            self._activity_square[place] += quick * (size - self._activity_square[place])

    def _score(self, stamp, interval, elapsed):
        """Errors of the forecasts whose time has come."""
        tolerance = (0.6 if interval <= _FASTEST_EVEN else 0.25) * interval
        for _ in range(3):
            due, records = [], []
            for lead in range(self._leads.size):
                place = self._next_due[lead] - self._first_issued
                if place < len(self._issued) and self._issued[place].stamp + self._leads[lead] <= stamp + 1e-6:
                    due.append(lead)
                    records.append(self._issued[place])
                    self._next_due[lead] += 1
            if not due:
                break
            self._learn(due, records, tolerance, elapsed)
        done = int(self._next_due.min()) - self._first_issued
        if done > 0:
            del self._issued[:done]
            self._first_issued += done

    def _learn(self, due, records, tolerance, elapsed):
        stamps = np.full(self._leads.size, np.nan)
        table = np.full((len(AXES), self._leads.size, _WIDTH), np.nan)
        for lead, record in zip(due, records, strict=True):
            stamps[lead] = record.stamp
            table[:, lead] = record.table[:, lead]
        truth = np.full((self._leads.size, 4), np.nan)
        truth[due] = self._history.at(stamps[due] + self._leads[due], tolerance)[:, (7, 8, 2, 3)]
        activity = table[:, :, ACTIVITY]
        missed = table[:, :, :QUANTILES]
        missed[:, :, :RATE_TOLD] -= truth.T[:2, :, None]
        missed[:, :, RATE_TOLD] -= truth.T[2:]
        over_deviation = missed[:, :, ANGLE] / table[:, :, DEVIATION]
        missed[:, :, :DEVIATION] /= activity[:, :, None]
        self._combiner.learn(missed[:, :, :_COLUMNS], elapsed)
        still = table[:, :, STILL] == 1.0
        calm = still
        if (table[:, :, CLAIM] > 0.0).any():
            calm = still & self._learn_stillness(table, stamps, elapsed)
        issued = table[:, :, QUANTILES:ACTIVITY]
        self._calibrator.learn(np.where((~still, calm), over_deviation, np.nan), issued, elapsed)
        angle, rate = missed[:, :, ANGLE], missed[:, :, RATE_TOLD]
        products = np.stack((angle * angle, angle * rate, rate * rate), axis=2)
        whole = np.isfinite(products[:, :, 1])
        self._joint_time += elapsed * whole
        gain = elapsed / np.maximum(np.minimum(self.settings.skill_memory, self._joint_time), 1e-9) * whole
        products[~whole] = 0.0
        self._joint += gain[:, :, None] * (products - self._joint)

    def _learn_stillness(self, table, stamps, elapsed):
        """Score the claims of still water; whether it has stayed still since, shape (A, L)."""
        stayed = np.zeros(table.shape[:2], dtype=bool)
        for place, stillness in enumerate(self._stillness):
            rows = table[place]
            claims = np.nan_to_num(rows[:, CLAIM])
            if claims.any():
                stayed[place] = stillness.learn(
                    claims, stamps, rows[:, LEVEL], rows[:, MEAN_LEVEL], rows[:, PAST_LEVEL], rows[:, HULL],
                    rows[:, COMBINED], rows[:, HULL] * rows[:, ACTIVITY] / np.maximum(rows[:, NOMINAL], 1e-9), elapsed,
                )  # fmt: skip
        return stayed

    def _experts(self, interval):
        """Forecasts of every expert: angles and rates, shape (A, E, leads), NaN where there is none."""
        angles = np.full((len(AXES), len(EXPERTS), self._all.size), np.nan)
        rates = np.full_like(angles, np.nan)
        waves, alone, moments = self._waves_ahead(interval)
        for place, axis in enumerate(AXES):
            attitude = self._filters[axis]
            if not attitude.is_started:
                continue
            angle, rate, trim, disturbance = attitude.x.tolist()
            angles[place, MEAN], rates[place, MEAN] = self._mean[place], 0.0
            if self._last - self._begun < _INFANCY or not (place in waves or place in alone):
                # a regression knows all that a constant rate does, once it has seen enough
                angles[place, RATE], rates[place, RATE] = angle + rate * self._all, rate
            if attitude.has_model:
                state = angle, rate, trim
                step, fade = self._grid_of(axis)
                # what is no larger than its own uncertainty is mostly noise, and none of it is to come
                level = self._stillness[place].excitation_variance
                moment = disturbance * level / (level + float(attitude.P[3, 3]))
                angles[place, HULL], rates[place, HULL] = self._carry(axis, state, moment * fade, step)
                if axis in moments:
                    angles[place, HULL_AND_WAVES], rates[place, HULL_AND_WAVES] = self._carry(
                        axis, state, moments[axis], self._fit.step
                    )
            for expert, ahead in ((WAVES, waves), (ALONE, alone)):
                if place in ahead:
                    angles[place, expert] = ahead[place]
                    given = ahead.get(place + len(AXES))
                    rates[place, expert] = np.gradient(ahead[place], self._all) if given is None else given
        # a runaway must not reach the average through a small weight
        np.clip(angles, -_LARGEST_FORECAST, _LARGEST_FORECAST, out=angles)
        return angles, rates

    def _waves_ahead(self, interval):
        """What the fit foretells: motion and motion of each axis alone, by channel; moments, by axis."""
        fit = self._fit
        if fit is None:
            return {}, {}, {}
        rows = min(fit.reach, int((self._history.time[-1] - self._history.time[0]) / fit.step + 1e-6) + 1)
        lags = self._history.back(fit.step, rows, interval)[:, :len(CHANNELS)]
        moments = None
        usable = self._usable
        if usable:
            moments = fit.moments_ahead(lags, {axis: float(self._filters[axis].x[2]) for axis in fit.hulls})
        moments = {} if moments is None else {
            axis: column for axis, column in zip(fit.hulls, moments.T, strict=True) if axis in usable
        }  # fmt: skip
        return fit.motion_ahead(lags), fit.alone_ahead(lags), moments

    def _grid_of(self, axis):
        step = self.settings.horizon_step
        count = math.ceil(self._all[-1] / step - 1e-9)
        return step, np.exp(-step * (np.arange(count) + 0.5) / self.settings.filter.disturbance_time)

    def _carry(self, axis, state, moments, grid):
        """The hull's motion at all leads under moments given on a grid."""
        key = axis, grid
        if key not in self._steps:
            self._steps[key] = longest_horizon_step(self._filters[axis].model, grid), _hermite(self._all, grid)
        (step, per_grid), (before, values, slopes) = self._steps[key]
        angles, rates = carry_on(self._filters[axis].model, *state, moments, step, per_grid)
        fine = (
            values[0] * angles[before] + values[1] * angles[before + 1]
            + grid * (slopes[0] * rates[before] + slopes[1] * rates[before + 1])
        )  # fmt: skip
        return fine, values[2] * rates[before] + values[3] * rates[before + 1]

    def _nominal(self, angles, spread):
        """Variance expected of each expert before any experience, shape (A, L, E)."""
        leads = self._leads
        nominal = np.full((len(AXES), leads.size, len(EXPERTS)), np.nan)
        for place, axis in enumerate(AXES):
            attitude = self._filters[axis]
            if not attitude.is_started:
                continue
            p = attitude.P
            # a mean of a few seconds may be off by all that the craft can swing from here
            x, w = attitude.x[0] - attitude.x[2], attitude.x[1] / self._pace[axis]
            early = _EARLY / (_EARLY + self._last - self._begun)
            nominal[place, :, MEAN] = self._variance[place] + early * (x * x + w * w) + 1e-8
            strayed = 0.25 * leads**4 * self._acceleration_square[place]
            nominal[place, :, RATE] = p[0, 0] + leads**2 * p[1, 1] + strayed
            if attitude.has_model:
                # before anything is known, most of what is seen is taken for the hull's own motion
                own = self._pace[axis] ** 4 * (x * x + w * w)
                excess = max(attitude.disturbance_variance - _FOREIGN * own, 0.0)
                nominal[place, :, HULL] = (
                    spread[axis][:, 0, 0] - excess * self._tables[axis].by_disturbance[:, 0, 0]
                )  # fmt: skip
            for expert, error in self._told_errors(place):
                nominal[place, :, expert] = error**2 + p[0, 0]
        nominal[np.isnan(angles[:, :, self._at_leads].transpose(0, 2, 1))] = np.nan
        return nominal

    def _told_errors(self, place):
        """Errors at the leads that the fit itself expects of its experts."""
        fit = self._fit
        if fit is None:
            return
        if fit.motion is not None and place in fit.targets:
            error = fit.motion.error[self._at_leads, fit.targets.index(place)]
            yield WAVES, error
            # the regression of the moments tells no errors of the motion: those of the motion's stand in
            yield HULL_AND_WAVES, error
        if place in fit.alone:
            error = fit.alone[place].error[self._at_leads, 0]
            yield ALONE, error
            if fit.motion is None:
                yield HULL_AND_WAVES, error

    def _as_forecasts(self, stamp, angle, rate, widths, spread):
        at_leads, over_horizon = {}, {}
        for place, axis in enumerate(AXES):
            attitude = self._filters[axis]
            if not attitude.is_started:
                continue
            now = math.sqrt(attitude.P[0, 0]) * NORMAL_QUANTILES, math.sqrt(attitude.P[1, 1])
            correlation, rate_deviation = self._rate_spread(place, spread[axis])
            rows = np.empty((self._leads.size + 1, 5))
            rows[0, :3], rows[0, 3], rows[0, 4] = *now, correlation[0]
            rows[1:, :3], rows[1:, 3], rows[1:, 4] = widths[place], rate_deviation, correlation
            rows = self._from_now @ rows
            covariance = _covariance(rows[:, 1] / NORMAL_QUANTILES[1], rows[:, 3], rows[:, 4])
            for places, told in ((self._at_leads, at_leads), (self._at_horizon, over_horizon)):
                told[axis] = AxisForecast(
                    angle[place, places], rate[place, places], covariance[places], rows[places, :3]
                )
        return Forecast(stamp, self._leads, at_leads), Forecast(stamp, self._horizon, over_horizon)

    def _rate_spread(self, place, prior):
        """Correlation of angle and rate errors and deviation of the rate's, at the leads."""
        prior = prior.reshape(-1, 4)[:, [0, 1, 3]]
        size = max(self._activity_square[place], _LEAST_ACTIVITY**2)
        known = self._joint_time[place][:, None]
        joint = (self._joint[place] * size * known + prior * _PRIOR_TRUST) / (known + _PRIOR_TRUST)
        correlation = joint[:, 1] / np.sqrt(np.maximum(joint[:, 0] * joint[:, 2], 1e-30))
        return np.clip(correlation, -0.99, 0.99), np.sqrt(np.maximum(joint[:, 2], 0.0))

    @property
    def weights(self):
        """Weights of the experts, shape (A, L, E)."""
        return self._combiner.weights

    @property
    def coverage(self):
        """Share of the 50, 90 and 99 % intervals that have held, shape (A, L, 3)."""
        held, count = self._calibrator.held.sum(axis=0), self._calibrator.count.sum(axis=0)
        with np.errstate(invalid='ignore', divide='ignore'):
            return held / count[..., None]

    @property
    def skill(self):
        """Running error over the running size of the motion, shape (A, L): below one is better than the mean."""
        size = np.sqrt(np.maximum(self._variance, _LEAST_ACTIVITY**2) / np.maximum(
            self._activity_square, _LEAST_ACTIVITY**2))
        with np.errstate(invalid='ignore'):
            running = np.where(self._joint_time > 0.0, self._joint[:, :, 0], np.nan)
        return np.sqrt(running) / size[:, None]

    @property
    def has_waves(self):
        """Whether a fit of the waves is in use."""
        return self._fit is not None and self._fit.motion is not None


def _interpolation(known, wanted):
    """Matrix that interpolates linearly from the known places to the wanted ones."""
    return np.array([np.interp(wanted, known, unit) for unit in np.eye(known.size)]).T


def _natural_frequency(model):
    """rad/s; one where no hull tells it."""
    stiffness = -float(model.jacobian(model.trim, 0.0)[0])
    return math.sqrt(stiffness) if stiffness > 0.01 else 1.0


def _hermite(leads, grid):
    """Places and weights of cubic Hermite interpolation of values, and linear of slopes."""
    position = leads / grid
    before = np.floor(position + 1e-9).astype(int)
    last = math.ceil(leads[-1] / grid - 1e-9)
    before = np.minimum(before, last - 1)
    t = position - before
    values = ((1 + 2 * t) * (1 - t) ** 2, t**2 * (3 - 2 * t), 1 - t, t)
    return before, values, (t * (1 - t) ** 2, t**2 * (t - 1))


def _combine(angles, rates, weights, between):
    """Weighted angle and rate at all leads, from weights at the scored ones."""
    known = np.isfinite(angles)
    spread = weights.transpose(0, 2, 1) @ between.T * known
    spread /= np.maximum(spread.sum(axis=1, keepdims=True), 1e-30)
    return (
        (spread * np.where(known, angles, 0.0)).sum(axis=1),
        (spread * np.where(np.isfinite(rates), rates, 0.0)).sum(axis=1),
    )


def _covariance(angle_deviation, rate_deviation, correlation):
    covariance = np.empty((angle_deviation.size, 2, 2))
    covariance[:, 0, 0] = angle_deviation**2
    covariance[:, 1, 1] = rate_deviation**2
    covariance[:, 0, 1] = covariance[:, 1, 0] = correlation * angle_deviation * rate_deviation
    return covariance
