"""The mounting of a sensor, estimated from the craft at rest and a push about an axis that is known."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.attitude import tilt_angles, up_in_body
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError

PUSHED = {'bow': 1, 'starboard': 0}  #: What is pushed down, and the craft's axis that turns positively then.

SMALLEST_PUSH = np.radians(1.0)  #: A smaller one does not show its axis.
ONE_AXIS = 0.3  #: Motion across the axis of the push, as a share of that about it, up to which it shows one axis.
_REST, _PAUSE = 0.5, 2.0  # s at least: of rest before the push, and after it, before whatever comes next


@dataclass(frozen=True)
class MountingEstimate:
    """A mounting, and how well it is known."""

    angles: tuple[float, float, float]  #: Roll, pitch, yaw, rad, as of an `Installation`.
    yaw_spread: float  #: rad; by which the halves of the motion differ about the vertical.
    rest: float  #: s of rest that roll and pitch are from.
    push: float  #: rad; the largest angle of the push.


def estimate_mounting(trial: Trial, pushed: str) -> MountingEstimate:
    """From a record in the axes of the sensor that begins at rest; of several pushes the first counts.

    At rest the craft is level, so up in the sensor's axes is the craft's z axis; what up then turns about is the axis
    of the push, ``(u - u_0) x u_0 = sin(angle) a`` for a turn of the craft about ``a``, across ``u_0``.

    Args:
        trial: Read without a mounting, with roll and pitch.
        pushed: One of `PUSHED`: what goes down first.

    Raises:
        InputError: There is no roll or pitch, no rest at the start, no push, or one about two axes.
    """
    if trial.roll is None or trial.pitch is None:
        raise InputError(f'{trial.source} has no orientation, which rest and push show in: record one that has')
    known = np.isfinite(trial.roll) & np.isfinite(trial.pitch)
    time, up = trial.time[known], np.stack(up_in_body(trial.roll[known], trial.pitch[known]), axis=1)
    if len(time) < 10:
        raise InputError(f'{trial.source} holds {len(time)} samples with an orientation: record rest and a push')
    swing = np.linalg.norm(up - np.median(up, axis=0), axis=1).max()
    if swing < SMALLEST_PUSH:
        raise InputError(
            f'{trial.source} shows no push, but at most {np.degrees(swing):.1f} deg: push the {pushed} down further'
        )
    first = up[time < time[0] + _REST].mean(axis=0)
    away = np.linalg.norm(up - first / np.linalg.norm(first), axis=1)
    onset, is_quiet = int(np.argmax(away > SMALLEST_PUSH)), away < 0.5 * SMALLEST_PUSH
    # where the motion had hardly begun
    rest = int(np.flatnonzero(is_quiet[: onset + 1])[-1:].sum()) + 1
    moving = rest + np.flatnonzero(~is_quiet[rest:])
    end = int(np.append(moving[:-1][np.diff(time[moving]) > _PAUSE], len(time))[0])
    vertical = up[:rest].mean(axis=0)
    vertical /= np.linalg.norm(vertical)
    turn = np.cross(up[rest:end] - vertical, vertical)
    if time[rest - 1] - time[0] < _REST or not len(turn):
        raise InputError(f'{trial.source} does not begin at rest: leave the craft alone for some seconds, then push it')
    axis, across, sizes = _axis_of(turn, vertical)
    push = float(np.arcsin(min(np.abs(turn @ axis).max(), 1.0)))
    if sizes[1] > ONE_AXIS * sizes[0]:
        raise InputError(
            f'{trial.source} turns about two axes ({sizes[1] / sizes[0]:.0%} across that of the push): push the '
            f'{pushed} alone, in still water, and let the motion die out before any other push'
        )
    about = turn @ axis
    if about[np.argmax(np.abs(about) > 0.5 * np.abs(about).max())] < 0.0:
        axis = -axis
    energy = np.cumsum((turn @ axis) ** 2)
    half = int(np.searchsorted(energy, 0.5 * energy[-1]))
    yaws = [
        np.arctan2(part @ across, part @ axis)
        for part in (_axis_of(p, vertical)[0] for p in (turn[:half], turn[half:]))
    ]
    spread = abs(float(np.angle(np.exp(2j * (yaws[0] - yaws[1]))))) / 2.0
    other = np.cross(axis, vertical) if PUSHED[pushed] else np.cross(vertical, axis)
    turned = np.stack([other, axis, vertical] if PUSHED[pushed] else [axis, other, vertical])
    roll, pitch = map(float, tilt_angles(*turned[2]))
    yaw = float(np.arctan2(turned[1, 0], turned[0, 0]))
    return MountingEstimate((roll, pitch, yaw), spread, float(time[rest - 1] - time[0]), push)


def _axis_of(turn: np.ndarray, vertical: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The axis that rotations (N, 3) are mostly about, that across both it and up, and the sizes about the two."""
    values, vectors = np.linalg.eigh(turn.T @ turn)
    axis = vectors[:, 2] - (vectors[:, 2] @ vertical) * vertical
    axis /= np.linalg.norm(axis)
    return axis, np.cross(vertical, axis), np.sqrt(np.maximum(values[[2, 1]], 0.0))
