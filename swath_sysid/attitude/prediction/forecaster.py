"""From samples to calibrated forecasts: one hull filter per axis, state spaces of all channels, and their average.

The candidates are an oscillator per axis, for the first minute; the hull filter (constant rate without a hull); and a
state space of all channels per memory. They are weighted at each lead by their measured errors; a candidate is dropped
when the newest samples contradict it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.blend import Blend
from swath_sysid.attitude.prediction.forecast import AxisForecast, Forecast
from swath_sysid.attitude.prediction.hull_filter import HullFilter, HullFilterSettings
from swath_sysid.attitude.prediction.oscillator import oscillators
from swath_sysid.attitude.prediction.point import ATTITUDE, Point, PointMotion, point_motion
from swath_sysid.attitude.prediction.quiescence import (
    AT_A_POINT,
    Quiescence,
    QuiescenceLimits,
    Reliability,
    quantity_at,
)
from swath_sysid.attitude.prediction.sea_fit import (
    ALL_CHANNELS,
    EACH_ALONE,
    SEA_MODELS,
    SHORT_MEMORY,
    SeaFit,
    SeaRequest,
    newest_stretch,
)
from swath_sysid.attitude.prediction.sea_state import SeaReport
from swath_sysid.attitude.prediction.sensor_noise import AgreementMeter, NoiseMeter
from swath_sysid.attitude.prediction.state_space import InnovationsFilter, InnovationsModel
from swath_sysid.attitude.prediction.vertical import FORCE, VerticalForecaster, VerticalRequest
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer

#: Channels that may show the waves; a record without some is forecast from the others.
CHANNELS = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'yaw_rate', 'accel_x', 'accel_y', 'accel_z', 'heave')

AXIS_OF_TARGET = (0, 1, 0, 1)

OSCILLATOR, HULL = 'oscillator', 'hull-filter'
#: Weights where errors do not distinguish them: largest for the one with the most information.
CANDIDATES = {OSCILLATOR: 0.3, HULL: 3.0, SHORT_MEMORY: 0.3, ALL_CHANNELS: 1.0, EACH_ALONE: 0.3}

_PLACE = {name: place for place, name in enumerate(CANDIDATES)}

REJECTED = {axis: f'outlier-{axis}' for axis in AXES}
RESTARTED = {axis: f'gate-restarted-{axis}' for axis in AXES}
FORECASTER_REASONS = (*REJECTED.values(), *RESTARTED.values())

ROW_RATE = 10.0  #: Hz; small craft move below 1.5 Hz. A slower sensor gives one row per sample.

#: s; after a longer silence the motion is forgotten, hull and sea are not.
LONGEST_BRIDGE = 60.0

#: Samples per row from which the rows hold filtered values: fewer cannot be smoothed without delay.
SMOOTHED_FROM = 5

#: First guess, least and most noise of sensors that do not report theirs, rad and rad/s.
ANGLE_NOISE, RATE_NOISE = (0.002, 1e-4, 0.02), (0.005, 1e-4, 0.05)

#: s; a longer window would gain less than the sea changes.
EXCITATION_WINDOW = 600.0

_channels_of = itemgetter(*[CraftSample._fields.index(name) for name in CHANNELS])

_ROW, _MEASURED_COUNT = len(CHANNELS), len(ATTITUDE)
_MEASURED = slice(_ROW, _ROW + _MEASURED_COUNT)
_BLOCK = slice(_ROW + _MEASURED_COUNT, _ROW + 2 * _MEASURED_COUNT)
_COLUMNS = _ROW + 2 * _MEASURED_COUNT
_VERTICAL = [CHANNELS.index(name) for name in (*AXES, *FORCE)]
_REGULAR = 0.5
_IRREGULAR_SAMPLES = 10
_NEW_STEP = 0.15
_SETTLING_INTERVALS, _INEXACT_STEP = (5, 20, 60, 200), 2e-3
_SEPARATING_ROWS = 200
_SEEDED_FROM, _SEEDED_ROWS = 10.0, 80
_REFIT_SHARE, _LONGEST_REFIT_INTERVAL = 0.2, 20.0
_YOUNG = 60.0  #: s during which the oscillator is refitted each second.
_SEA_STATE_PERIOD = 60.0  #: s between two reports of the sea state.
_OSCILLATOR_WINDOW = 600.0
_YOUNG_INTERVAL, _OLD_INTERVAL = 1.0, 20.0
HEALTHY_STRAIN = 4.0  #: Recent squared innovations over their expectation; a valid model stays below.
_ALIKE = 1.5  #: Ratio of mean square errors: a wide filter explains any sample, but may forecast badly.

_MIN_VARIANCE = 1e-10
_ACTIVITY_TIME = 5.0
_MIN_ACTIVITY = 1e-4


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
    window: float = 1200.0  #: s; the past that the sea is learnt from.
    first_refit: float = 8.0  #: s; when the sea is first learnt.
    refit_interval: float = 5.0  #: s; the least time between fits.
    refit_delay: float = 0.5  #: s from a request's stamp to its fit's use: the time that the background has for it.
    hull: HullFilterSettings = HullFilterSettings()
    quiescence: QuiescenceLimits | None = None  #: Limits whose probability of being kept is forecast; None: it is not.
    points: tuple[Point, ...] = ()  #: Where vertical motion is forecast, too.

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


class Observed(NamedTuple):
    """The outcome of one sample."""

    reasons: tuple[str, ...] = ()  #: From `FORECASTER_REASONS`.
    forecast: Forecast | None = None  #: At the leads, when due.
    horizon: Forecast | None = None  #: Over the horizon, when due.
    #: For `fit_sea`, whose result is for `Forecaster.install`.
    sea_request: SeaRequest | None = None
    sea: SeaReport | None = None  #: Of the sea state, once a minute.


@dataclass(frozen=True)
class ForecasterDiagnostics:
    """The running state, for operators."""

    sample_interval: float  #: s; NaN before the second sample.
    has_model: dict[str, bool]  #: By axis.
    has_waves: bool  #: Whether a state space of the waves is in use.
    nis_ratio: dict[str, float]  #: Innovations squared over their expectation, by axis; one is healthy.
    nrmse: np.ndarray  #: (A, L); running error over the size of the motion.
    coverage: np.ndarray  #: (A, L); coverage of the 90 % intervals.
    candidate_nrmse: np.ndarray  #: (K, A, L); running error of each of `CANDIDATES`.
    weights: np.ndarray  #: (K, A, L); their weights.
    advice: tuple[Advice, ...]


class Forecaster:
    """Forecasts of both axes.

    Pure and causal: its time is the sum of what elapsed between samples.
    """

    def __init__(self, settings: ForecasterSettings | None = None) -> None:
        self.settings = s = settings or ForecasterSettings()
        self._hulls = {axis: HullFilter(s.hull) for axis in AXES}
        self._models = dict.fromkeys(AXES)
        self._meters = {axis: (NoiseMeter(*ANGLE_NOISE), NoiseMeter(*RATE_NOISE)) for axis in AXES}
        self._agreements = {axis: AgreementMeter() for axis in AXES}
        self._noise = dict.fromkeys(AXES, (math.nan, math.nan))
        self._noise_to_hull = dict(self._noise)
        self._reported_noise = [0.0] * len(ATTITUDE)
        leads = np.array(s.leads)
        horizon = s.horizon_step * np.arange(1, round(s.horizon / s.horizon_step) + 1)
        self._leads = np.unique(np.round(np.concatenate([leads, horizon]), 9))
        self._asked, self._over_horizon = (self._places_of(wanted) for wanted in (leads, horizon))
        # the oldest forecast that is scored lies one longest lead behind the window
        self._history = RowBuffer(math.ceil((s.window + self._leads[-1]) * ROW_RATE * 1.25) + 1, _COLUMNS)
        quantities = *ATTITUDE, *[quantity_at(point.name, kind) for point in s.points for kind in AT_A_POINT]
        self._quiescence: Any = None if s.quiescence is None else Quiescence(s.quiescence, horizon, quantities)
        self._vertical: Any = None
        # heave and vertical velocity at the rows, as they were then: what windows of calm are judged by
        self._nowcasts: Any = RowBuffer(2 * round(s.horizon * ROW_RATE) + 1, 2) if s.points else None
        self._sizes = [MotionSize(s.window) for _ in AXES]
        self._time = 0.0
        self._due = -math.inf
        self._interval = self._step = math.nan
        self._intervals = self._irregular = 0
        self._is_linked = False
        self._blend: Any = None
        self._spaces: dict[str, InnovationsFilter] = {}
        self._waiting: Any = None
        self._rows_since_surprise = [10**9] * len(AXES)

    def _places_of(self, leads: np.ndarray):
        """Of these among all leads; a slice where they are all, which takes no copy."""
        places = np.searchsorted(self._leads, leads - 1e-6)
        return places if places.size < self._leads.size else slice(None)

    # -- models and fits

    def set_model(self, axis: str, identified: IdentifiedModel | None) -> None:
        """Swap the hull of an axis under the running filter; None where none is known."""
        self._models[axis] = identified
        self._hulls[axis].set_hull(identified)
        if self._blend is not None:
            self._blend.renew(_PLACE[HULL], AXES.index(axis))
        self._refit_due = -math.inf

    def install(self, fit: SeaFit) -> None:
        """Use a fit of `fit_sea` from its request's time plus ``refit_delay`` on, live as offline."""
        self._waiting = fit

    def set_quiescence(self, limits: QuiescenceLimits | None) -> None:
        """Forecast the probability of other limits over the configured duration; None: the configured ones."""
        if limits is not None:
            self._quiescence.set_limits(limits)

    def quiescence_reliability(self) -> Reliability | None:
        """Observed share of quiet against the probability issued; None where no limits are configured."""
        return None if self._quiescence is None else self._quiescence.record.diagram()

    # -- samples

    def observe(
        self,
        sample: CraftSample,
        stamp: float,
        elapsed: float | None,
        publish_next: Callable[[float, dict], None] | None = None,
    ) -> Observed:
        """Take one sample, NaN where not measured, stamped in s, ``elapsed`` s after the one before.

        ``elapsed`` is None at the first sample and after the clock was set back. ``publish_next`` gets the sample
        interval and, by axis, angle, rate and three covariances one sample ahead as soon as they are known.
        """
        since = elapsed if self._is_linked and elapsed is not None else math.inf
        linked = since <= LONGEST_BRIDGE
        elapsed = since if linked else 0.0
        if linked:
            self._time += elapsed
            self._follow_interval(elapsed)
        else:
            self._break_off()
        reasons = self._follow_hulls(sample, elapsed, linked)
        if publish_next is not None and self._interval == self._interval:
            ahead = {axis: hull.ahead(self._interval) for axis, hull in self._hulls.items() if hull.is_started}
            publish_next(self._interval, ahead)
        for size, hull in zip(self._sizes, self._hulls.values(), strict=True):
            if hull.is_started:
                state = hull.x
                size.follow(state.item(0), state.item(1), elapsed)
        if self._step != self._step:
            return Observed(reasons)
        sea = None
        if self._waiting is not None and self._time >= self._waiting.time + self.settings.refit_delay - 1e-9:
            sea = self._waiting.sea
            if sea is not None:
                self._sea_state_due += _SEA_STATE_PERIOD
            self._take_over()
        self._follow_rows(sample, elapsed)
        if self._time < self._due:
            return Observed(reasons, sea=sea)
        self._schedule()
        forecast, horizon = self._issue(stamp)
        return Observed(reasons, forecast, horizon, self._sea_request(), sea)

    def _break_off(self):
        """Forget the motion after a break; what is known of hull and sea stays."""
        self._is_linked = True
        self._due = -math.inf
        for size in self._sizes:
            size.restart()
        if self._blend is not None:
            self._skip_rows(_SEPARATING_ROWS)
            self._since_row = self._step
            self._restart_block()
        if self._quiescence is not None:
            self._quiescence.clear()

    def _follow_interval(self, elapsed: float):
        """The sensor's interval as the mean of similar intervals; a new rate shows by the lack of them."""
        if abs(elapsed / self._interval - 1.0) < _REGULAR:
            self._intervals = min(self._intervals + 1, 1000)
            self._interval += (elapsed - self._interval) / self._intervals
            self._irregular = 0
        else:
            self._irregular += 1
            if self._interval == self._interval and self._irregular < _IRREGULAR_SAMPLES:
                return
            self._interval, self._intervals, self._irregular = elapsed, 1, 0
        samples = max(1, round(1.0 / (ROW_RATE * self._interval)))
        deviation = abs(samples * self._interval / self._step - 1.0)
        if not deviation < _NEW_STEP:
            self._begin_rows(samples)
        elif self._intervals in _SETTLING_INTERVALS and deviation > _INEXACT_STEP:
            self._correct_step()

    def _follow_hulls(self, sample: CraftSample, elapsed: float, linked: bool):
        even = abs(elapsed - self._interval) < _REGULAR * self._interval
        reasons: tuple[str, ...] = ()
        for place, (axis, hull) in enumerate(self._hulls.items()):
            angle, rate = sample[1 + place], sample[3 + place]
            if not hull.is_started and angle != angle and rate != rate:
                continue
            variances = self._noise[axis] = self._variances(place, axis, angle, rate, sample, even)
            if not (linked and hull.is_started):
                self._agreements[axis].restart()
                hull.start(angle, rate, *variances)
                continue
            of_angle, of_rate = variances
            of_rate += self._agreements[axis].take(elapsed, angle, rate, of_angle, of_rate)
            self._noise_to_hull[axis] = of_angle, of_rate
            observed = hull.observe(elapsed, angle, rate, of_angle, of_rate)
            if self._models[axis] is not None and (observed.surprised or observed.restarted):
                self._rows_since_surprise[place] = 0
            if observed.rejected:
                reasons += (REJECTED[axis],)
            elif observed.restarted:
                reasons += (RESTARTED[axis],)
        return reasons

    def _variances(self, place: int, axis: str, angle: float, rate: float, sample: CraftSample, even: bool):
        """Noise variances that the sensor reports, or else measured ones."""
        of_angle, of_rate = self._meters[axis]
        if not even:
            of_angle.restart()
            of_rate.restart()
        for target, variance in ((place, sample[8 + place]), (place + 2, sample[10 + place])):
            self._reported_noise[target] = variance if variance > 0.0 else 0.0
        return (
            self._reported_noise[place] or of_angle.take(angle),
            self._reported_noise[place + 2] or of_rate.take(rate),
        )

    # -- rows: the motion at even steps

    def _begin_rows(self, samples: int):
        """Start rows with another step, which makes everything learnt in rows invalid."""
        self._samples_a_row = samples
        self._step = samples * self._interval
        self._history.clear()
        self._spaces = {}
        self._oscillator_due = -math.inf
        self._waiting = None
        self._score_anew()
        self._rows_begun = self._time
        self._refit_due = -math.inf
        self._sea_state_due = self._time + _SEA_STATE_PERIOD
        # the next sample is a row
        self._since_row = self._step
        self._restart_block()

    def _correct_step(self):
        """Correct a step that jitter in the first intervals made inexact; the rows themselves stay."""
        self._step = self._samples_a_row * self._interval
        self._spaces = {}
        self._waiting = None
        self._oscillator_due = self._refit_due = -math.inf
        self._score_anew()

    def _score_anew(self):
        self._blend = Blend(self._leads, self._step, len(AXES), tuple(CANDIDATES.values()))
        if self.settings.points:
            self._vertical = VerticalForecaster(self._step, math.ceil(self._leads[-1] / self._step) + 2)
            self._nowcasts.clear()
        whole = self._leads / self._step
        are_rows = np.abs(whole - np.round(whole)) < 0.02
        self._leads_are_rows = bool(are_rows.all()) and whole[0] > 0.9 and self._blend.steps.size == whole.size

    def _restart_block(self):
        self._block_sum, self._block_count = [0.0] * len(ATTITUDE), [0] * len(ATTITUDE)
        self._smoothed = [math.nan] * _ROW

    def _follow_rows(self, sample: CraftSample, elapsed: float):
        self._since_row += elapsed
        measured = _channels_of(sample)
        for place, value in enumerate(measured[:_MEASURED_COUNT]):
            if value == value:
                self._block_sum[place] += value
                self._block_count[place] += 1
        is_smoothed = self._samples_a_row >= SMOOTHED_FROM
        if is_smoothed:
            gain = 2.0 / self._samples_a_row
            for place, value in enumerate(measured):
                if value == value:
                    before = self._smoothed[place]
                    self._smoothed[place] = before + gain * (value - before) if before == before else value
        steps = round(self._since_row / self._step)
        if steps < 1 or self._since_row < self._step - 0.5 * self._interval:
            return
        # a row is a sample's, whatever the clocks of sensor and rows make of their steps
        self._since_row = 0.0
        self._skip_rows(steps - 1)
        row = list(self._smoothed if is_smoothed else measured)
        if is_smoothed:
            for place, hull in enumerate(self._hulls.values()):
                if hull.is_started:
                    row[place], row[place + 2] = hull.x.item(0), hull.x.item(1)
        block = zip(self._block_sum, self._block_count, strict=True)
        self._take_row(
            np.array(
                [*row, *measured[:_MEASURED_COUNT], *[total / count if count else math.nan for total, count in block]]
            ),
            steps,
        )

    def _take_row(self, row: np.ndarray, steps: int):
        """Take a complete row, the given number of steps after the one before."""
        self._block_sum, self._block_count = [0.0] * len(ATTITUDE), [0] * len(ATTITUDE)
        self._history.append(row)
        for space in self._spaces.values():
            space.step(row)
        if self._vertical is not None:
            self._vertical.take(row[_VERTICAL], self._spaces.get(ALL_CHANNELS))
            self._nowcasts.append(self._vertical.now)
        self._follow_oscillator()
        self._at_row = mean, covariance = self._candidates(self._step * self._blend.steps, None)
        variance = np.diagonal(covariance, axis1=2, axis2=3)
        self._blend.take(
            row[_MEASURED][:2],
            mean[..., :2],
            variance[..., :2],
            np.array(self._reported_noise[:2]),
            np.array(self._rows_since_surprise),
            np.array([hull.is_free for hull in self._hulls.values()], dtype=int),
        )
        self._rows_since_surprise = [rows + steps for rows in self._rows_since_surprise]

    def _skip_rows(self, count: int):
        if count > 0:
            self._history.skip(count)
            self._blend.skip(count)
            for space in self._spaces.values():
                space.skip(count)
            if self._vertical is not None:
                self._vertical.skip(count, self._spaces.get(ALL_CHANNELS))
                self._nowcasts.skip(count)

    def _follow_oscillator(self):
        """Fit the oscillator in the foreground, because it costs so little."""
        if self._time < self._oscillator_due:
            return
        is_young = self._time - self._rows_begun < _YOUNG
        self._oscillator_due = self._time + (_YOUNG_INTERVAL if is_young else _OLD_INTERVAL)
        self._use(OSCILLATOR, oscillators(self._past(_OSCILLATOR_WINDOW), CHANNELS, self._step, AXES))

    def _past(self, duration: float):
        """The channels' rows of the last seconds, as many as given."""
        return self._history.last(int(duration / self._step) + 1)[:, :_ROW]

    def _use(self, name: str, model: InnovationsModel | None):
        if model is not None:
            horizon = self._leads[-1] + 2.0 * self._step
            self._spaces[name] = space = InnovationsFilter(model, ATTITUDE, horizon, self._blend.steps)
            space.seed(self._past(max(_SEEDED_FROM, _SEEDED_ROWS * self._step)))

    # -- what is learnt of the sea

    def _sea_request(self):
        """The past to learn from, when a fit is due; else None."""
        s, age = self.settings, self._time - self._rows_begun
        if self._time < self._refit_due or age < s.first_refit:
            return None
        # the information in a young fit grows quickly; one of a long past costs more and changes less
        interval = max(s.refit_interval, min(_REFIT_SHARE * age, _LONGEST_REFIT_INTERVAL))
        self._refit_due = self._time + interval
        excitations = {axis: self._excitation_request(place, axis) for place, axis in enumerate(AXES)}
        return SeaRequest(
            self._time,
            self._step,
            CHANNELS,
            self._past(s.window).copy(),
            {axis: request for axis, request in excitations.items() if request is not None},
            self._vertical_request(),
            self._time >= self._sea_state_due,
        )

    def _vertical_request(self):
        if self._vertical is None:
            return None
        samples = self._samples_a_row
        # the accelerations of smoothed rows lag behind the attitude, which the hull filters give
        delay = (0.5 * samples - 1.0) * self._interval if samples >= SMOOTHED_FROM else 0.0
        return VerticalRequest(self._vertical.ahead, delay, self._history.newest)

    def _excitation_request(self, place: int, axis: str):
        hull = self._hulls[axis]
        if self._models[axis] is None or not hull.is_started:
            return None
        rows = self._history.last(int(min(EXCITATION_WINDOW, self.settings.window) / self._step) + 1)
        angle, rate = newest_stretch(rows[:, _BLOCK][:, [place, place + 2]].T, self._step)
        samples = self._samples_a_row
        of_angle, of_rate = (variance / samples for variance in self._noise_to_hull[axis])
        return hull.excitation_request(self._step, angle, rate, of_angle, of_rate, samples)

    def _take_over(self):
        fit, self._waiting = self._waiting, None
        for name, model in fit.waves.items():
            self._use(name, model)
            self._blend.renew(_PLACE[name])
        if self._vertical is not None and ALL_CHANNELS in fit.waves:
            self._vertical.install(fit.vertical, self._history.newest, self._spaces[ALL_CHANNELS])
        for axis, excitation in fit.excitations.items():
            if self._models[axis] is not None:
                self._hulls[axis].set_excitation(excitation, self._time - fit.time)

    # -- forecasts

    def _schedule(self):
        period = 1.0 / self.settings.forecast_rate
        slack = 0.25 * min(period, self._interval)
        following = self._due + period
        self._due = following if self._time - slack < following <= self._time + period else self._time + period - slack

    def _candidates(self, leads: np.ndarray, age: float | None):
        """Forecasts (K, L, 4) of every candidate and covariances (K, L, 4, 4); NaN where there is none.

        ``age``, s, is the time since the newest row; None: the leads are whole steps from it.
        """
        mean = np.full((len(CANDIDATES), leads.size, len(ATTITUDE)), math.nan)
        covariance = np.zeros((*mean.shape, len(ATTITUDE)))
        hull_place = _PLACE[HULL]
        for place, (axis, hull) in enumerate(self._hulls.items()):
            # without a hull it carries on the rate, which an oscillator does better
            if hull.is_started and (self._models[axis] is not None or OSCILLATOR not in self._spaces):
                mean[hull_place, :, place], mean[hull_place, :, place + 2], spread = hull.forecast(leads)
                # of the readings to come, as the state spaces'
                covariance[hull_place, :, place::2, place::2] = spread + np.diag(self._noise[axis])
        for name, space in self._spaces.items():
            k = _PLACE[name]
            mean[k], covariance[k] = space.at_steps() if age is None else space.forecast(leads, age)
        strained = [_PLACE[name] for name, space in self._spaces.items() if space.strain > HEALTHY_STRAIN]
        if strained:
            trusted = self._hull_is_trusted()
            for k in strained:
                mean[k][:, trusted[k]] = math.nan
        for place, hull in enumerate(self._hulls.values()):
            if hull.is_free:
                # nothing acts: there is nothing else to know
                mean[:hull_place, :, place::2] = mean[hull_place + 1 :, :, place::2] = math.nan
        angles = mean[..., :2]
        # a third of what np.clip takes
        np.minimum(np.maximum(angles, -math.pi, out=angles), math.pi, out=angles)
        return mean, covariance

    def _hull_is_trusted(self):
        """Targets, by candidate, that an identified hull explains at present, and forecasts nearly as well."""
        level = np.log(np.maximum(self._blend.mean_square, 1e-300)).mean(axis=1)
        explains = [
            self._models[axis] is not None and hull.is_started and hull.strain < HEALTHY_STRAIN
            for axis, hull in self._hulls.items()
        ]
        return ((level[_PLACE[HULL]] < level + math.log(_ALIKE)) & explains)[:, AXIS_OF_TARGET]

    def _issue(self, stamp: float):
        if self._leads_are_rows and abs(self._since_row) < 0.5 * self._interval:
            candidates = self._at_row
        else:
            candidates = self._candidates(self._leads, self._since_row)
        # a noise that is only measured is an upper bound, with which intervals would come out too narrow
        mean, covariance = self._blend.combine(*candidates, AXIS_OF_TARGET, np.array(self._reported_noise))
        known = [place for place in range(len(AXES)) if math.isfinite(mean[0, place])]
        points = self._at_points(mean, covariance) if self._vertical is not None else {}
        quiescence, window = math.nan, None
        if self._quiescence is not None:
            quiescence, window = self._stays_quiet(mean, covariance, points)
        joint = [*known, *(place + 2 for place in known)]
        if len(known) < len(AXES):
            mean, covariance = mean[:, joint], covariance[:, joint][:, :, joint]
        return [
            Forecast(
                stamp,
                self._leads[chosen],
                _by_axis(known, mean[chosen], covariance[chosen]),
                covariance[chosen],
                quiescence,
                window,
                {name: motion.at(chosen) for name, motion in points.items()},
            )
            for chosen in (self._asked, self._over_horizon)
        ]

    @property
    def _trim(self):
        """Roll and pitch about which the craft moves, rad."""
        return tuple([size.mean for size in self._sizes])

    def _at_points(self, mean: np.ndarray, covariance: np.ndarray):
        vertical = self._vertical.forecast(self._leads, self._since_row, mean, covariance)
        if vertical is None:
            return {}
        motion = np.hstack([vertical.mean, mean])
        return {
            point.name: point_motion(point.place, self._trim, motion, vertical.covariance)
            for point in self.settings.points
        }

    def _stays_quiet(self, mean: np.ndarray, covariance: np.ndarray, points: Mapping[str, PointMotion]):
        motion, variance = [mean], [np.diagonal(covariance, axis1=1, axis2=2)]
        for point in self.settings.points:
            ahead = points.get(point.name)
            unknown = np.full((self._leads.size, 2), math.nan)
            motion.append(unknown if ahead is None else ahead.mean[:, :2])
            variance.append(unknown if ahead is None else np.diagonal(ahead.covariance, axis1=1, axis2=2)[:, :2])
        motion, variance = (np.hstack(part)[self._over_horizon] for part in (motion, variance))
        newest, time = self._history.newest, self._time - self._since_row
        self._quiescence.learn(self._time, lambda times: self._what_came(newest + (times - time) / self._step))
        activity = [self._sizes[axis].activity for axis in AXIS_OF_TARGET]
        activity += [max(abs(value), _MIN_ACTIVITY) for value in motion[0, len(ATTITUDE) :].tolist()]
        trim = np.array([*self._trim, *[0.0] * (motion.shape[1] - len(AXES))])
        return self._quiescence.assess(self._time, motion, np.sqrt(variance), np.array(activity), trim)

    def _what_came(self, rows: np.ndarray):
        """Quantities with limits at numbered rows: measured, and for points as they were known then."""
        attitude = self._history.at(rows)[:, _MEASURED]
        parts = [attitude]
        if self.settings.points:
            now = self._nowcasts.at(rows - self._history.newest + self._nowcasts.newest)
            still = np.zeros((rows.size, 3))
            motion = np.hstack([now, still, attitude])
            parts += [point_motion(point.place, self._trim, motion).mean[:, :2] for point in self.settings.points]
        return np.hstack(parts)

    # -- for people

    def diagnostics(self) -> ForecasterDiagnostics:
        """The running state, for operators."""
        started = {axis: hull for axis, hull in self._hulls.items() if hull.is_started}
        advice = tuple(Advice.of('no-model', axis=axis) for axis in started if self._models[axis] is None)
        has_waves = any(name in self._spaces for name in SEA_MODELS)
        if not has_waves:
            advice += (Advice.of('no-waves'),)
        advice += tuple(note for hull in started.values() for note in hull.advice())
        shape = len(CANDIDATES), len(AXES), len(self.settings.leads)
        candidate, weights = np.full((2, *shape), math.nan)
        nrmse, coverage = np.full((2, *shape[1:]), math.nan)
        if self._blend is not None:
            places = self._blend.place_of_lead[self._asked]
            size = np.array([max(size.deviation, _MIN_ACTIVITY) for size in self._sizes])
            candidate = np.sqrt(self._blend.mean_square[:, places]).transpose(0, 2, 1) / size[:, None]
            weights = self._blend.weights[:, places].transpose(0, 2, 1)
            nrmse = np.sqrt(self._blend.blended_square[places]).T / size[:, None]
            coverage = self._blend.coverage[places].T
        return ForecasterDiagnostics(
            self._interval,
            {axis: self._models[axis] is not None for axis in AXES},
            has_waves,
            {axis: hull.strain for axis, hull in started.items()},
            nrmse,
            coverage,
            candidate,
            weights,
            advice,
        )


