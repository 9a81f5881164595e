"""Corrects signs, sides and frames of the channels by evidence pooled over all runs of a craft.

A single run may mislead: a craft that spins in place moves ahead or astern whatever its thrust. So thrust is judged
only where it drives the craft ahead or astern, and without agreement of the runs nothing is changed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.motion.resampling import MOVING, TURNING, even, lowpass, speeds_of_track
from swath_sysid.manoeuvring.motion.trial import STEP, ManoeuvringTrial

SEEN = 0.5  #: A pooled correlation beyond this, of the wrong sign, shows a reversed channel.
SEEN_IN_SPEED = 0.7  #: The same for speed, which lags behind thrust.
DRIVEN = 0.3  #: Least total thrust as a share of the thrust difference; below it a craft turns in place.


def mirrored(trial: ManoeuvringTrial) -> ManoeuvringTrial:
    """The trial with port and starboard motion exchanged: NED to ENU, and back; thrusters stay."""
    changed = {name: -getattr(trial, name) for name in ('sway', 'yaw_rate') if getattr(trial, name) is not None}
    if trial.heading is not None:
        changed['heading'] = math.pi / 2 - trial.heading
    if trial.x is not None and trial.y is not None:
        changed.update(x=trial.y, y=trial.x)
    return replace(trial, **changed)


def set_right(trials: list[ManoeuvringTrial], advice: list[list[Advice]]) -> list[ManoeuvringTrial]:
    """The trials of one craft in ENU, reversed and swapped channels corrected; appends to each ``advice``."""
    for trial in trials:
        if trial.frame not in (None, 'enu', 'ned'):
            raise InputError(f"{trial.source}: there is no frame '{trial.frame}': state enu or ned")
    trials = [mirrored(t) if t.frame == 'ned' else t for t in trials]
    trials = _with_heading_along_course(trials, advice)
    for name, (pair, key) in _CHANNELS.items():
        if _likeness([pair(t) for t in trials]) < -SEEN:
            trials = _reversed(trials, advice, (name,), key)
    trials = _with_thrust_ahead(trials, advice)
    return _with_sides(trials, advice)


def _likeness(pairs: Sequence[tuple | None]):
    """Correlation about zero of pooled pairs of series; 0 where none is usable."""
    usable = [pair for pair in pairs if pair is not None and len(pair[0])]
    if not usable:
        return 0.0
    a, b = (np.concatenate(side) for side in zip(*usable, strict=True))
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0.0 else 0.0


def _reversed(trials: Sequence[ManoeuvringTrial], advice: list[list[Advice]], names: Sequence[str], key: str):
    """The trials with some channels multiplied by -1."""
    found = []
    for trial, item in zip(trials, advice, strict=True):
        held = {name: -getattr(trial, name) for name in names if getattr(trial, name) is not None}
        if held:
            item.append(Advice.of(key, source=trial.source))
        found.append(replace(trial, **held))
    return found


def _courses(trial: ManoeuvringTrial):
    """Course over ground and heading under way, rad; None where not measured."""
    _, (heading, x, y) = even(trial, 'heading', 'x', 'y')
    span = round(2.0 / STEP)
    if heading is None or x is None or y is None or heading.size < 4 * span:
        return None
    ahead, aside = x[2 * span :] - x[: -2 * span], y[2 * span :] - y[: -2 * span]
    moving = np.hypot(ahead, aside) > 2 * span * STEP * MOVING
    if moving.sum() < 2 * span:
        return None
    return np.arctan2(aside, ahead)[moving], heading[span:-span][moving]


def _with_heading_along_course(trials: Sequence[ManoeuvringTrial], advice: list[list[Advice]]):
    """The trials with headings mirrored or turned by quarters to match the course over ground."""
    pairs = [pair for pair in map(_courses, trials) if pair is not None]
    if not pairs:
        return trials
    course, heading = (np.concatenate(side) for side in zip(*pairs, strict=True))
    straight, reverse = np.mean(np.exp(1j * (course - heading))), np.mean(np.exp(1j * (course + heading)))
    quarters, mirrored_quarters = (round(np.angle(mean) / (math.pi / 2)) % 4 for mean in (straight, reverse))
    # on straight courses both readings are possible: a heading that agrees, else a compass' (clockwise from north)
    alike = abs(abs(straight) - abs(reverse)) < 0.2
    if max(abs(straight), abs(reverse)) < 0.8:
        return trials
    if (abs(straight) > abs(reverse) or alike) and quarters in (0, 2):
        return trials
    mirror = abs(reverse) > abs(straight) + 0.2 or (alike and mirrored_quarters == 1)
    if alike and not mirror:
        return trials
    turn = mirrored_quarters if mirror else quarters
    key = 'mixed-frames' if mirror else 'mixed-frames: turned'
    found = []
    for trial, item in zip(trials, advice, strict=True):
        if trial.heading is not None:
            item.append(Advice.of(key, source=trial.source, turn=90 * turn))
            sign = -1.0 if mirror else 1.0
            trial = replace(trial, heading=turn * math.pi / 2 + sign * trial.heading)
        found.append(trial)
    return found


def _heading_and_rate(trial: ManoeuvringTrial):
    """Slope of the heading and yaw rate."""
    _, (heading, rate) = even(trial, 'heading', 'yaw_rate')
    if heading is None or rate is None:
        return None
    slope, rate = np.gradient(lowpass(heading, 0.5), STEP), lowpass(rate, 0.5)
    return (slope - slope.mean(), rate - rate.mean()) if min(np.std(rate), np.std(slope)) > TURNING else None


def _speed_and_track(name: str, place: int):
    def pair(trial: ManoeuvringTrial) -> tuple | None:
        _, (measured,) = even(trial, name)
        track = speeds_of_track(trial)
        if measured is None or track is None or np.sqrt(np.mean(track[place] ** 2)) < 0.1:
            return None
        # about zero, not about the mean: a steady speed shows its sign as well
        return measured, track[place]

    return pair


#: Channel to the pair to compare it in, and the advice where it is reversed.
_CHANNELS: dict[str, tuple[Callable[[ManoeuvringTrial], tuple | None], str]] = {
    'yaw_rate': (_heading_and_rate, 'yaw-rate-reversed'),
    'surge': (_speed_and_track('surge', 0), 'surge-reversed: by position'),
    'sway': (_speed_and_track('sway', 1), 'sway-reversed'),
}


def _with_thrust_ahead(trials: Sequence[ManoeuvringTrial], advice: list[list[Advice]]):
    """The trials with thrust, or surge, reversed where the craft moves astern under positive thrust."""
    if _thrust_likeness(trials, 'surge', 1.0, 0.1, (0.5, 2.0, 5.0)) > -SEEN_IN_SPEED:
        return trials
    # a surge that agrees with the track is not suspected, nor a thrust that turns the craft as it should
    confirmed = any(t.x is not None and t.heading is not None for t in trials)
    if confirmed or _turning_likeness(trials) < -SEEN:
        return _reversed(trials, advice, ('port', 'starboard'), 'thrust-reversed')
    return _reversed(trials, advice, ('surge',), 'surge-reversed')


def _thrust_likeness(
    trials: Sequence[ManoeuvringTrial], name: str, side: float, least: float, lags: tuple[float, ...]
) -> float:
    """Correlation of a motion with the starboard thrust plus ``side`` times the port thrust, at the first-order lag, s,
    where it is largest. Only motion of a root mean square beyond ``least`` counts, and only where the thrust drives the
    craft ahead or astern instead of turning it in place.
    """

    def pair(trial: ManoeuvringTrial, lag: float) -> tuple | None:
        _, (motion, heading, port, starboard) = even(trial, name, 'heading', 'port', 'starboard')
        if motion is None and name == 'yaw_rate' and heading is not None:
            motion = np.gradient(lowpass(heading, 0.5), STEP)
        if motion is None or port is None or starboard is None or np.sqrt(np.mean(motion**2)) < least:
            return None
        driven = np.abs(starboard + port) > DRIVEN * np.abs(starboard - port)
        return lowpass(starboard + side * port, lag)[driven], motion[driven]

    return max((_likeness([pair(t, lag) for t in trials]) for lag in lags), key=abs)


def _turning_likeness(trials: Sequence[ManoeuvringTrial]):
    """Correlation of the thrust difference with the yaw rate."""
    return _thrust_likeness(trials, 'yaw_rate', -1.0, 0.01, (0.3, 1.0, 3.0))


def _with_sides(trials: Sequence[ManoeuvringTrial], advice: list[list[Advice]]):
    """The trials with thrusters swapped, or mirrored where no frame is stated, if they turn to the wrong side."""
    found = list(trials)
    for stated in (True, False):
        places = [k for k, trial in enumerate(trials) if (trial.frame is not None) == stated]
        if not places or _turning_likeness([trials[k] for k in places]) > -SEEN:
            continue
        for k in places:
            trial = trials[k]
            if stated:
                found[k] = replace(trial, port=trial.starboard, starboard=trial.port)
                advice[k].append(Advice.of('thrusters-swapped', source=trial.source, frame=trial.frame))
            else:
                found[k] = mirrored(trial)
                advice[k].append(Advice.of('frame-assumed', source=trial.source))
    return found
