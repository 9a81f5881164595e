"""Between ROS messages and the plain values of the cores.

ROS does not check the types of fields: an int or a numpy.float32 in a float64 goes out as garbage.
Everything that goes in here is a Python float or int.
"""
import sys
from array import array

import numpy as np
from builtin_interfaces.msg import Duration, Time
from sensor_msgs.msg import Imu, PointCloud2, PointField
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from swath_sysid.attitude.identification.refit import COEFFICIENT_NAMES, coefficients
from swath_sysid.attitude.motion.intake import ImuReading
from swath_sysid.attitude.motion.window import COLUMNS, MotionTable
from swath_sysid.attitude.prediction.forecast import NOT_GIVEN
from swath_sysid.common.errors import InputError

NANOSECONDS = 1_000_000_000
ROW_BYTES = 8 * len(COLUMNS)


def stamp_ns(stamp):
    """A builtin_interfaces/Time in nanoseconds."""
    return stamp.sec * NANOSECONDS + stamp.nanosec


def time_message(nanoseconds):
    """A builtin_interfaces/Time of nanoseconds."""
    seconds, rest = divmod(int(nanoseconds), NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)


def imu_reading(message):
    """The plain values of a sensor_msgs/Imu.

    Parameters
    ----------
    message : sensor_msgs.msg.Imu

    Returns
    -------
    ImuReading
    """
    turn, rates, force = message.orientation, message.angular_velocity, message.linear_acceleration
    return ImuReading(
        stamp_ns(message.header.stamp),
        (turn.x, turn.y, turn.z, turn.w),
        message.orientation_covariance.tolist(),
        (rates.x, rates.y, rates.z),
        message.angular_velocity_covariance.tolist(),
        (force.x, force.y, force.z),
        message.linear_acceleration_covariance.tolist(),
    )


class AttitudeMessage:
    """A sensor_msgs/Imu for forecasts, made once and filled again for each.

    Parameters
    ----------
    frame_id : str
    """

    def __init__(self, frame_id):
        self._message = Imu()
        self._message.header.frame_id = frame_id
        self._message.linear_acceleration_covariance[:] = NOT_GIVEN

    def filled(self, forecast):
        """The message of an `AttitudeForecast`; valid until the next call."""
        message = self._message
        message.header.stamp = time_message(forecast.stamp_ns)
        turn, rates = message.orientation, message.angular_velocity
        turn.x, turn.y, turn.z, turn.w = forecast.orientation
        message.orientation_covariance[:] = forecast.orientation_covariance
        rates.x, rates.y, rates.z = forecast.rates
        message.angular_velocity_covariance[:] = forecast.rates_covariance
        return message


def horizon_message(horizon, frame_id):
    """The trajectory_msgs/JointTrajectory of a `HorizonForecast`."""
    message = JointTrajectory(joint_names=list(horizon.columns))
    message.header.stamp = time_message(horizon.stamp_ns)
    message.header.frame_id = frame_id
    for lead, angles, rates in zip(
        horizon.leads_ns, horizon.positions.tolist(), horizon.velocities.tolist(), strict=True
    ):
        seconds, rest = divmod(lead, NANOSECONDS)
        message.points.append(JointTrajectoryPoint(
            positions=array('d', angles), velocities=array('d', rates),
            time_from_start=Duration(sec=seconds, nanosec=rest),
        ))
    return message


def window_message(table, frame_id):
    """The sensor_msgs/PointCloud2 of a `MotionTable`: a row a sample."""
    message = PointCloud2(
        height=1, width=len(table.rows), point_step=ROW_BYTES, row_step=ROW_BYTES * len(table.rows),
        is_bigendian=sys.byteorder == 'big', is_dense=bool(np.isfinite(table.rows).all()),
        fields=[
            PointField(name=name, offset=8 * index, datatype=PointField.FLOAT64, count=1)
            for index, name in enumerate(COLUMNS)
        ],
    )
    message.header.stamp = time_message(table.stamp_ns)
    message.header.frame_id = frame_id
    # element by element, were it not an array of bytes
    data = array('B')
    data.frombytes(np.ascontiguousarray(table.rows).tobytes())
    message.data = data
    return message


def window_table(message):
    """The `MotionTable` of a sensor_msgs/PointCloud2, whatever order its columns have.

    Raises
    ------
    InputError
        A column is missing or of another type, or the data are cut off.
    """
    fields = {field.name: field for field in message.fields}
    order = '>' if message.is_bigendian else '<'
    count = message.width * message.height
    for name in COLUMNS:
        if name not in fields or fields[name].datatype != PointField.FLOAT64:
            raise InputError(f'the window has no FLOAT64 column {name}: publish the table that imu_buffer publishes')
        if fields[name].offset + 8 > message.point_step:
            raise InputError(f'the column {name} of the window reaches beyond its rows: look at point_step and offsets')
    if len(message.data) < count * message.point_step:
        raise InputError(
            f'the window ends after {len(message.data)} bytes of {count * message.point_step}: send it again'
        )
    layout = np.dtype({
        'names': COLUMNS, 'formats': [f'{order}f8'] * len(COLUMNS),
        'offsets': [fields[name].offset for name in COLUMNS], 'itemsize': message.point_step,
    })
    table = np.frombuffer(memoryview(message.data), dtype=layout, count=count)
    rows = np.stack([table[name].astype(float) for name in COLUMNS], axis=1)
    return MotionTable(rows, stamp_ns(message.header.stamp))


def coefficients_message(models):
    """The std_msgs/Float64MultiArray of models by axis, with the labels of rows and columns."""
    axes, values = coefficients(models)
    columns = len(COEFFICIENT_NAMES)
    message = Float64MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label=','.join(axes), size=len(axes), stride=values.size),
        MultiArrayDimension(label=','.join(COEFFICIENT_NAMES), size=columns, stride=columns),
    ]
    message.data = array('d', values.ravel().tolist())
    return message
