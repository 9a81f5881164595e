"""A sensor's record, in whatever frame it was mounted, assembled to a trial of the craft."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.cleaning import clean
from swath_sysid.attitude.motion.sensor_checks import contradictions_in
from swath_sysid.attitude.motion.trial import CHANNELS, FURTHER_CHANNELS, Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.rounding import ROUNDING

QUATERNION = ('quaternion_x', 'quaternion_y', 'quaternion_z', 'quaternion_w')
GYRO = ('gyro_x', 'gyro_y', 'gyro_z')
ACCEL = ('accel_x', 'accel_y', 'accel_z')
EULER_RATES = ('roll_rate', 'pitch_rate', 'yaw_rate')


Readings = dict[str, np.ndarray]


def assemble_trial(
    time: np.ndarray,
    readings: Readings,
    installation: Installation | None = None,
    *,
    source: str = '',
    draft: float | None = None,
    initial_angle: float | None = None,
    advice: Sequence[Advice] = (),
) -> Trial:
    """A trial from the readings of a sensor, (N,) each, in SI units: cleaned, in the craft's axes, with Euler rates.

    Readings are any of ``roll``, ``pitch``, ``yaw`` or ``quaternion_x`` ... ``_w``; ``heading``, clockwise from north;
    Euler rates ``roll_rate`` ... or body rates ``gyro_x`` ...; specific force ``accel_x`` ...; ``heave`` along the
    frame's vertical.
    """
    installation = installation or Installation()
    name = source or 'the record'
    recorded = len(time)
    time, readings, cleaning_advice = clean(time, readings, name)
    channels, motion_advice = _craft_channels(time, readings, installation, name)
    channels = {key: values for key, values in channels.items() if np.isfinite(values).any()}
    contradictions = contradictions_in(time, channels, installation)
    trial = Trial(
        time=time,
        **{key: values for key, values in channels.items() if key in (*CHANNELS, *FURTHER_CHANNELS)},
        source=source,
        draft=draft,
        initial_angle=initial_angle,
        advice=(*advice, *cleaning_advice, *motion_advice, *contradictions),
        usable_share=len(time) / recorded,
    )
    if not trial.axes:
        raise InputError(f'{name} holds no usable roll or pitch, neither angle nor rate: check what the sensor sends')
    return trial


def turn_rate(time: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Rate, rad/s, (N,), of a wrapped yaw or heading, rad, since the sample before; NaN where a sample was lost."""
    rate = np.full(time.size, np.nan)
    interval = np.diff(time)
    # of two intervals or more a sample was lost, of none it was stamped by chance
    even = np.rint(interval / np.median(interval)) == 1.0
    rate[1:][even] = (np.remainder(np.diff(yaw) + np.pi, 2 * np.pi) - np.pi)[even] / interval[even]
    return rate


def _craft_channels(
    time: np.ndarray, readings: Readings, installation: Installation, name: str
) -> tuple[Readings, list[Advice]]:
    """The channels of a trial and the yaw from cleaned readings, and advice."""
    advice: list[Advice] = []
    angles = _angles(readings, installation, name)
    if _has(readings, QUATERNION):
        invalid = int(np.count_nonzero(~attitude.is_orientation(*_parts(readings, QUATERNION))))
        if invalid:
            advice.append(Advice.of('invalid-orientation', invalid=invalid, number=len(time)))
        if not np.isfinite(angles['roll']).any():
            angles = {}
    rates = {}
    if any(part in readings for part in GYRO[:2]):
        body = _turned_vector(readings, GYRO, installation, name)
        if _has(body, GYRO) and 'roll' in angles and 'pitch' in angles:
            turned = attitude.euler_rates(angles['roll'], angles['pitch'], *_parts(body, GYRO))
            rates = dict(zip(EULER_RATES, turned, strict=True))
        else:
            rates = {euler: body[part] for euler, part in zip(EULER_RATES, GYRO, strict=True) if part in body}
    from_gyro = set(rates) - {'yaw_rate'}
    rates.update(_euler_rates(readings, installation, name))
    if 'yaw_rate' not in rates and 'yaw' in angles:
        turning = turn_rate(time, angles['yaw'])
        # a heading that never turns was not measured but filled in
        if np.nanmax(np.abs(turning), initial=0.0) > ROUNDING:
            rates['yaw_rate'] = turning
    force = _turned_vector(readings, ACCEL, installation, name)
    if from_gyro - set(readings) and not ('roll' in angles and 'pitch' in angles and _has(readings, GYRO)):
        advice.append(Advice.of('body-rates'))
    heave = {'heave': _upward(installation) * readings['heave']} if 'heave' in readings else {}
    return {**angles, **rates, **force, **heave}, advice


