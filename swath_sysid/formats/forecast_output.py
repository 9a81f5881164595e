"""What the predictor publishes, as messages, live and in a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set
from functools import partial
from itertools import chain
from math import isfinite, isnan
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.motion.attitude import body_rates, conjugate, multiply, quaternion, rotate
from swath_sysid.attitude.motion.intake import NANOSECOND, NOT_MEASURED
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecast import Wanted
from swath_sysid.attitude.prediction.hull_state import LARGEST_ANGLE_VARIANCE, LARGEST_RATE_VARIANCE
from swath_sysid.formats import messages, topics
from swath_sysid.formats.messages import SECOND_NS, header, make, serialised
from swath_sysid.formats.sea_state_yaml import sea_as_yaml

if TYPE_CHECKING:
    from swath_sysid.attitude.prediction.forecast import Forecast
    from swath_sysid.attitude.prediction.forecaster import ForecastStep
    from swath_sysid.attitude.prediction.outlook import Outlook
    from swath_sysid.attitude.prediction.point import PointMotion
    from swath_sysid.attitude.prediction.quiescence import CalmWindow

NOT_GIVEN: tuple[float, ...] = (NOT_MEASURED, *8 * (0.0,))  #: Covariance that a sensor_msgs/Imu does not give.
UNKNOWN_PLACE_VARIANCE = 100.0  #: m^2 (and per s^2 and s^4); the horizontal motion is not forecast.

_NO_FORCE = (0.0, 0.0, 0.0, *NOT_GIVEN)
#: Of roll, pitch and their rates where they are not forecast.
_LARGEST_VARIANCES = LARGEST_ANGLE_VARIANCE, LARGEST_ANGLE_VARIANCE, LARGEST_RATE_VARIANCE, LARGEST_RATE_VARIANCE
_UNKNOWN_POSE = np.diag([UNKNOWN_PLACE_VARIANCE] * 2 + [0.0] * 3 + [LARGEST_ANGLE_VARIANCE])
_UNKNOWN_TWIST = np.diag([UNKNOWN_PLACE_VARIANCE] * 3 + [0.0] * 2 + [LARGEST_RATE_VARIANCE])
_UNKNOWN_ACCELERATION = np.diag([UNKNOWN_PLACE_VARIANCE] * 3 + [LARGEST_RATE_VARIANCE] * 3)
_AT_A_POINT = topics.point_lead_topic, topics.point_acceleration_topic
_HEAVE_AND_ATTITUDE = np.ix_((0, 3, 4), (0, 3, 4))


def forecast_topics(leads: Sequence[float], points: Sequence[str], frames_at: Sequence[float] = ()) -> list[str]:
    """Every topic that is published, for leads, s, named points, and frames at leads as `ForecastMessages` has them."""
    found = [topics.NEXT_TOPIC, *map(topics.lead_topic, leads), topics.HORIZON_TOPIC, topics.VALID_LEAD_TOPIC]
    found += [topics.QUIESCENCE_TOPIC, topics.OUTLOOK_TOPIC, topics.CALM_TOPIC, topics.SEA_TOPIC]
    for point in points:
        found.append(topics.point_horizon_topic(point))
        found += [topic_at(point, lead) for topic_at in _AT_A_POINT for lead in leads]
    return [*found, topics.FRAMES_TOPIC] if frames_at else found


def wanted_for(
    heard: Set[str], leads: Sequence[float], points: Sequence[str], frames_at: Sequence[float] = ()
) -> Wanted:
    """What the messages of those of `forecast_topics` that somebody subscribes to are made of."""
    of_frames = frames_at if topics.FRAMES_TOPIC in heard else ()
    at_points = {lead: [at(point, lead) for at in _AT_A_POINT for point in points] for lead in leads}
    horizons = [topics.point_horizon_topic(point) for point in points]
    asked = [
        lead for lead in leads if lead in of_frames or not heard.isdisjoint([topics.lead_topic(lead), *at_points[lead]])
    ]
    return Wanted(
        max(asked, default=0.0),
        not heard.isdisjoint([topics.HORIZON_TOPIC, *horizons]),
        bool(of_frames) or not heard.isdisjoint([*horizons, *chain(*at_points.values())]),
        not heard.isdisjoint([topics.VALID_LEAD_TOPIC, topics.OUTLOOK_TOPIC]),
        not heard.isdisjoint([topics.OUTLOOK_TOPIC, topics.QUIESCENCE_TOPIC, topics.CALM_TOPIC]),
    )


class ForecastMessages:
    """The messages of one predictor, in the craft's frame and in ``FRAME_level``, which follows its mean motion. The
    frames predicted at the leads ``frames_at``, s, go to ``/tf``, beside ``FRAME_now``. Those of topics that are not
    heard are not made, unless somebody may come to get the last one.
    """

    def __init__(
        self, frame_id: str, frames_at: Sequence[float] = (), is_heard: Callable[[str], bool] = lambda topic: True
    ) -> None:
        self.frame_id = frame_id
        self._frames_at, self._is_heard = frames_at, is_heard
        self._level = f'{frame_id}_level'
        self.imu = messages.ImuMessage(frame_id)
        self._templates: dict[tuple, messages.Template] = {}

    def next_of(self, step: ForecastStep) -> Iterator[tuple[str, bytes]]:
        """Topic and message of what a step of the pipeline has at once."""
        if step.next is not None:
            yield topics.NEXT_TOPIC, self._attitude(step.next, 0)

    def sea_of(self, step: ForecastStep) -> Iterator[tuple[str, bytes]]:
        """Topic and message of a sea state, which no later step repeats."""
        if step.sea is not None and step.sample is not None:
            yield topics.SEA_TOPIC, messages.text_message(sea_as_yaml(step.sea, step.sample.stamp_ns))

    def of(self, step: ForecastStep) -> Iterator[tuple[str, bytes]]:
        """Topic and message of the forecasts that a finished step leads to."""
        for topic, made in self._due(step):
            if topic in topics.LATCHED_TOPICS or self._is_heard(topic):
                yield topic, made()

    def all_of(self, step: ForecastStep) -> Iterator[tuple[str, bytes]]:
        """Topic and message of everything that a finished step leads to."""
        for part in self.next_of, self.sea_of, self.of:
            yield from part(step)

    def _due(self, step: ForecastStep) -> Iterator[tuple[str, Callable[[], bytes]]]:
        """Topic, and what makes its message."""
        forecast, horizon, outlook = step.forecast, step.horizon, step.outlook
        if forecast is not None:
            for place, lead in enumerate(forecast.leads.tolist()):
                yield topics.lead_topic(lead), partial(self._attitude, forecast, place)
            yield from self._at_points(forecast)
        if horizon is not None and outlook is not None:
            yield topics.HORIZON_TOPIC, partial(self._horizon, step, horizon)
            yield topics.VALID_LEAD_TOPIC, partial(messages.named_numbers_message, outlook.valid_leads)
            yield topics.OUTLOOK_TOPIC, partial(self._outlook, outlook, horizon.stamp_ns)
            yield from self._horizons_of_points(horizon)
            if isfinite(outlook.quiescence):
                kind = topics.TYPES[topics.QUIESCENCE_TOPIC]
                yield topics.QUIESCENCE_TOPIC, partial(messages.number_message, outlook.quiescence, kind)
                yield topics.CALM_TOPIC, partial(self._calm, outlook.calm, horizon.stamp_ns)
        if self._frames_at and forecast is not None and step.next is not None:
            yield topics.FRAMES_TOPIC, partial(self._frames, forecast, step.next)

    def _attitude(self, forecast: Forecast, place: int) -> bytes:
        """The sensor_msgs/Imu of one lead, by its place; level about an axis that is not measured."""
        mean, variance = forecast.mean[place].tolist(), forecast.covariance[place].diagonal().tolist()
        is_known = not isnan(sum(mean))
        if not is_known:
            pairs = zip(mean, variance, _LARGEST_VARIANCES, strict=True)
            variance = [known if value == value else largest for value, known, largest in pairs]
            mean = [value if value == value else 0.0 for value in mean]
        (roll, pitch, roll_rate, pitch_rate), (yaw, yaw_rate) = mean, forecast.heading
        of_turn = of_rates = NOT_GIVEN
        if is_known or forecast.axes:
            of_turn = _diagonal(variance[0], variance[1], LARGEST_ANGLE_VARIANCE)
            of_rates = _diagonal(variance[2], variance[3], LARGEST_RATE_VARIANCE)
        turn, rates = quaternion(roll, pitch, yaw), body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate)
        stamp_ns = forecast.stamp_ns + round(forecast.leads.item(place) / NANOSECOND)
        return self.imu.of_values(stamp_ns, (*turn, *of_turn, *rates, *of_rates, *_NO_FORCE))

    def _horizon(self, step: ForecastStep, horizon: Forecast) -> bytes:
        """A column for each angle and its standard deviation, with rates as velocities; the sample comes first."""
        columns = tuple([f'{axis}{kind}' for axis in horizon.axes for kind in ('', '_std')])
        means, deviations, times_ns = horizon.mean, horizon.deviation, _times_ns(horizon)
        if step.next is not None and step.sample is not None:
            measured = np.array(step.sample[1:5])
            now = np.where(np.isfinite(measured), measured, step.next.mean[0])
            means, times_ns = np.vstack([now, means]), (0, *times_ns)
            deviations = np.vstack([step.next.deviation[:1], deviations])
        values = np.stack([means, deviations], axis=2)[:, np.isfinite(horizon.mean[0])].ravel()
        return self._filled(_trajectory, self.frame_id, (columns, times_ns), horizon.stamp_ns, values)

    def _outlook(self, outlook: Outlook, stamp_ns: int) -> bytes:
        """The quiescence and the valid leads by name, with the stamp that their own topics lack."""
        named = {f'valid_lead.{name}': lead for name, lead in outlook.valid_leads.items() if isfinite(lead)}
        if isfinite(outlook.quiescence):
            named['quiescence'] = outlook.quiescence
        return self._filled(_named, self.frame_id, tuple(named), stamp_ns, tuple(named.values()))

    def _horizons_of_points(self, horizon: Forecast) -> Iterator[tuple[str, Callable[[], bytes]]]:
        key = ('heave', 'heave_std'), _times_ns(horizon)
        for name, motion in horizon.points.items():
            yield topics.point_horizon_topic(name), partial(self._horizon_of_point, motion, key, horizon.stamp_ns)

    def _horizon_of_point(self, motion: PointMotion, key: tuple, stamp_ns: int) -> bytes:
        deviation = np.sqrt(np.diagonal(motion.covariance, axis1=1, axis2=2)[:, :3])
        values = np.stack([motion.mean, deviation], axis=2).ravel()
        return self._filled(_trajectory, self._level, key, stamp_ns, values)

    def _calm(self, calm: CalmWindow | None, stamp_ns: int) -> bytes:
        """The probability at both ends of the next window of calm; no points without one."""
        times_ns = () if calm is None else (round(calm.begin * SECOND_NS), round(calm.end * SECOND_NS))
        probabilities = () if calm is None else (calm.probability, calm.probability)
        return self._filled(_trajectory, self._level, (('probability',), times_ns), stamp_ns, probabilities)

    def _at_points(self, forecast: Forecast) -> Iterator[tuple[str, Callable[[], bytes]]]:
        """A nav_msgs/Odometry and an acceleration for each point at each lead."""
        for name, motion in forecast.points.items():
            for place, lead in enumerate(forecast.leads.tolist()):
                stamp_ns = forecast.stamp_ns + round(lead / NANOSECOND)
                odometry = partial(self._odometry, name, motion, forecast.mean[place], place, stamp_ns)
                yield topics.point_lead_topic(name, lead), odometry
                acceleration = partial(self._acceleration, name, motion, place, stamp_ns)
                yield topics.point_acceleration_topic(name, lead), acceleration

    def _odometry(self, name: str, motion: PointMotion, attitude: np.ndarray, place: int, stamp_ns: int) -> bytes:
        vertical = motion.mean[place].tolist(), motion.covariance[place]
        values = _odometry_values(motion.place, attitude.tolist(), *vertical)
        return self._filled(_odometry, self._level, name, stamp_ns, values)

    def _acceleration(self, name: str, motion: PointMotion, place: int, stamp_ns: int) -> bytes:
        spread = _UNKNOWN_ACCELERATION.copy()
        spread[2, 2] = motion.covariance[place, 2, 2]
        values = 0.0, 0.0, motion.mean.item(place, 2), *spread.ravel().tolist()
        return self._filled(_acceleration, self._level, name, stamp_ns, values)

    def _frames(self, forecast: Forecast, following: Forecast) -> bytes:
        frames = list(self._transforms(forecast, following))
        return serialised(make(topics.TYPES[topics.FRAMES_TOPIC], frames))

    def _transforms(self, forecast: Forecast, following: Forecast) -> Iterator[tuple]:
        """From the level frame to the craft now and at the leads, all at the time of issue; the heading is left out."""
        yaw, _ = following.heading
        now = multiply(quaternion(0.0, 0.0, -yaw), quaternion(*_angles(following), yaw))
        yield self._transform(f'{self.frame_id}_now', forecast.stamp_ns, 0.0, now)
        heaving = next((name for name, motion in forecast.points.items() if not any(motion.place)), None)
        for lead in self._frames_at:
            at = forecast.at(lead)
            heave = float(at.points[heaving].mean[0, 0]) if heaving is not None else 0.0
            child = topics.frame_at(self.frame_id, lead)
            yield self._transform(child, forecast.stamp_ns, heave, quaternion(*_angles(at), 0.0))

    def _transform(self, child: str, stamp_ns: int, heave: float, orientation: Sequence[float]) -> tuple:
        return header(stamp_ns, self._level), child, ((0.0, 0.0, heave), tuple(orientation))

    def _filled(self, message_of: Callable, frame_id: str, key: Any, stamp_ns: int, values: Any) -> bytes:
        template = self._templates.get(kind := (message_of, frame_id, key))
        if template is None:
            template = messages.Template(lambda v: message_of(v, frame_id, key), len(values))
            self._templates[kind] = template
        return template.filled(stamp_ns, values)


def _times_ns(forecast: Forecast) -> tuple[int, ...]:
    return tuple(np.round(forecast.leads / NANOSECOND).astype(int).tolist())


def _angles(forecast: Forecast) -> tuple[float, float]:
    """Roll and pitch at the first lead, rad; zero where they are not measured."""
    roll, pitch = np.nan_to_num(forecast.mean[0, : len(AXES)]).tolist()
    return roll, pitch


def _diagonal(about_x: float, about_y: float, about_z: float) -> tuple[float, ...]:
    return about_x, 0.0, 0.0, 0.0, about_y, 0.0, 0.0, 0.0, about_z


def _odometry_values(
    place: Sequence[float], attitude: Sequence[float], motion: Sequence[float], covariance: np.ndarray
) -> tuple[float, ...]:
    """Pose and twist of a point with their covariances, in a level frame that moves with the craft's mean. ``attitude``
    as in `Forecast`, ``motion`` and covariance (7, 7) as in `PointMotion`.
    """
    heave, velocity, _ = motion
    roll, pitch, roll_rate, pitch_rate = attitude
    orientation = quaternion(roll, pitch, 0.0)
    back = conjugate(*orientation)
    angular = body_rates(roll, pitch, roll_rate, pitch_rate, 0.0)
    x, y, _ = rotate(orientation, *place)
    across = rotate(orientation, *_cross(angular, place))
    linear = rotate(back, across[0], across[1], velocity)
    pose = _UNKNOWN_POSE.copy()
    pose[2:5, 2:5] = covariance[_HEAVE_AND_ATTITUDE]
    # the same either way but along the world's vertical, here in the axes of the craft
    up = np.array(rotate(back, 0.0, 0.0, 1.0))
    twist = _UNKNOWN_TWIST.copy()
    twist[:3, :3] += (covariance[1, 1] - UNKNOWN_PLACE_VARIANCE) * (up[:, None] * up)
    twist[3:5, 3:5] = covariance[5:, 5:]
    twist[:3, 3:5] = up[:, None] * covariance[1, 5:]
    twist[3:5, :3] = twist[:3, 3:5].T
    spreads = pose.ravel().tolist(), twist.ravel().tolist()
    return x, y, heave, *orientation, *spreads[0], *linear, *angular, *spreads[1]


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _odometry(v: np.ndarray, level: str, point: str) -> Any:
    pose = (tuple(v[:3]), tuple(v[3:7])), v[7:43]
    twist = (tuple(v[43:46]), tuple(v[46:49])), v[49:85]
    return make(topics.ODOMETRY, header(0, level), point, pose, twist)


def _acceleration(v: np.ndarray, level: str, _: str) -> Any:
    return make(topics.ACCELERATION, header(0, level), ((tuple(v[:3]), (0.0, 0.0, 0.0)), v[3:39]))


def _named(v: np.ndarray, frame_id: str, names: Sequence[str]) -> Any:
    nothing = np.zeros(0)
    return make(topics.TYPES[topics.OUTLOOK_TOPIC], header(0, frame_id), list(names), v, nothing, nothing)


def _trajectory(v: np.ndarray, frame_id: str, key: tuple[Sequence[str], Sequence[int]]) -> Any:
    """Values by time, then positions, velocities and accelerations as far as they go, then column."""
    columns, times_ns = key
    rows: Any = v.reshape(len(times_ns), -1, len(columns)) if v.size else len(times_ns) * [()]
    points = [messages.trajectory_point(time, *row) for time, row in zip(times_ns, rows, strict=True)]
    return make(topics.TRAJECTORY, header(0, frame_id), list(columns), points)
