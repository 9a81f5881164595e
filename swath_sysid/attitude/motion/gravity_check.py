"""Gravity held against the attitude: in size and in direction."""
import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.contradictions import Contradiction
from swath_sysid.attitude.motion.rate_check import agreement
from swath_sysid.attitude.motion.turned_axes import (
    TURNS,
    angles_of,
    composed,
    in_degrees,
    nearest_quarter,
    turn_and_cure,
)

STANDARD_GRAVITY = 9.80665
"""m/s^2, ISO 80000-3."""

GRAVITY_TOLERANCE = 0.2
"""Of gravity by which a mean specific force may differ; consumer accelerometers are within a few percent."""

NO_GRAVITY = 0.3
"""Of gravity below which a mean specific force holds none."""

LARGEST_LIST = np.radians(45.0)
"""rad; no craft floats at a larger mean angle."""

LEAST_LENGTH = 0.5
"""Of the mean of unit vectors, below which they have no direction in common."""

LEAST_DISAGREEMENT = np.cos(np.radians(30.0))
"""Cosine between gravity and attitude below which they contradict each other; alignment errors are a few degrees."""

AGREEMENT = np.cos(np.radians(20.0))
"""Cosine between gravity and attitude from which an arrangement of the axes explains both."""

FRAMES_ALIKE = {'flu': 'forward-left-up', 'frd': 'forward-right-down'}

BODY_AXES = 'xyz'


def mean_up(angles):
    """Mean direction of up in the axes of the craft, as the angles say; None where they say none."""
    roll, pitch = angles[:, 0], angles[:, 1]
    if not (np.isfinite(roll) & np.isfinite(pitch)).any():
        return None
    up = np.nanmean(up_of(roll, pitch), axis=0)
    length = float(np.linalg.norm(up))
    return up / length if length > LEAST_LENGTH else None


def up_of(roll, pitch):
    """The last row of the rotation matrix from body to world, shape (N, 3)."""
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=1)


def mean_force_of(force):
    """Mean specific force in units of gravity; None where it is not known, or all zero: not set by the driver."""
    known = np.isfinite(force).all(axis=1)
    if not known.any() or not np.any(force[known]):
        return None
    return force[known].mean(axis=0) / STANDARD_GRAVITY


def size_of_gravity(mean_force):
    """What contradicts itself in the size of a mean specific force, in units of gravity."""
    size = float(np.linalg.norm(mean_force))
    if abs(size - 1.0) <= GRAVITY_TOLERANCE:
        return []
    measured = size * STANDARD_GRAVITY
    if abs(measured - 1.0) <= GRAVITY_TOLERANCE:
        return [Contradiction('accelerations-in-g', (
            f'the accelerations average {measured:.2f} where gravity is {STANDARD_GRAVITY:.2f} m/s^2: they are in g; '
            f'give them in m/s^2 (multiplied by {STANDARD_GRAVITY:.2f})'
        ))]  # fmt: skip
    if size < NO_GRAVITY:
        return [Contradiction('gravity-missing', (
            f'the accelerations average {measured:.2f} m/s^2, without gravity: let the driver give the specific force, '
            f'which reads {STANDARD_GRAVITY:.2f} upward at rest, or none'
        ))]  # fmt: skip
    return [Contradiction('accelerations-scaled', (
        f'the accelerations average {measured:.2f} where gravity is {STANDARD_GRAVITY:.2f} m/s^2: give them in m/s^2, '
        f'or calibrate the accelerometer'
    ))]  # fmt: skip


def points_somewhere(mean_force):
    """Whether a mean specific force is large enough to have a direction, in m/s^2 or in g."""
    size = float(np.linalg.norm(mean_force))
    return size > NO_GRAVITY or abs(size * STANDARD_GRAVITY - 1.0) <= GRAVITY_TOLERANCE


def list_of_craft(up, installation):
    """A craft that would float on its side or upside down: a sensor that is turned, and consistently so."""
    if up[2] >= np.cos(LARGEST_LIST):
        return []
    roll, pitch = attitude.tilt_angles(*up)
    mounting = composed((nearest_quarter(roll), nearest_quarter(pitch), 0.0), installation)
    return [Contradiction('sensor-turned', (
        f'the attitude averages roll {in_degrees([roll])[0]} deg and pitch {in_degrees([pitch])[0]} deg, at which no '
        f'craft floats, so this is how the sensor sits: set mounting_deg to {in_degrees(mounting)} (roll, pitch, yaw, '
        f'of which the yaw does not show)'
    ))]  # fmt: skip


