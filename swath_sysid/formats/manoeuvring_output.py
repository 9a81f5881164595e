"""What manoeuvring_predictor would have published on a record, written as mcap without ROS."""

import os

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.mcap_checksums import add_checksums
from swath_sysid.manoeuvring.prediction.pipeline import (
    PATH_TOPIC,
    ManoeuvreOutlook,
    OdometryReading,
    manoeuvring_lead_topic,
)

ODOMETRY, PATH = 'nav_msgs/msg/Odometry', 'nav_msgs/msg/Path'
PLACES = (0, 1, 5)
"""Rows of x, y, yaw (and of their rates) in a covariance of six."""

NANOSECONDS = 1_000_000_000


def play_manoeuvres(trial, settings, identified=None):
    """Forecasts on a trial, as the live node makes them; same trial, same numbers.

    Parameters
    ----------
    trial : ManoeuvringTrial
        Of a bag, in ENU, with everything that an odometry holds.
    settings : ManoeuvreOutlookSettings
    identified : IdentifiedManoeuvringModel, optional

    Yields
    ------
    float, OutlookStep
        Time and forecasts, where some were due.

    Raises
    ------
    InputError
        The trial lacks what an odometry holds, or its thrust is not of the model's kind.
    """
    names = ('x', 'y', 'heading', 'surge', 'sway')
    missing = [name for name in (*names, 'yaw_rate') if getattr(trial, name) is None]
    if missing:
        raise InputError(f'{trial.source} lacks {", ".join(missing)}: play a bag with odometry through')
    if identified is not None and identified.model.thrust_input != trial.thrust_input:
        raise InputError(f'{trial.source} holds thrust as {trial.thrust_input}, the model takes '
                         f'{identified.model.thrust_input}: give --thrust-input if that was mistaken')  # fmt: skip
    outlook = ManoeuvreOutlook(settings, identified)
    rate = np.nan
    for k, stamp in enumerate(trial.time.tolist()):
        for side in ('port', 'starboard'):
            value = float(getattr(trial, side)[k])
            if np.isfinite(value):
                outlook.add_thrust(stamp, side, value)
        if np.isfinite(trial.yaw_rate[k]):
            rate = float(trial.yaw_rate[k])
            outlook.add_yaw_rate(stamp, rate)
        values = [float(getattr(trial, name)[k]) for name in names]
        if np.all(np.isfinite(values)) and np.isfinite(rate):
            step = outlook.add_odometry(OdometryReading(stamp, *values, rate, {}))
            if step.path:
                yield stamp, step


def write_forecasts(path, forecasts, leads, namespace=''):
    """Write forecasts as mcap on the topics of manoeuvring_predictor.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap``.
    forecasts : iterable of (float, OutlookStep)
    leads : sequence of float
    namespace : str

    Returns
    -------
    int
        Number of forecasts.

    Raises
    ------
    InputError
        The name does not end in .mcap, or the file cannot be written.
    """
    if not str(path).endswith('.mcap'):
        raise InputError(f"the forecasts are written as mcap: give a name that ends in .mcap, not '{path}'")
    store = get_typestore(Stores.ROS2_JAZZY)
    count = 0
    with replacing(path) as temporary:
        folder = temporary.with_suffix('')
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            topics = [(PATH_TOPIC, PATH), *((manoeuvring_lead_topic(lead), ODOMETRY) for lead in leads)]
            prefix = f'/{namespace}/' if namespace else '/'
            connections = [writer.add_connection(prefix + topic, kind, typestore=store) for topic, kind in topics]
            for stamp, step in forecasts:
                count += 1
                messages = [_path(store.types, stamp, step.path), *(_odometry(store.types, s) for s in step.leads)]
                for connection, (_, kind), message in zip(connections, topics, messages, strict=True):
                    writer.write(connection, round(stamp * NANOSECONDS), store.serialize_cdr(message, kind))
        add_checksums(folder / f'{folder.name}.mcap')
        os.replace(folder / f'{folder.name}.mcap', temporary)
    return count


def _header(types, stamp):
    seconds, nanoseconds = divmod(round(stamp * NANOSECONDS), NANOSECONDS)
    time = types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
    return types['std_msgs/msg/Header'](stamp=time, frame_id='odom')


def _pose(types, state):
    half = 0.5 * state.heading
    return types['geometry_msgs/msg/Pose'](
        position=types['geometry_msgs/msg/Point'](x=state.x, y=state.y, z=0.0),
        orientation=types['geometry_msgs/msg/Quaternion'](x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half))),
    )  # fmt: skip


def _path(types, stamp, path):
    stamped = types['geometry_msgs/msg/PoseStamped']
    poses = [stamped(header=_header(types, s.stamp), pose=_pose(types, s)) for s in path]
    return types[PATH](header=_header(types, stamp), poses=poses)


def _odometry(types, state):
    vector = types['geometry_msgs/msg/Vector3']
    twist = types['geometry_msgs/msg/Twist'](
        linear=vector(x=state.surge, y=state.sway, z=0.0), angular=vector(x=0.0, y=0.0, z=state.yaw_rate))
    return types[ODOMETRY](
        header=_header(types, state.stamp), child_frame_id='base_link',
        pose=types['geometry_msgs/msg/PoseWithCovariance'](
            pose=_pose(types, state), covariance=_six(state.pose_covariance)),
        twist=types['geometry_msgs/msg/TwistWithCovariance'](twist=twist, covariance=_six(state.twist_covariance)),
    )  # fmt: skip


def _six(block):
    """Covariance of x, y, yaw as one of six, shape (36,)."""
    full = np.zeros((6, 6))
    full[np.ix_(PLACES, PLACES)] = block
    return full.ravel()
