"""From samples to calibrated forecasts: one hull filter per axis, state spaces of all channels, and their average.

The bank's candidates are weighted at each lead by their measured errors; a candidate is dropped when the newest samples
contradict it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter, itemgetter
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.stamps import STEPPED
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.bank import HULLS, Bank, ForecasterDiagnostics, diagnose
from swath_sysid.attitude.prediction.candidate import Candidate
from swath_sysid.attitude.prediction.forecast import Forecast, Wanted
from swath_sysid.attitude.prediction.hull_filter import CONVINCING, ExcitationRequest, HullFilterSettings
from swath_sysid.attitude.prediction.hull_watch import HullLook
from swath_sysid.attitude.prediction.memories import LONGEST_BRIDGED, NEW_SEA, WELL_LEARNT
from swath_sysid.attitude.prediction.outlook import CalmForecaster, ErrorLimit, Outlook, PointForecaster, ValidLeads
from swath_sysid.attitude.prediction.point import ATTITUDE, Point, PointMotion
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits, Reliability
from swath_sysid.attitude.prediction.rows import (
    CHANNELS,
    OF_CHANNELS,
    OF_MEANS,
    OF_SAMPLE,
    ROWS_A_PERIOD,
    RowClock,
    Sampled,
)
from swath_sysid.attitude.prediction.sea_fit import LONG_WAVES, SPARSE, WAVES, SeaFit, SeaRequest, newest_motion
from swath_sysid.attitude.prediction.sea_memory import MEMORY, SeaMemory
from swath_sysid.attitude.prediction.sea_state import SeaReport
from swath_sysid.attitude.prediction.state_space import InnovationsModel
from swath_sysid.attitude.prediction.time_scale import TimeScale, period_of
from swath_sysid.attitude.prediction.unmeasured_angle import Gravity
from swath_sysid.attitude.prediction.upstream import PastRows
from swath_sysid.attitude.prediction.variate_analysis import MAX_LAGS
from swath_sysid.common.conventions import THREE_STD
from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError

#: Of a sample: angle, rate, the variances of their noise, and the rate as the gyroscope has it.
_OF_AXIS = {
    axis: itemgetter(
        *(CraftSample._fields.index(axis + part) for part in ('', '_rate', '_variance', '_rate_variance', '_gyro'))
    )
    for axis in AXES
}

_force_of = itemgetter(*(CraftSample._fields.index(f'accel_{axis}') for axis in 'xyz'))

SEA_STATE_INTERVAL = 60.0  #: s.

MOST_AHEAD = 2000  #: Rows that the longest lead may be.

_SAME_LEAD = 1e-6  # s

#: Of a past, after which what is learnt of it is learnt anew; periods at most and, for the first forecasts, at least.
_REFIT_SHARE, _LONGEST_REFIT_INTERVAL = 0.2, 6.2


@checked
@dataclass(frozen=True)
class ForecasterSettings:
    """What is forecast, and how the sea is learnt.

    Raises:
        InputError: The leads do not increase, a time is not positive, or the horizon is shorter than its step or the
            duration of quiescence.

    Example:
        >>> ForecasterSettings(leads=(1.0, 2.0), forecast_rate=2.0).horizon
        5.0
    """

    #: s, increasing; the leads that are scored and calibrated.
    leads: tuple[float, ...] = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
    horizon: float = 5.0  #: s.
    horizon_step: float = 0.1  #: s.
    forecast_rate: float = 10.0  #: Forecasts per second (never more often than samples come).
    window: float = 375.0  #: Periods of the motion; the past that the sea is learnt from.
    first_refit: float = 2.5  #: Periods; when the sea is first learnt.
    refit_interval: float = 1.6  #: Periods; the least time between fits.
    refit_delay: float = 0.5  #: s from a request's stamp to its fit's use: the time that the background has for it.
    hull: HullFilterSettings = HullFilterSettings()
    quiescence: QuiescenceLimits | None = None  #: Limits whose probability of being kept is forecast; None: it is not.
    points: tuple[Point, ...] = ()  #: Where vertical motion is forecast, too.
    valid_error: ErrorLimit = ErrorLimit()  #: Of the expected error, up to which a forecast is trusted.
    upstream: tuple[str, ...] = ()  #: Names of scalar series that show waves on their way to the craft.
    #: Candidates of one's own by name, each begun for rows of a step in a motion of a period, both s.
    candidates: Mapping[str, Callable[[float, float], Candidate]] = field(default_factory=dict, hash=False)

    def __post_init__(self):
        if not self.leads or any(not b > a for a, b in zip((0.0, *self.leads), self.leads, strict=False)):
            raise InputError(f'leads must be positive and increasing, not {self.leads}')
        for name in ('horizon', 'horizon_step', 'forecast_rate', 'window', 'first_refit', 'refit_interval'):
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


class ForecastStep(NamedTuple):
    """The results of one sample."""

    reasons: tuple[str, ...] = ()  #: From `PIPELINE_REASONS`: what was counted.
    sample: CraftSample | None = None  #: None where it was left out.
    lost: int = 0  #: Samples that should have come before it; minus one where it is one that was taken for lost.
    next: Forecast | None = None  #: One sample ahead.
    forecast: Forecast | None = None  #: At the leads, when due and wanted.
    horizon: Forecast | None = None  #: Over the horizon, when due and wanted or learnt from.
    outlook: Outlook | None = None  #: Of the horizon.
    #: To be fitted by `fit_sea`, in the background or at once; the result is for `ForecastPipeline.install`.
    sea_request: SeaRequest | None = None
    sea: SeaReport | None = None  #: Of the sea state, once a minute.

    @property
    def used(self) -> bool:
        """Whether the sample was used."""
        return self.sample is not None


class Forecaster:
    """Forecasts of both axes.

    Pure and causal: its time is the sum of what elapsed between samples.
    """

    def __init__(self, settings: ForecasterSettings | None = None) -> None:
        self.settings = s = settings or ForecasterSettings()
        self._axes = {axis: AxisFilter(s.hull, s.window) for axis in AXES}
        leads = np.array(s.leads)
        horizon = s.horizon_step * np.arange(1, round(s.horizon / s.horizon_step) + 1)
        self._leads = np.unique(np.round(np.concatenate([leads, horizon]), 9))
        self._asked, self._over_horizon = (_places_of(wanted, self._leads) for wanted in (leads, horizon))
        self._clock = RowClock()
        self._scale = TimeScale()
        self._gravity = Gravity()
        self._sampled = Sampled(0.0, 1)
        # the oldest forecast that is scored lies one longest lead behind the window
        capacity = math.ceil(s.window * ROWS_A_PERIOD * 1.25) + MOST_AHEAD
        self._rows = PastRows(s.upstream, capacity)
        axes = tuple(self._axes.values())
        self._points = PointForecaster(s.points, axes)
        self.quiescence = s.quiescence  #: The limits in use.
        self._calm = None if s.quiescence is None else CalmForecaster(s.quiescence, horizon, axes, self._points)
        self._valid_leads = ValidLeads(s.valid_error, axes, s.window)
        self._valid: dict[str, float] | None = {}  # s; None where they were not asked for
        self._time = self._rows_begun = self._laid_out_at = self._stamp = 0.0
        self._heading = 0.0, 0.0
        self._due = self._refit_due = self._sea_state_due = -math.inf
        self._looks = 0
        self._steps = 0  #: Since the newest row, where some are missing.
        self._bank: Bank | None = None
        self._first: CraftSample | None = None  #: Of the motion that is followed.
        self._believed: CraftSample | None = None  #: The newest one, about the level that the filters follow.
        self._waiting: SeaFit | None = None
        self.memory: SeaMemory | None = None  #: What a longer past has taught.

    # -- models and fits

    def set_model(self, axis: str, identified: IdentifiedModel | None) -> None:
        """Swap the hull of an axis under the running filter; None where none is known."""
        self._axes[axis].set_model(identified)
        if self._bank is not None:
            for name in HULLS:
                self._bank.try_anew(name, AXES.index(axis))
        self._refit_due = -math.inf

    def install(self, fit: SeaFit) -> None:
        """Use a fit of `fit_sea` from its request's time plus ``refit_delay`` on, live as offline.

        One of rows that have been laid out anew since is not used.
        """
        if fit.time >= self._laid_out_at:
            self._waiting = fit

    def set_quiescence(self, limits: QuiescenceLimits | None) -> None:
        """Forecast the probability of other limits over the configured duration; None: the configured ones."""
        if limits is not None and self._calm is not None:
            self.quiescence = limits
            self._calm.quiescence.set_limits(limits)

    def quiescence_reliability(self) -> Reliability | None:
        """Observed share of quiet against the probability issued; None where no limits are configured."""
        return None if self._calm is None else self._calm.quiescence.record.diagram()

    # -- samples

    def observe_upstream(self, name: str, stamp: float, value: float) -> None:
        """Take one sample of an upstream channel, stamped in s on the clock of `observe`'s stamps; NaN counts as lost.

        It may come late, and as often or seldom as it likes; what has come before a row is used from that row on.

        Raises:
            InputError: The settings have no channel of this name.
        """
        self._rows.take(name, stamp, value)

    def observe(
        self, sample: CraftSample, stamp: float, elapsed: float | None, count: int = 1, left_out: int = 0
    ) -> ForecastStep:
        """Take one sample, NaN where not measured, stamped in s, ``elapsed`` s after the one before.

        ``elapsed`` is None at the first sample and after the clock was set back; ``count`` messages have come since the
        one before, of which ``left_out`` were not wanted. The step holds what is known at once, the forecast one sample
        ahead; `issue` must complete it before the next sample.
        """
        # 1. when it was taken: a step of the clock is no time, and after a long silence the motion is another one
        since = math.inf if self._first is None or elapsed is None else elapsed
        usual = count * self._clock.interval
        is_step = self._first is not None and self._clock_has_stepped(sample, usual, since)
        if is_step:
            since = usual
        linked = since <= LONGEST_BRIDGED * self._scale.period
        self._stamp, self._sampled = stamp, Sampled(0.0, 1)
        if linked:
            self._sampled = self._clock.sensor.follow(since, 1 + left_out)
            self._time += self._sampled.elapsed
            self._lay_out()
        else:
            self._break_off()
            self._first = sample
        # 2. what of it is believed, by the filter of each axis
        sample, refused = self._follow_axes(sample, self._sampled, linked)
        self._believed = sample
        reasons = ((STEPPED,) if is_step else ()) + refused
        # 3. the heading is not forecast: the last one measured is held
        yaw, yaw_rate = self._heading
        self._heading = (
            sample.yaw if sample.yaw == sample.yaw else yaw,
            sample.yaw_rate if sample.yaw_rate == sample.yaw_rate else yaw_rate,
        )
        # 4. the forecast one sample ahead, and the sample about the sensor's own level
        ahead = None if self._bank is None else self._ahead(self._bank, sample.stamp_ns)
        for (name, axis), angle in zip(self._axes.items(), sample[1:3], strict=True):
            if axis.channels.level:
                rate = sample.roll_rate if name == AXES[0] else sample.pitch_rate
                sample = _with_motion(sample, name, angle + axis.channels.level, rate)
        return ForecastStep(reasons, sample, self._sampled.intervals - 1, ahead)

    def _clock_has_stepped(self, sample: CraftSample, usual: float, elapsed: float) -> bool:
        """Whether the motion has gone on by ``usual`` s only, while the stamps have by ``elapsed`` s."""
        if not abs(elapsed - usual) > self._scale.period / ROWS_A_PERIOD:
            return False
        elapsed = min(elapsed, LONGEST_BRIDGED * self._scale.period)
        evidence = 0.0
        for name, axis in self._axes.items():
            angle, rate, *_ = _OF_AXIS[name](sample)
            evidence += axis.evidence_of_step(angle - axis.channels.level, rate, usual, elapsed)
        return evidence > CONVINCING

    def issue(self, step: ForecastStep, wanted: Callable[[], Wanted] = Wanted) -> ForecastStep:
        """Complete the step of the newest sample with what is due then and ``wanted``, which takes longer."""
        sample, bank = step.sample, self._bank
        if sample is None or bank is None:
            return step
        # 1. a fit whose time has come, before the rows that follow it
        sea = self._take_over(bank)
        # 2. the rows that the sample completes
        filtered = [axis.motion if axis.hull.is_started else None for axis in self._axes.values()]
        unknown = [axis.unmeasured.is_unknown for axis in self._axes.values()]
        for age, row in self._clock.take(self._believed or sample, self._sampled, filtered, unknown):
            self._steps += 1
            if row is not None:
                self._take_row(bank, self._steps, self._stamp - age, row)
                self._steps = 0
        # 3. what is due; after missing rows the first one shows what can be forecast
        if self._time < self._due or self._steps:
            return step if sea is None else step._replace(sea=sea)
        bank = self._look_at_period(bank)
        self._schedule()
        forecast, horizon, outlook = self._issue(bank, sample.stamp_ns, wanted())
        request = self._sea_request()
        return step._replace(forecast=forecast, horizon=horizon, outlook=outlook, sea_request=request, sea=sea)

    def _break_off(self):
        """Forget the motion after a break; what is known of hull and sea stays."""
        self._due = -math.inf
        for axis in self._axes.values():
            axis.size.restart()
        if self._bank is not None:
            self._bank.reset()
            self._rows.break_off(2 * MAX_LAGS - 1)
            self._predict(self._bank, 2 * MAX_LAGS - 1)
        self._steps = 1
        self._clock.reset(is_next_row=False)
        if self._calm is not None:
            self._calm.quiescence.reset()

    def _follow_axes(self, sample: CraftSample, sampled: Sampled, linked: bool):
        """The sample as it is used from now on, what is stuck or rejected as not measured, and the reasons."""
        elapsed, even = sampled.elapsed, sampled.intervals == 1
        reasons: tuple[str, ...] = ()
        if any(axis.unmeasured.is_unknown for axis in self._axes.values()):
            self._gravity.take(_force_of(sample), elapsed, self._scale.period)
            levels = self._gravity.levels(self._scale.period)
            for axis, level in zip(self._axes.values(), levels, strict=False):
                axis.unmeasured.know_level(*level)
        for name, axis in self._axes.items():
            angle, rate, *reported, sensed = _OF_AXIS[name](sample)
            used = axis.believed(angle, rate, sensed, elapsed)
            found = axis.channels.findings(self._scale.period / math.tau)
            reasons += tuple(f'{each}-{name}' for each in found)
            rejected, restarted = axis.follow(*used, reported, elapsed, linked, even)
            if rejected:
                reasons += (f'outlier-{name}',) * ('outlier' not in found)
                used = math.nan, math.nan
            elif axis.reach is not None:
                axis.reach.add(sample.stamp, used[0])
            if restarted:
                reasons += (f'gate-restarted-{name}',)
            # a copy costs more than a look
            if used != (angle, rate):
                sample = _with_motion(sample, name, *used)
        if any(axis.channels.is_turned for axis in self._axes.values()):
            n = math.nan
            sample = sample._replace(yaw=n, yaw_rate=n, accel_x=n, accel_y=n, accel_z=n)
        elif any(axis.channels.wrong for axis in self._axes.values()):
            sample = sample._replace(yaw_rate=math.nan)
        return sample, reasons

    # -- rows

    def _lay_out(self):
        """Follow the sensor's interval and the motion's period with the step between rows."""
        before = self._clock.step
        if before != before:
            self._scale.expect(self._clock.interval)
            if self.memory is not None:
                self._scale.know(self.memory.period)
        if self._clock.is_laid_out_for(self._scale.period):
            if self._clock.corrected():
                self._begin_rows()
        elif self._clock.lay_out(self._scale.period):
            self._rows.lay_out(self._clock.step, self._clock.step / before)
            if before != before:
                self._rows_begun, self._sea_state_due = self._time, self._time + SEA_STATE_INTERVAL
                if self._clock.samples == 1 and self._first is not None:
                    self._rows.add(self._clock.first(self._first), self._stamp - self._sampled.elapsed)
            self._begin_rows()
        elif self._bank is not None:
            self._follow_period(self._bank)

    def _look_at_period(self, bank: Bank) -> Bank:
        """Find the period of the motion when it is time to; the bank that is used from now on."""
        age = self._time - self._rows_begun
        if self._scale.is_due(age):
            past, block = (int(length / self._clock.step) + 1 for length in self._scale.past(age))
            rows = self._rows.last(past)[:, OF_SAMPLE]
            count = len(AXES)
            noise = np.array([axis.noise for axis in self._axes.values()])
            found = period_of(rows[:, :count], rows[:, count:], self._clock.step, noise[:, 0], noise[:, 1], block)
            if self._scale.follow(found, age):
                self._lay_out()
        return self._bank or bank

    def _begin_rows(self):
        """Begin with another step, which makes all that was learnt in rows invalid."""
        step, before = self._clock.step, self._bank
        self._bank = Bank(tuple(self._axes.values()), self._leads, self._clock, self._rows, self.settings.candidates)
        if before is not None:
            self._bank.carry_over(before)
        self._points.begin(step, self._clock.period, math.ceil(self._leads[-1] / step) + 2)
        self._waiting, self._steps, self._laid_out_at = None, 0, self._time
        self._refit_due = -math.inf
        self._follow_period(self._bank)
        if self.memory is not None and (remembered := self.memory.candidate(self._clock.step)) is not None:
            self._bank.use(MEMORY, remembered, self._newest(2 * MAX_LAGS))

    def _follow_period(self, bank: Bank):
        """Count memories in the motion's period, and begin with the library of seas."""
        for axis in self._axes.values():
            axis.set_period(self._clock.period)
        bank.set_period(self._clock.period)
        bank.begin(self._newest(2 * MAX_LAGS))

    def _take_row(self, bank: Bank, steps: int, stamp: float, row: list[float]):
        """Take the next row, the given number of steps after the one before."""
        self._rows.add(row, stamp, steps)
        self._predict(bank, steps - 1)
        channels = np.array(row[OF_CHANNELS])
        bank.take(channels)
        if self._points.vertical is not None:
            self._points.vertical.take(channels, bank.waves)
        bank.score(np.array(row[OF_SAMPLE][: len(AXES)]))

    def _predict(self, bank: Bank, count: int):
        """Go on over so many missing rows."""
        if count > 0:
            bank.predict(count)
            if self._points.vertical is not None:
                self._points.vertical.predict(count, bank.waves)

    @property
    def _window(self):
        """Rows of the past that is learnt from."""
        return int(self.settings.window * self._clock.period / self._clock.step) + 1

    def _newest(self, count: int | None = None):
        return self._rows.last(count)[:, OF_CHANNELS]

    # -- what is learnt of the sea

    def _sea_request(self):
        """The past to learn from, when a fit is due; else None."""
        s, step, period, vertical = self.settings, self._clock.step, self._clock.period, self._points.vertical
        if self._time < self._refit_due or self._time - self._rows_begun < s.first_refit * period:
            return None
        # held and let go, a craft has hardly moved in that time
        largest = max((axis.size for axis in self._axes.values()), key=attrgetter('activity'))
        if largest.is_young and not (self._bank and self._bank.has_waves):
            return None
        # the information in a young fit grows quickly; one of a long past costs more and changes less
        share = min(_REFIT_SHARE * (self._time - self._rows_begun), _LONGEST_REFIT_INTERVAL * period)
        self._refit_due = self._time + max(s.refit_interval * period, share)
        if self._time < self._sea_state_due < self._refit_due:
            self._refit_due = self._sea_state_due
        past, excitations = self._newest(self._window).copy(), dict(self._excitation_requests())
        of_points = None if vertical is None else vertical.request(self._clock, self._rows.newest)
        is_due, look = self._time >= self._sea_state_due, self._next_look(excitations)
        upstream = self._rows.request(len(past), int(NEW_SEA * period / step), self._leads[-1] + step)
        return SeaRequest(self._time, step, period, CHANNELS, past, excitations, of_points, is_due, upstream, look)

    def _next_look(self, excitations: Mapping[str, ExcitationRequest]):
        """One axis in turn, as each look takes a while; by the whole past every third time."""
        self._looks += 1
        turn, place = divmod(self._looks, len(AXES))
        identified = self._axes[AXES[place]].identified
        if identified is None or AXES[place] not in excitations:
            return None
        return HullLook(AXES[place], identified, turn % 3 > 0)

    def _excitation_requests(self):
        step, samples = self._clock.step, self._clock.samples
        age = self._clock.since_row + 0.5 * (step - step / samples)
        rows = self._rows.last(self._window)[:, OF_MEANS]
        for place, (name, axis) in enumerate(self._axes.items()):
            # what is left without a noise that may be less is no moment of waves; a fit cannot end in a lost angle
            is_told = axis.hull.is_known or all(axis.known_noise)
            if axis.hull.is_started and is_told and not axis.unmeasured.is_missing:
                motion = newest_motion(rows[:, place :: len(AXES)].T, step, self._clock.period)
                hull = axis.hull.learnt_hull()
                of_angle, of_rate = (variance / samples for variance in axis.noise_to_hull)
                noise = of_angle, of_rate
                yield name, ExcitationRequest(*hull, step, self._clock.period, *motion, *noise, samples, age)

    def _take_over(self, bank: Bank) -> SeaReport | None:
        """Use a fit whose time has come; its report of the sea state."""
        fit = self._waiting
        if fit is None or self._time < fit.time + self.settings.refit_delay - 1e-9:
            return None
        self._waiting = None
        for name, model in fit.waves.items():
            # what a longer memory errs by is known from its fit before, which is nearly the same
            if name != LONG_WAVES or name not in bank.spaces:
                bank.try_anew(name)
            bank.use(name, model, self._newest(2 * SPARSE * MAX_LAGS))
        if WAVES in fit.waves and bank.waves is not None:
            self._remember(bank, fit.waves[WAVES], fit.time)
            if self._points.vertical is not None:
                self._points.vertical.install(fit.vertical, self._rows.newest, bank.waves)
        if fit.upstream:
            bank.use_upstream(fit.upstream, self._newest(), self._time, 0.5 * self.settings.window * self._clock.period)
        for name, excitation in fit.excitations.items():
            axis = self._axes[name]
            # unless the hull has become known meanwhile, or unknown
            if axis.hull.is_known == (excitation.stand_in is None):
                axis.hull.set_excitation(excitation, self._time - fit.time)
        if fit.change is not None:
            self._axes[fit.change.axis].watch.take(fit.change)
        if fit.sea is not None:
            self._sea_state_due += SEA_STATE_INTERVAL
        return fit.sea

    def _remember(self, bank: Bank, waves: InnovationsModel, time: float) -> None:
        """Keep a fit of a past up to a time, s, as the memory where it is as long; the old one has served then."""
        periods = min(self.settings.window, (time - self._rows_begun) / self._clock.period)
        if periods >= min(WELL_LEARNT, self.memory.periods if self.memory else 0.0):
            self.memory = SeaMemory(self._clock.period, periods, waves)
            bank.drop(MEMORY)

    # -- forecasts

    def _schedule(self):
        period = 1.0 / self.settings.forecast_rate
        slack = 0.25 * min(period, self._clock.interval)
        following = self._due + period
        self._due = following if self._time - slack < following <= self._time + period else self._time + period - slack

    def _ahead(self, bank: Bank, stamp_ns: int) -> Forecast:
        """One sample ahead, by the hulls' filters alone."""
        lead, size = self._clock.interval, len(ATTITUDE)
        mean, covariance = np.zeros((1, size)), np.zeros((1, size, size))
        for place, axis in enumerate(self._axes.values()):
            of_axis = slice(place, None, len(AXES))
            if axis.hull.is_started:
                mean[0, of_axis], covariance[0, of_axis, of_axis] = axis.hull.ahead(lead + self._clock.sensor.lateness)
                covariance[0, place, place] += axis.doubt_of_level
            else:
                mean[0, of_axis] = covariance[0, of_axis] = covariance[0, :, of_axis] = math.nan
        bank.limit(mean, covariance)
        return self._issued(Forecast(stamp_ns, np.array([lead]), mean, covariance), {})

    def _issued(self, attitude: Forecast, points: dict[str, PointMotion]) -> Forecast:
        """The forecast with heading and points: every one passes here."""
        a = attitude
        for place, axis in enumerate(self._axes.values()):
            level, variance = axis.channels.reading
            if level or variance:
                # no wilder than the motion
                most = THREE_STD * axis.size.extent
                a.mean[:, place] += min(max(level, -most), most)
                own = a.covariance[:, place, place]
                a.covariance[:, place, place] = np.maximum(own, np.minimum(own + variance, most * most))
        return Forecast(a.stamp_ns, a.leads, a.mean, a.covariance, self._heading, points, a.own_deviation)

    def _issue(
        self, bank: Bank, stamp_ns: int, wanted: Wanted
    ) -> tuple[Forecast | None, Forecast | None, Outlook | None]:
        """At the leads and over the horizon, as far as they are wanted or learnt from."""
        s, calm = self.settings, self._calm
        is_kept = calm is not None and calm.learn(self._time, self._rows, self._clock.step, self._clock.since_row)
        of_calm = calm is not None and (wanted.calm or is_kept)
        is_judged = of_calm or wanted.valid_leads
        is_whole = is_judged or wanted.horizon
        # by the first lead of the horizon, the size of the points' motion is followed
        furthest = math.inf if is_whole else max(wanted.lead, s.horizon_step if s.points else 0.0)
        whole, now = self._up_to(furthest, bank, stamp_ns, is_judged or wanted.points)
        self._valid_leads.follow(self._time, now)
        horizon = whole.chosen(self._over_horizon) if whole is not None and is_whole else None
        self._valid = None if horizon is None or not wanted.valid_leads else self._valid_leads.of(horizon)
        quiescence, window = math.nan, None
        if calm is not None and horizon is not None and of_calm:
            quiescence, window = calm.assess(self._time, horizon)
        elif calm is not None:
            calm.follow(self._time, now)
        outlook = None if horizon is None else Outlook(quiescence, window, self._valid or {})
        count = int(np.searchsorted(s.leads, wanted.lead + _SAME_LEAD))
        places = self._asked if count == len(s.leads) else np.arange(self._leads.size)[self._asked][:count]
        return whole.chosen(places) if whole is not None and count else None, horizon, outlook

    def _up_to(
        self, furthest: float, bank: Bank, stamp_ns: int, at_points: bool
    ) -> tuple[Forecast | None, dict[str, PointMotion]]:
        """At all leads up to the furthest, s, and how the points move at the first lead of the horizon."""
        since_row, lateness = self._clock.since_row, self._clock.sensor.lateness
        count = int(np.searchsorted(self._leads, furthest + _SAME_LEAD))
        if not count:
            return None, {}
        attitude = bank.forecast(stamp_ns, since_row, lateness, count)
        if not self.settings.points:
            return self._issued(attitude, {}), {}
        step, age = self.settings.horizon_step, since_row + lateness
        if not at_points:
            return self._issued(attitude, {}), self._points.forecast(attitude.at(step), age)
        whole = self._issued(attitude, self._points.forecast(attitude, age))
        return whole, whole.at(step).points

    # -- for people

    def diagnostics(self) -> ForecasterDiagnostics:
        """The running state, for operators."""
        count = len(self.settings.leads)
        state = diagnose(self._axes, self._bank, self._asked, count, self._clock.interval)
        valid = self._valid
        if valid is None and self._bank is not None:
            # nobody has asked for them since
            whole, _ = self._up_to(math.inf, self._bank, 0, True)
            valid = None if whole is None else self._valid_leads.of(whole.chosen(self._over_horizon))
        return replace(state, valid_leads=valid or {})


def _with_motion(sample: CraftSample, axis: str, angle: float, rate: float) -> CraftSample:
    """The sample with other angle and rate of an axis."""
    if axis == AXES[0]:
        return sample._replace(roll=angle, roll_rate=rate)
    return sample._replace(pitch=angle, pitch_rate=rate)


def _places_of(wanted: np.ndarray, leads: np.ndarray):
    """Of these among all leads; a slice where they are all, which takes no copy."""
    places = np.searchsorted(leads, wanted - _SAME_LEAD)
    return places if places.size < leads.size else slice(None)
