"""Corrections of signs, sides, frames and the compass by evidence pooled over all runs of a craft.

A single run may mislead: a craft that spins in place moves ahead or astern whatever its thrust. So thrust is judged
only where it drives the craft ahead or astern, and without agreement of the runs nothing is changed.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import SIGNIFICANT
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.motion.resampling import MOVING, TURNING, even, lowpass, speeds_of_track
from swath_sysid.manoeuvring.motion.trial import STEP, ManoeuvringTrial, turned

MIN_MISALIGNMENT = math.radians(4.0)
USUAL_CURRENT = 0.3  #: m/s, prior standard deviation of a current.

#: rad, prior standard deviation of the compass deviation by course, which the identification finds.
USUAL_DEVIATION = 0.15

#: Largest share of time that runs may turn to one side: drift would then look like misalignment.
ONE_SIDED = 0.75
REMEMBERED = 10.0  #: Half seconds of correlated sway, which count as one sample.


def aligned(trials: list[ManoeuvringTrial], advice: list[list[Advice]]) -> list[ManoeuvringTrial]:
    """The trials with heading and speeds turned by the misalignment of the compass, where it is significant. The sway
    is regressed on its causes: misalignment times speed, deviation times speed and sine and cosine of the course, the
    current by course, and turns by the yaw rate.
    """
    rows = [_sway_by_cause(t) for t in trials]
    usable = [r for r in rows if r is not None]
    if not usable:
        return trials
    rate = np.concatenate([causes[:, 1] for _, causes, _ in usable])
    if max(np.mean(rate > TURNING), np.mean(rate < -TURNING)) > ONE_SIDED:
        return trials
    sway, shared = (np.concatenate([row[k] for row in usable]) for k in (0, 1))
    matrix = np.concatenate([shared, block_diag(*(course for _, _, course in usable))], axis=1)
    prior = [0.0] * 3 + [USUAL_DEVIATION**-2.0] * 2 + [USUAL_CURRENT**-2.0] * 2 * len(usable)
    variance = max(float(np.var(sway)), 1e-6)
    for _ in range(3):
        information = matrix.T @ matrix / (variance * REMEMBERED) + np.diag(prior)
        covariance = np.linalg.pinv(information, hermitian=True)
        found = covariance @ (matrix.T @ sway) / (variance * REMEMBERED)
        variance = max(float(np.mean((sway - matrix @ found) ** 2)), 1e-6)
    offset, std = float(np.arctan(found[0])), float(np.sqrt(covariance[0, 0]))
    if abs(offset) < max(MIN_MISALIGNMENT, SIGNIFICANT * std):
        return trials
    size, side = abs(math.degrees(offset)), 'port' if offset > 0.0 else 'starboard'
    for item, trial in zip(advice, trials, strict=True):
        item.append(Advice.of('compass-misaligned', source=trial.source, offset=size, side=side))
    return [_turned(trial, offset) for trial in trials]


def _sway_by_cause(trial: ManoeuvringTrial):
    """Sway (N,) every half second under way ahead, its causes (N, 5), and the effect of an east and a north current (N,
    2). The causes are surge, yaw rate, their product, and surge times sine and cosine of the heading. None where not
    measured.
    """
    _, (heading, surge, sway) = even(trial, 'heading', 'surge', 'sway')
    if heading is None:
        return None
    if surge is None or sway is None:
        track = speeds_of_track(trial)
        if track is None:
            return None
        surge, sway = track
    rate = np.gradient(lowpass(heading, 0.5), STEP)
    surge, sway = lowpass(surge, 0.5), lowpass(sway, 0.5)
    keep = np.arange(surge.size) % round(0.5 / STEP) == 0
    keep &= surge > MOVING
    if keep.sum() < 10:
        return None
    causes = np.stack([surge, rate, surge * rate, surge * np.sin(heading), surge * np.cos(heading)], axis=1)
    return sway[keep], causes[keep], np.stack([-np.sin(heading), np.cos(heading)], axis=1)[keep]


def _turned(trial: ManoeuvringTrial, offset: float):
    """The trial with heading and speeds turned to port by an angle, rad."""
    changed: dict[str, Any] = {}
    if trial.heading is not None:
        changed['heading'] = trial.heading + offset
    if trial.surge is not None and trial.sway is not None:
        changed['surge'], changed['sway'] = turned(trial.surge, trial.sway, offset)
    return replace(trial, **changed)


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