def _angles(readings: Readings, installation: Installation, name: str) -> Readings:
    """Roll, pitch and yaw of the craft, those that are known."""
    # a heading turns as yaw does in NED, from any zero
    heading = -_upward(installation) * readings['heading'] if 'heading' in readings else None
    yaw = readings.get('yaw', heading)
    if _has(readings, QUATERNION):
        orientation = _parts(readings, QUATERNION)
    elif not installation.is_turned:
        upward = _upward(installation)
        angles = {axis: side * readings[axis] for axis, side in (('roll', 1), ('pitch', upward)) if axis in readings}
        return angles if yaw is None else {**angles, 'yaw': upward * yaw}
    elif _has(readings, ('roll', 'pitch')):
        orientation = attitude.quaternion(readings['roll'], readings['pitch'], 0.0 if yaw is None else yaw)
    elif 'roll' in readings or 'pitch' in readings:
        raise InputError(
            f'{name} holds only one of roll and pitch, and a mounting can turn only both together: '
            f'give both, or no mounting'
        )
    else:
        return {}
    roll, pitch, turned_yaw = attitude.euler_angles(*installation.orientation(*orientation))
    yaw_is_known = _has(readings, QUATERNION) or yaw is not None
    return {'roll': roll, 'pitch': pitch, 'yaw': turned_yaw} if yaw_is_known else {'roll': roll, 'pitch': pitch}


def _upward(installation: Installation) -> int:
    """The sign of the frame's vertical axis, and of pitch and yaw in it, in FLU and ENU."""
    return -1 if installation.frame == 'frd' else 1


def _euler_rates(readings: Readings, installation: Installation, name: str) -> Readings:
    """The Euler rates that were measured as such."""
    measured = [rate for rate in EULER_RATES if rate in readings]
    needed = [rate for rate in measured if rate != 'yaw_rate']
    if needed and installation.is_turned:
        raise InputError(
            f'{name} holds Euler rates ({", ".join(needed)}), which a mounting cannot turn: '
            f'give body rates (gyro_x, gyro_y, gyro_z), or no mounting'
        )
    if installation.is_turned:
        return {}
    sign = dict(zip(EULER_RATES, (1, _upward(installation), _upward(installation)), strict=True))
    return {rate: sign[rate] * readings[rate] for rate in measured}


def _turned_vector(readings: Readings, names: Sequence[str], installation: Installation, name: str) -> Readings:
    """A vector reading in the axes of the craft, those components that are known."""
    known = [part for part in names if part in readings]
    if not known:
        return {}
    if installation.is_turned and len(known) < 3:
        raise InputError(
            f'{name} holds only {", ".join(known)}, and a mounting can turn only all of '
            f'{", ".join(names)}: give all three, or no mounting'
        )
    turned = installation.vector(*(readings.get(part, np.nan) for part in names))
    return {part: values for part, values in zip(names, turned, strict=True) if part in readings}


def _has(readings: Readings, names: Sequence[str]) -> bool:
    return all(part in readings for part in names)


def _parts(readings: Readings, names: Sequence[str]) -> tuple[np.ndarray, ...]:
    return tuple(readings[part] for part in names)