def direction_of_gravity(direction, up, has_angles, comparison, installation):
    """The turn of the vectors against the attitude (None: none, or only the frame), and what contradicts itself."""
    if up is None or not has_angles:
        return _direction_alone(direction, installation)
    cosine = float(direction @ up)
    if cosine >= LEAST_DISAGREEMENT:
        return None, list_of_craft(up, installation)
    opposite = -cosine >= AGREEMENT
    best, best_score = None, -np.inf
    for turn in TURNS:
        if float(direction @ (turn.T @ up)) >= AGREEMENT:
            score = agreement(comparison, turn.T)
            if score > best_score + 1e-6:
                best, best_score = turn, score
    # the frame explains gravity that is opposite; a turn needs rates that say so, or no such explanation
    if opposite and (best is None or agreement(comparison, np.eye(3)) >= best_score - 1e-6):
        return None, [_other_frame(direction, up, installation)]
    if best is None:
        off = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        return TURNS[0], [Contradiction('axes-of-sensor', (
            f'gravity is {off:.0f} deg away from where the attitude puts it, which no right-angled mounting explains: '
            f'let the driver give orientation and accelerations in the same axes, and mounting_deg say how these sit'
        ))]  # fmt: skip
    return best, [_turned(best, direction, installation)]


def _direction_alone(direction, installation):
    """Without an orientation gravity alone says how the sensor sits, but for its yaw."""
    if direction[2] >= np.cos(LARGEST_LIST):
        return None, []
    turn = max(TURNS, key=lambda turn: turn[2] @ direction)
    if turn[2] @ direction < np.cos(LARGEST_LIST):
        return None, []
    mounting = composed(angles_of(turn), installation)
    frame = _opposite_frame(installation) if direction[2] <= -np.cos(LARGEST_LIST) else None
    cure = f'set mounting_deg to {in_degrees(mounting)} (roll, pitch, yaw, of which the yaw does not show)'
    if frame:
        cure = f'set frame to {frame} if its axes are {FRAMES_ALIKE[frame]}, or, if it hangs upside down, {cure}'
    return None, [Contradiction('axes-of-sensor', f'{_reading_of(direction)}: {cure}')]


def _other_frame(direction, up, installation):
    frame = _opposite_frame(installation)
    return Contradiction('axes-of-sensor', (
        f'{_reading_of(direction)}, opposite to what the attitude says: its axes are {FRAMES_ALIKE[frame]}; set frame '
        f'to {frame} (or, if they are {FRAMES_ALIKE[installation.frame]}, let the driver give the specific force, '
        f'which points up at rest)'
    ))  # fmt: skip


def _turned(turn, direction, installation):
    further = angles_of(turn)
    likely = ''
    if in_degrees(further) == [180, 0, 0]:
        likely = 'forward-right-down vectors beside a forward-left-up orientation, or a sensor upside down: '
    return Contradiction('axes-of-sensor', (
        f'{_reading_of(direction)} while the attitude says that the craft floats upright: {likely}'
        f'{turn_and_cure(further, installation)}'
    ))  # fmt: skip


def _reading_of(direction):
    axis = int(np.argmax(np.abs(direction)))
    return (
        f"gravity reads {STANDARD_GRAVITY * direction[axis]:+.1f} m/s^2 on the craft's {BODY_AXES[axis]} axis and "
        f'{STANDARD_GRAVITY * direction[2]:+.1f} on z, where {STANDARD_GRAVITY:+.1f} is expected'
        if axis != 2
        else f"gravity reads {STANDARD_GRAVITY * direction[2]:+.1f} m/s^2 on the craft's z axis where "
        f'{STANDARD_GRAVITY:+.1f} is expected'
    )


def _opposite_frame(installation):
    return 'flu' if installation.frame == 'frd' else 'frd'


def accelerations_follow(angles, force):
    """Sign with which the horizontal accelerations follow the tilt: +1, -1, or 0 where they do not tell."""
    roll, pitch = angles[:, 0], angles[:, 1]
    known = np.isfinite(roll) & np.isfinite(pitch) & np.isfinite(force).all(axis=1)
    if not known.any():
        return 0
    up, horizontal = up_of(roll[known], pitch[known])[:, :2], force[known, :2]
    scale = np.sqrt(np.sum(up**2) * np.sum(horizontal**2))
    common = float(np.sum(up * horizontal) / scale) if scale > 0.0 else 0.0
    return int(np.sign(common)) if abs(common) > 0.5 else 0
