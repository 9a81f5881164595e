"""What the predictor publishes, as messages, live and in a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.motion.attitude import multiply, quaternion
from swath_sysid.attitude.prediction.hull_state import LARGEST_RATE_VARIANCE
from swath_sysid.formats import messages, topics
from swath_sysid.formats.messages import SECOND_NS, header, make, serialised
from swath_sysid.formats.sea_state import sea_as_yaml
from swath_sysid.pipeline.forecast_pipeline import UNKNOWN_PLACE_VARIANCE

if TYPE_CHECKING:
    from swath_sysid.attitude.prediction.blend import Forecast
    from swath_sysid.pipeline.forecast_pipeline import AttitudeForecast, PipelineStep

_NOTHING_KNOWN = np.diag([UNKNOWN_PLACE_VARIANCE] * 3 + [LARGEST_RATE_VARIANCE] * 3)


def forecast_topics(leads: Sequence[float], points: Sequence[str], frames_at: Sequence[float] = ()) -> list[str]:
    """Every topic that is published, for leads, s, named points, and frames at leads as `ForecastMessages` has them."""
    found = [topics.NEXT_TOPIC, *map(topics.lead_topic, leads), topics.HORIZON_TOPIC, topics.VALID_LEAD_TOPIC]
    found += [topics.QUIESCENCE_TOPIC, topics.CALM_TOPIC, topics.SEA_TOPIC]
    names_at = topics.point_lead_topic, topics.point_acceleration_topic
    for point in points:
        found.append(topics.point_horizon_topic(point))
        found += [topic_at(point, lead) for topic_at in names_at for lead in leads]
    return [*found, topics.FRAMES_TOPIC] if frames_at else found


class ForecastMessages:
    """The messages of one predictor, in the craft's frame and in ``FRAME_level``, which follows its mean motion. The
    frames predicted at the leads ``frames_at``, s, go to ``/tf``, beside ``FRAME_now``.
    """

    def __init__(self, frame_id: str, frames_at: Sequence[float] = ()) -> None:
        self.frame_id = frame_id
        self._frames_at = frames_at
        self._level = f'{frame_id}_level'
        self.imu = messages.ImuMessage(frame_id)
        self._templates: dict[tuple, messages.Template] = {}

    def of(self, step: PipelineStep) -> Iterator[tuple[str, bytes]]:
        """Topic and message of all that a step of the pipeline leads to, but for ``forecast/next``."""
        for lead, forecast in step.attitudes():
            yield topics.lead_topic(lead), self.imu.filled(forecast)
        if (trajectory := step.trajectory()) is not None:
            yield topics.HORIZON_TOPIC, messages.horizon_message(trajectory, self.frame_id)
        if step.horizon is not None:
            yield topics.VALID_LEAD_TOPIC, messages.named_numbers_message(step.horizon.valid_leads)
        if step.quiescence is not None:
            kind = topics.TYPES[topics.QUIESCENCE_TOPIC]
            yield topics.QUIESCENCE_TOPIC, messages.number_message(step.quiescence, kind)
        yield from self._at_points(step)
        if step.sea is not None:
            yield topics.SEA_TOPIC, messages.text_message(sea_as_yaml(step.sea, step.stamp_ns))
        if self._frames_at and step.forecast is not None and step.next is not None:
            frames = list(self._transforms(step.forecast, step.next, step.heading[0], step.stamp_ns))
            yield topics.FRAMES_TOPIC, serialised(make(topics.TYPES[topics.FRAMES_TOPIC], frames))

    def _transforms(self, forecast: Forecast, now: AttitudeForecast, yaw: float, stamp_ns: int) -> Iterator[tuple]:
        """From the level frame to the craft now and at the leads, all at the time of issue; the heading is left out."""
        x, y, z, w = now.orientation
        without_heading = multiply(quaternion(0.0, 0.0, -yaw), (x, y, z, w))
        yield self._transform(f'{self.frame_id}_now', stamp_ns, 0.0, without_heading)
        heaving = [motion for motion in forecast.points.values() if not any(motion.place)]
        for lead in self._frames_at:
            place = int(np.abs(forecast.leads - lead).argmin())
            roll, pitch = (
                float(forecast.axes[axis].angle[place]) if axis in forecast.axes else 0.0 for axis in ('roll', 'pitch')
            )
            heave = float(heaving[0].mean[place, 0]) if heaving else 0.0
            yield self._transform(topics.frame_at(self.frame_id, lead), stamp_ns, heave, quaternion(roll, pitch, 0.0))

    def _transform(self, child: str, stamp_ns: int, heave: float, orientation: Sequence[float]) -> tuple:
        return header(stamp_ns, self._level), child, ((0.0, 0.0, heave), tuple(orientation))

    def _at_points(self, step: PipelineStep) -> Iterator[tuple[str, bytes]]:
        for point in step.points():
            pose = *point.position, *point.orientation, *point.pose_covariance.ravel().tolist()
            twist = *point.linear, *point.angular, *point.twist_covariance.ravel().tolist()
            odometry = self._filled(_odometry, point.name, point.stamp_ns, (*pose, *twist))
            yield topics.point_lead_topic(point.name, point.lead), odometry
            covariance = _NOTHING_KNOWN.copy()
            covariance[2, 2] = point.acceleration_variance
            numbers = 0.0, 0.0, point.acceleration, *covariance.ravel().tolist()
            acceleration = self._filled(_acceleration, point.name, point.stamp_ns, numbers)
            yield topics.point_acceleration_topic(point.name, point.lead), acceleration
        horizon = step.horizon
        if horizon is None:
            return
        leads_ns = tuple(np.round(horizon.leads * SECOND_NS).astype(int).tolist())
        for name, motion in horizon.points.items():
            deviation = np.sqrt(np.diagonal(np.asarray(motion.covariance), axis1=1, axis2=2)[:, :3])
            values = np.stack([motion.mean, deviation], axis=2).ravel()
            yield topics.point_horizon_topic(name), self._filled(_point_horizon, leads_ns, step.stamp_ns, values)
        if step.quiescence is not None:
            calm = horizon.calm
            times_ns = () if calm is None else (round(calm.begin * SECOND_NS), round(calm.end * SECOND_NS))
            probabilities = () if calm is None else (calm.probability, calm.probability)
            yield topics.CALM_TOPIC, self._filled(_calm_window, times_ns, step.stamp_ns, probabilities)

    def _filled(self, message_of: Callable, key: Any, stamp_ns: int, values: Any) -> bytes:
        if (message_of, key) not in self._templates:
            self._templates[message_of, key] = messages.Template(lambda v: message_of(v, self._level, key), len(values))
        return self._templates[message_of, key].filled(stamp_ns, values)


def _odometry(v: np.ndarray, level: str, point: str) -> Any:
    pose = (tuple(v[:3]), tuple(v[3:7])), v[7:43]
    twist = (tuple(v[43:46]), tuple(v[46:49])), v[49:85]
    return make(topics.ODOMETRY, header(0, level), point, pose, twist)


def _acceleration(v: np.ndarray, level: str, _: str) -> Any:
    return make(topics.ACCELERATION, header(0, level), ((tuple(v[:3]), (0.0, 0.0, 0.0)), v[3:39]))


def _calm_window(v: np.ndarray, level: str, times_ns: Sequence[int]) -> Any:
    points = [messages.trajectory_point(time, [value]) for time, value in zip(times_ns, v, strict=True)]
    return make(topics.TRAJECTORY, header(0, level), ['probability'], points)


def _point_horizon(v: np.ndarray, level: str, leads_ns: Sequence[int]) -> Any:
    points = [messages.trajectory_point(lead, *row) for lead, row in zip(leads_ns, v.reshape(-1, 3, 2), strict=True)]
    return make(topics.TRAJECTORY, header(0, level), ['heave', 'heave_std'], points)
