"""Gravity checked against the attitude: in size and in direction."""

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.contradictions import Contradiction
from swath_sysid.attitude.motion.rate_comparison import RateComparison
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.turned_axes import (
    TURNS,
    angles_of,
    in_degrees,
    mounting_after,
    nearest_quarter,
    turn_and_cure,
)

#: Of gravity by which a mean specific force may differ; consumer accelerometers are within a few percent.
GRAVITY_TOLERANCE = 0.2

NO_GRAVITY = 0.3  #: Of gravity below which a mean specific force holds none.
MIN_UPRIGHT = np.cos(np.radians(45.0))  #: Cosine of the largest mean list at which a craft floats.
MIN_LENGTH = 0.5  #: Of the mean of unit vectors, below which they have no direction in common.

#: Cosine between gravity and attitude below which they contradict each other; alignment errors are a few degrees.
CONTRADICTED = np.cos(np.radians(30.0))

#: Cosine between gravity and attitude from which an arrangement of the axes explains both.
AGREEMENT = np.cos(np.radians(20.0))

MIN_FOLLOWING = 0.5  #: Correlation of the horizontal accelerations with the tilt from which they follow it.

FRAMES_ALIKE = {'flu': 'forward-left-up', 'frd': 'forward-right-down'}
OPPOSITE_FRAME = {'flu': 'frd', 'frd': 'flu'}


def mean_up(angles: np.ndarray) -> np.ndarray | None:
    """Mean direction of up in the axes of the craft, shape (3,), as the angles (N, 3) have it; None: unknown."""
    roll, pitch = angles[:, 0], angles[:, 1]
    if not (np.isfinite(roll) & np.isfinite(pitch)).any():
        return None
    up = np.nanmean(attitude.up_in_body(roll, pitch), axis=1)
    length = float(np.linalg.norm(up))
    return up / length if length > MIN_LENGTH else None


def mean_force_of(force: np.ndarray) -> np.ndarray | None:
    """Mean of a specific force (N, 3) in units of gravity; None where unknown, or all zero: not set by the driver."""
    known = np.isfinite(force).all(axis=1)
    if not known.any() or not np.any(force[known]):
        return None
    return force[known].mean(axis=0) / STANDARD_GRAVITY


def size_of_gravity(mean_force: np.ndarray) -> list[Contradiction]:
    """What contradicts itself in the size of a mean specific force, in units of gravity."""
    size = float(np.linalg.norm(mean_force))
    if abs(size - 1.0) <= GRAVITY_TOLERANCE:
        return []
    measured = size * STANDARD_GRAVITY
    seen = f'the accelerations average {measured:.2f}'
    if abs(measured - 1.0) <= GRAVITY_TOLERANCE:
        code, sentence = (
            'accelerations-in-g',
            (
                f'{seen} where gravity is {STANDARD_GRAVITY:.2f} m/s^2: they are in g; give them in m/s^2 (multiplied '
                f'by {STANDARD_GRAVITY:.2f})'
            ),
        )
    elif size < NO_GRAVITY:
        code, sentence = (
            'gravity-missing',
            (
                f'{seen} m/s^2, without gravity: have the driver give the specific force, which reads '
                f'{STANDARD_GRAVITY:.2f} upward at rest, or none'
            ),
        )
    else:
        code, sentence = (
            'accelerations-scaled',
            (
                f'{seen} where gravity is {STANDARD_GRAVITY:.2f} m/s^2: give them in m/s^2, or calibrate the '
                'accelerometer'
            ),
        )
    return [Contradiction(code, sentence)]


def points_somewhere(mean_force: np.ndarray) -> bool:
    """Whether a mean specific force is large enough to have a direction, in m/s^2 or in g."""
    size = float(np.linalg.norm(mean_force))
    return size > NO_GRAVITY or abs(size * STANDARD_GRAVITY - 1.0) <= GRAVITY_TOLERANCE


def list_of_craft(up: np.ndarray, installation: Installation) -> list[Contradiction]:
    """A craft that would float on its side or upside down: a sensor that is turned, and consistently so."""
    if up[2] >= MIN_UPRIGHT:
        return []
    roll, pitch = attitude.tilt_angles(*up)
    mounting = mounting_after((nearest_quarter(roll), nearest_quarter(pitch), 0.0), installation)
    return [
        Contradiction(
            'sensor-turned',
            (
                f'the attitude averages roll {in_degrees([roll])[0]} deg and pitch {in_degrees([pitch])[0]} deg, at '
                f'which no craft floats, so this is its mounting: set mounting_deg to {mounting} (roll, pitch, yaw, '
                f'of which the yaw does not show)'
            ),
        )
    ]