def _by_axis(places: Sequence[int], mean: np.ndarray, covariance: np.ndarray):
    """Joint forecasts of angles and then rates, each axis by itself."""
    count = len(places)
    return {
        AXES[place]: AxisForecast(mean[:, k], mean[:, count + k], covariance[:, k::count, k::count])
        for k, place in enumerate(places)
    }


class MotionSize:
    """Running size of the motion about one axis over a memory, s."""

    def __init__(self, memory: float) -> None:
        self._memory = memory
        self._elapsed = 0.0
        self.mean = math.nan
        self._square = self._rate_square = self._recent = _MIN_VARIANCE

    def restart(self) -> None:
        """Restart the recent size."""
        self._recent = _MIN_VARIANCE

    def follow(self, angle: float, rate: float, elapsed: float) -> None:
        """Add the filtered motion, rad and rad/s, after the elapsed seconds."""
        self._elapsed += elapsed
        slow = elapsed / min(self._memory, self._elapsed) if elapsed > 0.0 else 0.0
        quick = min(1.0, elapsed / min(_ACTIVITY_TIME, max(self._elapsed, elapsed, 1e-9)))
        if self.mean != self.mean:
            self.mean = angle
        self.mean += slow * (angle - self.mean)
        square = (angle - self.mean) ** 2
        self._square += slow * (square - self._square)
        self._rate_square += slow * (rate * rate - self._rate_square)
        # both halves of the oscillation's energy, so that the size does not swing with the phase
        share = self._square / max(self._rate_square, _MIN_VARIANCE)
        self._recent += quick * (0.5 * (square + share * rate * rate) - self._recent)

    @property
    def deviation(self) -> float:
        """Standard deviation over the memory, rad."""
        return math.sqrt(self._square)

    @property
    def activity(self) -> float:
        """Size over the last seconds, rad."""
        return max(math.sqrt(self._recent), _MIN_ACTIVITY)
