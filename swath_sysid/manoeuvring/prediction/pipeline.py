"""The live predictor of manoeuvres between its messages, without ROS.

Each usable odometry message steps the filter to its stamp and, at the forecast rate, gives forecasts at the leads and
the path ahead. IMU and thruster messages arrive in between.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.conditions import codes_in
from swath_sysid.common.conventions import ADEQUATE
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel, Region
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel, parameter_values
from swath_sysid.manoeuvring.motion.window import ABSURD, LATE, why_left_out
from swath_sysid.manoeuvring.prediction.filter_settings import MEASURABLE, ManoeuvreFilterSettings
from swath_sysid.pipeline.health import Reasons, Report, verdict_values

MOST_SUPPLIED = 1000  #: Future inputs; a longer list is a broken message.


@dataclass(frozen=True)
class ManoeuvreOutlookSettings:
    """Settings of `ManoeuvreOutlook`."""

    leads: tuple[float, ...] = (1.0, 5.0, 10.0)  #: s, rising.
    horizon: float = 20.0  #: Of the path, s.
    horizon_step: float = 0.5  #: s.
    rate: float = 5.0  #: Forecasts a second, at most.
    gap_limit: float = 5.0  #: s of silence after which the filter restarts.
    backward_jump: float = 1.0  #: s of clock set back after which the filter restarts.
    stop_after: float = 0.0  #: s without a thrust command after which the thrust is zero; 0: it holds.
    filter: ManoeuvreFilterSettings = ManoeuvreFilterSettings()

    def __post_init__(self):
        leads = self.leads
        if not leads or leads[0] <= 0.0 or any(b <= a for a, b in zip(leads, leads[1:], strict=False)):
            raise InputError(f'the leads must be positive and rising, not {list(leads)}')
        if not 0.0 < self.horizon_step <= self.horizon:
            raise InputError('horizon_step must be positive and not beyond the horizon')
        if not (self.rate > 0.0 and self.gap_limit > 0.0 and self.backward_jump > 0.0 and self.stop_after >= 0.0):
            raise InputError('rate, gap limit and backward jump must be positive, and stop_after not negative')


@dataclass(frozen=True)
class PlanarMotion:
    """Pose and twist at one time."""

    stamp: float  #: s.
    x: float  #: East, m.
    y: float  #: North, m.
    heading: float  #: rad.
    surge: float  #: Over ground, m/s.
    sway: float  #: Over ground, m/s.
    yaw_rate: float  #: rad/s.


@dataclass(frozen=True)
class OdometryReading(PlanarMotion):
    """One odometry message, with the standard deviations that the sender gives, by channel."""

    std: dict[str, float]


@dataclass(frozen=True)
class ManoeuvreState(PlanarMotion):
    """Expected motion; covariances (3, 3) of x, y, heading, and of surge, sway, yaw rate."""

    pose_covariance: np.ndarray
    twist_covariance: np.ndarray


@dataclass(frozen=True)
class OutlookStep:
    """Forecasts at the leads and the path after an odometry message; both empty when none was due."""

    leads: tuple[ManoeuvreState, ...] = ()
    path: tuple[ManoeuvreState, ...] = ()


def steady_motion() -> IdentifiedManoeuvringModel:
    """Constant speeds and yaw rate whatever the thrust: used until there is a model."""
    values = parameter_values({'m': 1.0, 'Iz': 1.0, 'Xvr': -1.0, 'Yur': 1.0, 'gain': 0.0})
    return IdentifiedManoeuvringModel(
        ManoeuvringModel(values, name='steady motion'),
        (),
        np.zeros((0, 0)),
        np.array([0.3, 0.2, 0.1]),
        Region(0.0, 1.0, 0.5, 0.5, 0.0, 1.0, 1.0),
    )


class ManoeuvreOutlook:
    """Forecasts of a craft from its messages; same messages, same numbers."""

    def __init__(self, settings: ManoeuvreOutlookSettings, identified: IdentifiedManoeuvringModel | None = None):
        self.settings = settings
        self.counts = dict.fromkeys(codes_in('manoeuvring'), 0)
        self.identified: IdentifiedManoeuvringModel | None = None
        self._sides: dict[str, float] = {}
        self._forecast_at = -math.inf
        self._supplied: tuple[tuple[float, float, float], ...] = ()
        self._silent = False
        self._filter = self._filter_of(steady_motion())
        if identified is not None:
            self.set_model(identified)

    @property
    def has_model(self) -> bool:
        """Whether an identified model is in use."""
        return self.identified is not None

    def set_model(self, identified: IdentifiedManoeuvringModel) -> None:
        """Swap the model; the motion of the craft continues."""
        before, self.identified = self._filter, identified
        self._filter = self._filter_of(identified)
        self._filter.resume(before)

    def _filter_of(self, identified: IdentifiedManoeuvringModel):
        from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilter  # filterpy, which only forecasts need

        return ManoeuvreFilter(identified, self.settings.filter)

    def add_thrust(self, stamp: float, side: str, value: float) -> None:
        """Add the input of one thruster, ``port`` or ``starboard``, N or command as the model expects."""
        if self._leaves_out(stamp=stamp, thrust=value):
            return
        self._sides[side] = value
        self._silent = False
        if len(self._sides) == 2:
            last = self._filter.thrust.last[0]
            self._filter.thrust.command(max(stamp, last), self._sides['port'], self._sides['starboard'])

    def supply(self, future: Iterable[tuple[float, float, float]]) -> None:
        """Use future inputs (lead from now, port, starboard); empty: the last ones hold."""
        rows = tuple(future)
        if len(rows) > MOST_SUPPLIED:
            self.counts[ABSURD] += 1
        elif not any(self._leaves_out(stamp=lead, thrust=value) for lead, *inputs in rows for value in inputs):
            self._supplied = rows

    def _leaves_out(self, **values: float) -> bool:
        reason = why_left_out(**values)
        if reason:
            self.counts[reason] += 1
        return bool(reason)

    def add_yaw_rate(self, stamp: float, yaw_rate: float, std: float | None = None) -> None:
        """Add the yaw rate of an IMU, rad/s."""
        if self._leaves_out(stamp=stamp, yaw_rate=yaw_rate):
            return
        if not self._filter.is_started or stamp > self._filter.stamp + self.settings.gap_limit:
            return
        if stamp < self._filter.stamp:
            # a little late is usual beside the odometry's own path; the rate has hardly changed since
            if stamp < self._filter.stamp - 0.1:
                self.counts[LATE] += 1
                return
        else:
            self._filter.advance(stamp)
        self._note(self._filter.correct('yaw_rate', yaw_rate, std))

    def add_odometry(self, reading: OdometryReading) -> OutlookStep:
        """Add an odometry message, in the order of arrival."""
        values = {name: getattr(reading, name) for name in MEASURABLE}
        if self._leaves_out(stamp=reading.stamp, **values):
            return OutlookStep()
        filter_ = self._filter
        if filter_.is_started and reading.stamp < filter_.stamp - self.settings.backward_jump:
            self.counts['jumped-back'] += 1
            filter_.thrust.forget()
            filter_.stamp = math.nan
        elif filter_.is_started and reading.stamp > filter_.stamp + self.settings.gap_limit:
            self.counts['long-gap'] += 1
            filter_.stamp = math.nan
        if filter_.thrust.last[0] > reading.stamp + 2.0 * self.settings.backward_jump:
            # stamped by another clock than the odometry, before that was known: it holds from now on
            filter_.thrust.forget()
        if not filter_.is_started:
            filter_.start(reading.stamp, **values)
            self._forecast_at = -math.inf
        elif reading.stamp <= filter_.stamp - 0.1:
            self.counts[LATE] += 1
            return OutlookStep()
        else:
            self._stop_if_silent(reading.stamp)
            filter_.advance(reading.stamp)
            for name, value in values.items():
                self._note(filter_.correct(name, value, reading.std.get(name)))
        if reading.stamp < self._forecast_at + 1.0 / self.settings.rate - 1e-6:
            return OutlookStep()
        self._forecast_at = reading.stamp
        return self._forecast()

    def _stop_if_silent(self, stamp: float):
        last, *inputs = self._filter.thrust.last
        limit = self.settings.stop_after
        if limit > 0.0 and stamp - last > limit and any(inputs) and math.isfinite(last):
            self._filter.thrust.command(last + limit, 0.0, 0.0)
            self.counts['no-thrust'] += not self._silent
            self._silent = True

    def _forecast(self):
        s = self.settings
        steps = np.arange(1, int(s.horizon / s.horizon_step + 1e-9) + 1) * s.horizon_step
        at = np.unique(np.concatenate([steps, s.leads]))
        found = self._filter.forecast(at, self._supplied or None)
        rows = zip(found.stamps, found.recorded, found.recorded_covariances, strict=True)
        by_lead = dict(zip(at.tolist(), (_state_of(*row) for row in rows), strict=True))
        return OutlookStep(*(tuple(by_lead[float(lead)] for lead in leads) for leads in (s.leads, steps)))

    def _note(self, advice: Sequence[Advice]):
        for item in advice:
            self.counts[item.code] += 1


def _state_of(stamp: float, recorded: np.ndarray, covariance: np.ndarray):
    pose, twist = [4, 5, 3], [0, 1, 2]
    covariances = covariance[np.ix_(pose, pose)], covariance[np.ix_(twist, twist)]
    surge, sway, yaw_rate, heading, x, y = map(float, recorded)
    return ManoeuvreState(float(stamp), x, y, heading, surge, sway, yaw_rate, *covariances)


class ManoeuvringHealth(Reasons):
    """How odometry becomes forecasts."""

    def __init__(self, topic: str, pipeline: ManoeuvreOutlook):
        super().__init__('manoeuvring', 'manoeuvring states')
        self._topic = topic
        self._pipeline = pipeline
        self._received = self._bad_models = 0
        self._arrival: float | None = None
        self._refusal = ''

    def note_message(self, now: float) -> None:
        """Odometry came, s of the clock of `reports`."""
        self._received += 1
        self._arrival = now

    def note_model(self) -> None:
        """A model came."""
        self._refusal = ''

    def note_refused_model(self, sentence: str) -> None:
        """A model cannot be used, for this reason; it is reported until a good one comes."""
        self._bad_models += 1
        self._refusal = sentence

    def reports(self, now: float) -> list[Report]:
        """The report now, s, and start a new period."""
        found = self.grown(self.fresh(self._pipeline.counts))
        model = self._pipeline.identified
        if self._arrival is None or now - self._arrival > self._pipeline.settings.gap_limit:
            found.insert(0, self.found('sensor-silent', topic=self._topic))
        if self._refusal:
            found.append(self.found('bad-model', refusal=self._refusal))
        elif not self._pipeline.has_model:
            found.append(self.found('no-model'))
        elif model is not None and model.verdict not in ('', ADEQUATE):
            found.append(self.found('model-doubtful', verdict=model.verdict, verdict_sentence=model.verdict_sentence))
        values: dict[str, object] = {
            'received': self._received,
            'bad_models': self._bad_models,
            'refused_model': self._refusal,
            **verdict_values({'manoeuvring': model}),
            **self._pipeline.counts,
        }
        return [Report.of('manoeuvre', found, 'forecasting with the identified model', values)]