def direction_of_gravity(
    direction: np.ndarray, up: np.ndarray | None, comparison: RateComparison | None, installation: Installation
) -> tuple[np.ndarray | None, list[Contradiction]]:
    """Compare the direction of gravity with the attitude.

    Args:
        direction: (3,); of the mean specific force; a unit vector.
        up: (3,), or None; that of the attitude; None: there is no attitude.
        comparison: Of the rates with the angles, to choose among turns; None: there is none.
        installation: What frame and mounting were taken to be.

    Returns:
        turn: (3, 3), or None; by which rates and accelerations are turned against the attitude; None: not at all, or by
            the frame alone.
        contradictions
    """
    if up is None:
        return None, _direction_alone(direction, installation)
    cosine = float(direction @ up)
    if cosine >= CONTRADICTED:
        return None, list_of_craft(up, installation)

    def agreement(turn: np.ndarray) -> float:
        return 0.0 if comparison is None else comparison.agreement(turn.T)

    best, best_score = None, -np.inf
    for turn in TURNS:
        if float(direction @ (turn.T @ up)) >= AGREEMENT and agreement(turn) > best_score + 1e-6:
            best, best_score = turn, agreement(turn)
    # the frame explains gravity that is opposite; a turn needs rates that say so, or no such explanation
    if -cosine >= AGREEMENT and (best is None or agreement(np.eye(3)) >= best_score - 1e-6):
        frame = OPPOSITE_FRAME[installation.frame]
        return None, [
            Contradiction(
                'axes-of-sensor',
                (
                    f'{_reading_of(direction)}, opposite to that of the attitude: its axes are {FRAMES_ALIKE[frame]}; '
                    f'set frame to {frame} (or, if they are {FRAMES_ALIKE[installation.frame]}, have the driver give '
                    f'the specific force, which points up at rest)'
                ),
            )
        ]
    if best is None:
        off = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        return TURNS[0], [
            Contradiction(
                'axes-of-sensor',
                (
                    f'gravity is {off:.0f} deg away from where the attitude puts it, which no right-angled mounting '
                    'explains: have the driver give orientation and accelerations in the same axes, and mounting_deg '
                    'say how these sit'
                ),
            )
        ]
    further = angles_of(best)
    likely = 'forward-right-down vectors beside a forward-left-up orientation, or a sensor upside down: '
    return best, [
        Contradiction(
            'axes-of-sensor',
            (
                f'{_reading_of(direction)} while by its attitude the craft floats upright: '
                f'{likely if in_degrees(further) == [180, 0, 0] else ""}{turn_and_cure(further, installation)}'
            ),
        )
    ]


def _direction_alone(direction: np.ndarray, installation: Installation) -> list[Contradiction]:
    """Without an orientation gravity alone gives the mounting, but for its yaw."""
    turn = max(TURNS, key=lambda turn: float(turn[2] @ direction))
    if direction[2] >= MIN_UPRIGHT or turn[2] @ direction < MIN_UPRIGHT:
        return []
    mounting = mounting_after(angles_of(turn), installation)
    cure = f'set mounting_deg to {mounting} (roll, pitch, yaw, of which the yaw does not show)'
    if direction[2] <= -MIN_UPRIGHT:
        frame = OPPOSITE_FRAME[installation.frame]
        cure = f'set frame to {frame} if its axes are {FRAMES_ALIKE[frame]}, or, if it hangs upside down, {cure}'
    return [Contradiction('axes-of-sensor', f'{_reading_of(direction)}: {cure}')]


def _reading_of(direction: np.ndarray) -> str:
    """What gravity reads, in words."""
    axis = int(np.argmax(np.abs(direction)))
    seen = f"gravity reads {STANDARD_GRAVITY * direction[axis]:+.1f} m/s^2 on the craft's {'xyz'[axis]} axis"
    if axis == 2:
        return f'{seen} where {STANDARD_GRAVITY:+.1f} is expected'
    return f'{seen} and {STANDARD_GRAVITY * direction[2]:+.1f} on z, where {STANDARD_GRAVITY:+.1f} is expected'


def accelerations_follow(angles: np.ndarray, force: np.ndarray) -> int:
    """Sign with which horizontal accelerations (of ``force``, (N, 3)) follow the tilt; 0 where they do not show it."""
    roll, pitch = angles[:, 0], angles[:, 1]
    known = np.isfinite(roll) & np.isfinite(pitch) & np.isfinite(force).all(axis=1)
    if not known.any():
        return 0
    up = np.stack(attitude.up_in_body(roll[known], pitch[known])[:2], axis=1)
    horizontal = force[known, :2]
    scale = np.sqrt(np.sum(up**2) * np.sum(horizontal**2))
    common = float(np.sum(up * horizontal) / scale) if scale > 0.0 else 0.0
    return int(np.sign(common)) if abs(common) > MIN_FOLLOWING else 0
