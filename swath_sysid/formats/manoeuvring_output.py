"""Forecasts of manoeuvring_predictor for a record, written as mcap without ROS."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.manoeuvring_messages import odometry_message, path_message
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.formats.output_bag import writing_output_bag
from swath_sysid.formats.topics import PATH_TOPIC, manoeuvring_lead_topic
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.motion.trial import ManoeuvringTrial
from swath_sysid.manoeuvring.prediction.pipeline import (
    ManoeuvreOutlook,
    ManoeuvreOutlookSettings,
    OdometryReading,
    OutlookStep,
)


def play_manoeuvres(
    trial: ManoeuvringTrial, settings: ManoeuvreOutlookSettings, identified: IdentifiedManoeuvringModel | None = None
) -> Iterator[tuple[float, OutlookStep]]:
    """Times and forecasts for the trial of a bag, in ENU, as the live node makes them; same trial, same numbers."""
    names = ('x', 'y', 'heading', 'surge', 'sway')
    missing = [name for name in (*names, 'yaw_rate') if getattr(trial, name) is None]
    if missing:
        raise InputError(f'{trial.source} lacks {", ".join(missing)}: play a bag with odometry through')
    if identified is not None and identified.model.thrust_input != trial.thrust_input:
        raise InputError(
            f'{trial.source} holds thrust as {trial.thrust_input}, the model takes '
            f'{identified.model.thrust_input}: state it if that was mistaken',
            'thrust-input-differs',
        )
    outlook = ManoeuvreOutlook(settings, identified)
    rate, yaw_rate = np.nan, np.asarray(trial.yaw_rate)
    for k, stamp in enumerate(trial.time.tolist()):
        for side in ('port', 'starboard'):
            value = float(getattr(trial, side)[k])
            if np.isfinite(value):
                outlook.add_thrust(stamp, side, value)
        if np.isfinite(yaw_rate[k]):
            rate = float(yaw_rate[k])
            outlook.add_yaw_rate(stamp, rate)
        motion = {name: float(getattr(trial, name)[k]) for name in names}
        if np.all(np.isfinite([*motion.values(), rate])):
            step = outlook.add_odometry(OdometryReading(stamp, **motion, yaw_rate=rate, std={}))
            if step.path:
                yield stamp, step


def write_forecasts(path: str | Path, forecasts: Iterable[tuple[float, OutlookStep]], leads: Sequence[float]) -> int:
    """Write forecasts, each with its stamp, s, as mcap on the topics of manoeuvring_predictor; returns their number."""
    count = 0
    with writing_output_bag(path) as bag:
        for stamp, step in forecasts:
            count += 1
            time_ns = round(stamp * SECOND_NS)
            bag.add(PATH_TOPIC, time_ns, path_message(step.path, stamp, 'odom'))
            for lead, state in zip(leads, step.leads, strict=True):
                bag.add(manoeuvring_lead_topic(lead), time_ns, odometry_message(state, 'odom', 'base_link'))
    return count
