"""Sensing: what an IMU says, in whatever frame it sits, as the motion of the craft."""
from dataclasses import dataclass
from functools import cached_property
from math import isfinite

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.motion import attitude
from swath_sysid.motion.cleaning import clean
from swath_sysid.motion.installation_checks import contradictions_in
from swath_sysid.motion.trial import CHANNELS, Trial

FRAMES = ('flu', 'frd')
"""Sensor axes forward-left-up in an ENU world, or forward-right-down in a NED world."""

QUATERNION = ('quaternion_x', 'quaternion_y', 'quaternion_z', 'quaternion_w')
GYRO = ('gyro_x', 'gyro_y', 'gyro_z')
ACCEL = ('accel_x', 'accel_y', 'accel_z')


@dataclass(frozen=True)
class Installation:
    """How a sensor sits in the craft.

    Its readings are first brought from its frame to FLU in ENU, then turned by the mounting.

    Attributes
    ----------
    frame : str
        One of `FRAMES`: what the sensor's axes and angles mean.
    mounting : tuple of 3 floats
        rad: roll, pitch, yaw of the sensor's (FLU) axes as seen from the craft's.

    Raises
    ------
    InputError
        There is no such frame, or the mounting is not three finite angles.
    """

    frame: str = 'flu'
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self):
        if self.frame not in FRAMES:
            raise InputError(f"there is no frame '{self.frame}': choose one of {', '.join(FRAMES)}")
        if len(self.mounting) != 3 or not all(isfinite(angle) for angle in self.mounting):
            raise InputError(f'a mounting is three finite angles (roll, pitch, yaw in rad), not {self.mounting}')

    @cached_property
    def is_turned(self):
        """Whether the sensor's axes are not the craft's."""
        return any(self.mounting)

    @cached_property
    def rotation(self):
        """The quaternion (x, y, z, w) that turns sensor vectors (FLU) into craft vectors."""
        return tuple(float(part) for part in attitude.quaternion(*self.mounting))

    def vector(self, x, y, z):
        """A rate or specific force in the sensor's axes, in those of the craft (FLU).

        Parameters
        ----------
        x, y, z : float or ndarray

        Returns
        -------
        x, y, z : float or ndarray
        """
        if self.frame == 'frd':
            x, y, z = attitude.swap_body_axes(x, y, z)
        return attitude.rotate(self.rotation, x, y, z) if self.is_turned else (x, y, z)

    def orientation(self, x, y, z, w):
        """The orientation of the sensor in its world, as that of the craft in ENU.

        Parameters
        ----------
        x, y, z, w : float or ndarray

        Returns
        -------
        x, y, z, w : float or ndarray
        """
        if self.frame == 'frd':
            x, y, z, w = attitude.swap_frames(x, y, z, w)
        if self.is_turned:
            x, y, z, w = attitude.multiply((x, y, z, w), attitude.conjugate(*self.rotation))
        return x, y, z, w


def imu_motion(orientation, rates, force, installation):
    """The motion of the craft from what one IMU message says (or many, as arrays).

    Without an orientation the body rates stand for the Euler rates.

    Parameters
    ----------
    orientation : tuple of 4 floats or ndarrays, or None
        Quaternion x, y, z, w.
    rates : tuple of 3 floats or ndarrays, or None
        rad/s.
    force : tuple of 3 floats or ndarrays, or None
        m/s^2.
    installation : Installation

    Returns
    -------
    dict of str to float or ndarray
        Those of ``roll``, ``pitch``, ``roll_rate``, ``pitch_rate``, ``accel_x``, ``accel_y``,
        ``accel_z`` that are known, as in `swath_sysid.motion.trial.Trial`. Where a quaternion is
        no orientation, angles and Euler rates are NaN.
    """
    motion = {}
    if orientation is not None:
        motion['roll'], motion['pitch'], _ = attitude.euler_angles(*installation.orientation(*orientation))
    if rates is not None:
        rates = installation.vector(*rates)
        if orientation is not None:
            rates = attitude.euler_rates(motion['roll'], motion['pitch'], *rates)
        motion['roll_rate'], motion['pitch_rate'] = rates[:2]
    if force is not None:
        motion.update(zip(ACCEL, installation.vector(*force), strict=True))
    return motion


def assemble_trial(time, readings, installation=None, *, source='', draft=None, initial_angle=None, advice=()):
    """A trial from the readings of a sensor: cleaned, in the craft's axes, with Euler rates.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Seconds.
    readings : dict of str to ndarray, shape (N,)
        Any of ``roll``, ``pitch``, ``yaw`` (rad), or the quaternion ``quaternion_x`` ... ``_w``;
        ``roll_rate``, ``pitch_rate`` (Euler rates), ``gyro_x`` ... ``_z`` (body rates), rad/s;
        ``accel_x`` ... ``_z`` (specific force), m/s^2.
    installation : Installation, optional
        By default the sensor's axes are those of the craft, FLU.
    source : str
        Where the readings came from.
    draft, initial_angle : float, optional
        m, rad.
    advice : tuple of Advice
        What the reader has to tell already.

    Returns
    -------
    Trial

    Raises
    ------
    InputError
        Nothing usable is left after cleaning, or a mounting is given for readings that cannot
        be turned.
    """
    installation = installation or Installation()
    name = source or 'the record'
    time, readings, cleaning_advice = clean(time, readings, name)
    channels, motion_advice = _craft_channels(readings, installation, name)
    channels = {key: values for key, values in channels.items() if np.isfinite(values).any()}
    contradictions = contradictions_in(time, channels, installation)
    trial = Trial(
        time=time, **{key: values for key, values in channels.items() if key in CHANNELS}, source=source, draft=draft,
        initial_angle=initial_angle, advice=(*advice, *cleaning_advice, *motion_advice, *contradictions),
    )
    if not trial.axes:
        raise InputError(f'{name} holds no usable roll or pitch, neither angle nor rate: check what the sensor sends')
    return trial


def _craft_channels(readings, installation, name):
    """The channels of a trial and the yaw from cleaned readings, and what to tell."""
    advice = []
    angles = _angles(readings, installation, name)
    if _has(readings, QUATERNION):
        invalid = int(np.count_nonzero(~attitude.is_orientation(*_parts(readings, QUATERNION))))
        if invalid:
            advice.append(Advice('invalid-orientation', (
                f'{invalid} of {len(readings[QUATERNION[0]])} quaternions are no orientation and were left out: '
                f'check the sensor driver'
            )))
        if not np.isfinite(angles['roll']).any():
            angles = {}
    rates = {}
    if any(part in readings for part in GYRO[:2]):
        body = _turned_vector(readings, GYRO, installation, name)
        if _has(body, GYRO) and 'roll' in angles and 'pitch' in angles:
            rates['roll_rate'], rates['pitch_rate'], rates['yaw_rate'] = attitude.euler_rates(
                angles['roll'], angles['pitch'], *_parts(body, GYRO))
        else:
            rates = {euler: body[part] for euler, part in (('roll_rate', GYRO[0]), ('pitch_rate', GYRO[1]))
                     if part in body}
    from_gyro = set(rates) - {'yaw_rate'}
    rates.update(_euler_rates(readings, installation, name))
    force = _turned_vector(readings, ACCEL, installation, name)
    if from_gyro - set(readings) and not ('roll' in angles and 'pitch' in angles and _has(readings, GYRO)):
        advice.append(Advice('body-rates', (
            'the angles (or a gyro axis) are not known, so body rates stand for the Euler rates, which is good for '
            'small angles only: record roll, pitch and all three gyro axes'
        )))
    return {**angles, **rates, **force}, advice


def _angles(readings, installation, name):
    """Roll, pitch and yaw of the craft, those that are known."""
    if _has(readings, QUATERNION):
        orientation = _parts(readings, QUATERNION)
    elif not installation.is_turned:
        sign = -1 if installation.frame == 'frd' else 1
        known = {axis: side * readings[axis] for axis, side in (('roll', 1), ('pitch', sign)) if axis in readings}
        if known and 'yaw' in readings:
            known['yaw'] = np.pi / 2 - readings['yaw'] if sign < 0 else readings['yaw']
        return known
    elif _has(readings, ('roll', 'pitch')):
        orientation = attitude.quaternion(readings['roll'], readings['pitch'], readings.get('yaw', 0.0))
    elif 'roll' in readings or 'pitch' in readings:
        raise InputError(f'{name} holds only one of roll and pitch, and a mounting can turn only both together: '
                         f'give both, or no mounting')
    else:
        return {}
    roll, pitch, yaw = attitude.euler_angles(*installation.orientation(*orientation))
    return {'roll': roll, 'pitch': pitch, 'yaw': yaw}


def _euler_rates(readings, installation, name):
    """The Euler rates of roll and pitch that were measured as such."""
    measured = [rate for rate in ('roll_rate', 'pitch_rate') if rate in readings]
    if measured and installation.is_turned:
        raise InputError(f'{name} holds Euler rates ({", ".join(measured)}), which a mounting cannot turn: '
                         f'give body rates (gyro_x, gyro_y, gyro_z), or no mounting')
    sign = {'roll_rate': 1, 'pitch_rate': -1 if installation.frame == 'frd' else 1}
    return {rate: sign[rate] * readings[rate] for rate in measured}


def _turned_vector(readings, names, installation, name):
    """A vector reading in the axes of the craft, those components that are known."""
    known = [part for part in names if part in readings]
    if not known:
        return {}
    if installation.is_turned and len(known) < 3:
        raise InputError(f'{name} holds only {", ".join(known)}, and a mounting can turn only all of '
                         f'{", ".join(names)}: give all three, or no mounting')
    turned = installation.vector(*(readings.get(part, np.nan) for part in names))
    return {part: values for part, values in zip(names, turned, strict=True) if part in readings}


def _has(readings, names):
    return all(part in readings for part in names)


def _parts(readings, names):
    return tuple(readings[part] for part in names)
