"""Whether a sensor sits in the craft as it was said to, judged from its own data.

Gravity is held against the attitude, and the rates against the derivative of the angles. A sensor whose orientation,
rates and accelerations are all turned alike about the vertical agrees with itself: no such check can see it.
"""
from collections import deque
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.motion import attitude
from swath_sysid.motion.rate_comparison import compare_rates

STANDARD_GRAVITY = 9.80665
"""m/s^2, ISO 80000-3."""

WINDOW = 30.0
"""s; over so long the accelerations of waves average out."""

INTERVAL = 5.0
"""s between judgements of a running sensor."""

LEAST_DURATION = 10.0
"""s below which a mean acceleration is not taken for gravity while a sensor runs."""

BIN = 0.05
"""s; samples are averaged to so coarse a time base (or their own, where that is coarser): craft roll in 1 s and more."""

LEAST_BINS = 40
WINDOW_BINS = 300
"""Bins of a window of a sensor so slow that `WINDOW` holds fewer."""

FROZEN = 5.0
"""s of fresh stamps with the same values; the noise of a sensor does not repeat."""

GRAVITY_TOLERANCE = 0.2
"""Of gravity by which a mean specific force may differ; consumer accelerometers are within a few percent."""

NO_GRAVITY = 0.3
"""Of gravity below which a mean specific force holds none."""

LARGEST_LIST = np.radians(45.0)
"""rad; no craft floats at a larger mean angle."""

LEAST_DISAGREEMENT = np.cos(np.radians(30.0))
"""Cosine between gravity and attitude below which they contradict each other; alignment errors are a few degrees."""

AGREEMENT = np.cos(np.radians(20.0))
"""Cosine between gravity and attitude from which an arrangement of the axes explains both."""

FOLLOWS = 0.7
"""Correlation with the derivative of its angle from which a rate is that of the angle."""

EXPLAINS = 0.9
"""Mean correlation from which another arrangement of the axes explains the rates."""

LEAST_UNRELATED_BINS = 200
UNRELATED = 0.3
"""Correlation with every derivative below which a rate belongs to none."""

UNITS = {57.29578: 'deg/s where rad/s is expected', 1000.0: 'per s beside stamps in ms'}
UNIT_TOLERANCE = 1.3
"""Factor by which the rates may differ from the derivatives of the angles, and from a unit of `UNITS`."""

LAG_INTERVALS, LEAST_LAG, LAG_STDS = 2.5, 0.1, 4.0
"""A delay is told beyond so many sample intervals, so many seconds, and so many standard deviations of its own."""

LARGEST_OFFSET = np.radians(2.0)
"""rad/s; uncalibrated gyroscopes at rest stay within 1 deg/s by their data sheets."""

CONFIRMATIONS = 2
"""Judgements in a row that must agree on a contradiction, or on its end."""

FRAMES_ALIKE = {'flu': 'forward-left-up', 'frd': 'forward-right-down'}
AXIS_NAMES = ('roll', 'pitch', 'yaw')
BODY_AXES = 'xyz'


@dataclass(frozen=True)
class Contradiction(Advice):
    """A record or a sensor that contradicts itself, with what would mend it.

    Attributes
    ----------
    code, message : str
    axis : str or None
        ``roll`` or ``pitch`` where only that is concerned.
    """

    axis: str | None = None


@dataclass(frozen=True)
class Judgement:
    """What a stretch of data says of the installation.

    Attributes
    ----------
    contradictions : tuple of Contradiction
    gravity, rates : bool
        Whether there was enough to judge each by.
    """

    contradictions: tuple[Contradiction, ...] = ()
    gravity: bool = False
    rates: bool = False

    def decides(self, contradiction):
        """Whether there was enough to find this contradiction, had it been there."""
        return self.gravity if contradiction.code in GRAVITY_CODES else self.rates


GRAVITY_CODES = ('axes-of-sensor', 'accelerations-in-g', 'accelerations-scaled', 'gravity-missing', 'sensor-turned')
"""What is found at rest also; every other code needs angles that change, but `FROZEN_CODES`."""

FROZEN_CODES = ('sensor-frozen',)

CODES = (
    *GRAVITY_CODES, *FROZEN_CODES, 'rates-turned', 'rates-swapped', 'rate-sign', 'rate-unit', 'rate-scale', 'rate-late',
    'angle-late', 'rate-offset', 'rate-unrelated',
)  # fmt: skip


def _turns():
    """The 24 rotations that bring axes onto axes, the plainest first."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.zeros((3, 3))
        turn[range(3), order] = signs
        if np.linalg.det(turn) > 0.0:
            found.append(turn)
    return sorted(found, key=lambda turn: (-np.trace(turn), -turn[2, 2], -turn[0, 0]))


TURNS = tuple(_turns())
"""Each turns vectors in the sensor's axes into the craft's."""


def judge(time, angles, rates, force, *, installation, interval, least_duration=0.0):
    """Judge one stretch of data.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s, increasing.
    angles, rates, force : ndarray, shape (N, 3)
        Roll, pitch, yaw, rad; their rates, rad/s; specific force in the axes of the craft, m/s^2. All as the
        installation makes them; NaN where not known.
    installation : Installation
        What frame and mounting were taken to be.
    interval : float
        s between the samples of the sensor.
    least_duration : float
        s below which nothing is judged.

    Returns
    -------
    Judgement
    """
    if time.size < LEAST_BINS or time[-1] - time[0] < least_duration:
        return Judgement()
    if _is_frozen(time, angles, rates, force):
        return Judgement((Contradiction('sensor-frozen', (
            f'every value of the sensor has been the same for {FROZEN:g} s while its stamps go on: restart its driver, '
            f'and look for one that repeats its last message'
        )),), True, True)  # fmt: skip
    up, mean_force = _mean_up(angles), _mean_force(force)
    comparison = _compared(time, angles, rates)
    judges_rates = comparison is not None and bool(np.any(_evidenced(comparison)))
    found, turn = [], None
    if mean_force is not None:
        found += _size_of_gravity(mean_force)
    points = mean_force is not None and np.linalg.norm(mean_force) > NO_GRAVITY
    if points:
        turn, contradictions = _direction_of_gravity(
            mean_force / np.linalg.norm(mean_force), up, np.isfinite(angles[:, 0]).any(), comparison, installation
        )
        found += contradictions
    elif up is not None:
        found += _list_of_craft(up, installation)
    if comparison is not None and turn is None:
        found += _rates(comparison, interval, _accelerations_turned(angles, force))
    return Judgement(tuple(found), mean_force is not None or up is not None, judges_rates)


def _is_frozen(time, angles, rates, force):
    """Whether nothing that is measured has changed for `FROZEN`; angles alone may stand still."""
    if not (np.isfinite(rates).any() or np.isfinite(force).any()):
        return False
    first = np.searchsorted(time, time[-1] - FROZEN)
    if first == 0:
        return False
    return all(
        np.all((part[first:] == part[first]) | np.isnan(part[first:])) for part in (angles, rates, force)
    ) and bool(np.isfinite(rates[first:]).any() or np.isfinite(force[first:]).any())


def _mean_up(angles):
    """Mean direction of up in the axes of the craft, as the angles say; None where they are not known."""
    roll, pitch = angles[:, 0], angles[:, 1]
    if not (np.isfinite(roll) & np.isfinite(pitch)).any():
        return None
    up = np.nanmean(_up(roll, pitch), axis=0)
    return up / np.linalg.norm(up)


def _up(roll, pitch):
    """The last row of the rotation matrix from body to world, shape (N, 3)."""
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=1)


def _mean_force(force):
    """Mean specific force in units of gravity; None where it is not known, or all zero: not set by the driver."""
    known = np.isfinite(force).all(axis=1)
    if not known.any() or not np.any(force[known]):
        return None
    return force[known].mean(axis=0) / STANDARD_GRAVITY


def _size_of_gravity(mean_force):
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


def _list_of_craft(up, installation):
    """A craft that would float on its side or upside down: a sensor that is turned, and consistently so."""
    if up[2] >= np.cos(LARGEST_LIST):
        return []
    roll, pitch = attitude.tilt_angles(*up)
    mounting = _composed((_nearest_quarter(roll), _nearest_quarter(pitch), 0.0), installation)
    return [Contradiction('sensor-turned', (
        f'the attitude averages roll {np.degrees(roll):.0f} deg and pitch {np.degrees(pitch):.0f} deg, at which no '
        f'craft floats: the sensor is mounted so; set mounting_deg to {_in_degrees(mounting)} (add its yaw, if it has '
        f'one)'
    ))]  # fmt: skip


def _direction_of_gravity(direction, up, has_angles, comparison, installation):
    """The turn of the vectors against the attitude (None: none, or only the frame), and what contradicts itself."""
    if up is None or not has_angles:
        return _direction_alone(direction, installation)
    cosine = float(direction @ up)
    if cosine >= LEAST_DISAGREEMENT:
        return None, _list_of_craft(up, installation)
    opposite = -cosine >= AGREEMENT
    best, best_score = None, -np.inf
    for turn in TURNS:
        if float(direction @ (turn.T @ up)) >= AGREEMENT:
            score = _agreement(comparison, turn.T)
            if score > best_score + 1e-6:
                best, best_score = turn, score
    # the frame explains gravity that is opposite; a turn needs rates that say so, or no such explanation
    if opposite and (best is None or _agreement(comparison, np.eye(3)) >= best_score - 1e-6):
        return None, [_other_frame(direction, up, installation)]
    if best is None:
        off = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        return TURNS[0], [Contradiction('axes-of-sensor', (
            f'gravity is {off:.0f} deg away from where the attitude puts it, which no right-angled mounting explains: '
            f'let the driver give orientation and accelerations in the same axes, and mounting_deg say how these sit'
        ))]  # fmt: skip
    return best, [_turned(best, direction)]


def _direction_alone(direction, installation):
    """Without an orientation gravity alone says how the sensor sits, but for its yaw."""
    if direction[2] >= np.cos(LARGEST_LIST):
        return None, []
    turn = max(TURNS, key=lambda turn: turn[2] @ direction)
    if turn[2] @ direction < np.cos(LARGEST_LIST):
        return None, []
    mounting = _composed(_angles_of(turn), installation)
    frame = _opposite_frame(installation) if direction[2] <= -np.cos(LARGEST_LIST) else None
    cure = f'set mounting_deg to {_in_degrees(mounting)} (add its yaw, if it has one)'
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


def _turned(turn, direction):
    mounting = _in_degrees(_angles_of(turn))
    cure = _cure_of_turn(mounting)
    if mounting == [180, 0, 0]:
        cure = (
            f'forward-right-down vectors beside a forward-left-up orientation, or a sensor upside down whose '
            f'orientation alone was corrected; {cure}'
        )
    return Contradiction('axes-of-sensor', (
        f'{_reading_of(direction)} while the attitude says that the craft floats upright: rates and accelerations are '
        f'turned by {mounting} deg (roll, pitch, yaw) against the orientation: {cure}'
    ))  # fmt: skip


def _cure_of_turn(mounting):
    return (
        f'let the driver give all of them in the axes of the sensor, and set mounting_deg to {mounting}, or all in those '
        f'of the craft, with mounting_deg [0, 0, 0]'
    )


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


def _agreement(comparison, arrangement):
    """Mean correlation of the rates with the derivatives of the angles in this arrangement; 0 where none moves."""
    if comparison is None:
        return 0.0
    correlations = []
    for j in np.flatnonzero(_evidenced(comparison)):
        i = int(np.argmax(np.abs(arrangement[:, j])))
        if comparison.has_rate[i]:
            correlations.append(arrangement[i, j] * comparison.at_once[i, j])
    return float(np.mean(correlations)) if correlations else 0.0


def _evidenced(comparison):
    """Roll and pitch, where they move and some rate is there; compasses are too slow and too rough to tell."""
    return comparison.moves & comparison.has_rate.any() & np.array([True, True, False])


def _compared(time, angles, rates):
    """Rates and angles compared on an even time base; None where there is too little of either."""
    known = np.isfinite(rates).any(axis=0)
    usable = np.isfinite(angles[:, :2]).any(axis=0)
    if not known.any() or not usable.any():
        return None
    whole = np.ones(time.size, dtype=bool)
    for part in (angles, rates):
        for column in part.T:
            if np.isfinite(column).any():
                whole &= np.isfinite(column)
    # what is left out is bridged, unless it is much
    if np.count_nonzero(whole) < max(LEAST_BINS, 0.5 * time.size):
        return None
    step = float(np.median(np.diff(time)))
    kept = time[whole]
    if np.max(np.diff(kept)) > max(1.0, 4.0 * step):
        return None
    even = np.arange(kept[0], kept[-1], step)
    if even.size < LEAST_BINS:
        return None

    def evened(part):
        columns = [
            np.interp(even, kept, column[whole]) if np.isfinite(column).any() else np.full(even.size, np.nan)
            for column in part.T
        ]
        return np.stack(columns, axis=1)

    smooth = np.stack([np.unwrap(column) if np.isfinite(column).any() else column for column in angles[whole].T], axis=1)
    unwrapped = np.full(angles.shape, np.nan)
    unwrapped[whole] = smooth
    return compare_rates(step, evened(unwrapped), evened(rates))


def _accelerations_turned(angles, force):
    """Sign with which the horizontal accelerations follow the tilt: +1, -1, or 0 where they do not tell."""
    roll, pitch = angles[:, 0], angles[:, 1]
    known = np.isfinite(roll) & np.isfinite(pitch) & np.isfinite(force).all(axis=1)
    if np.count_nonzero(known) < LEAST_BINS:
        return 0
    up, horizontal = _up(roll[known], pitch[known])[:, :2], force[known, :2]
    scale = np.sqrt(np.sum(up**2) * np.sum(horizontal**2))
    common = float(np.sum(up * horizontal) / scale) if scale > 0.0 else 0.0
    return int(np.sign(common)) if abs(common) > 0.5 else 0


def _rates(comparison, interval, accelerations):
    """What contradicts itself between rates and angles."""
    evidenced = np.flatnonzero(_evidenced(comparison))
    if not evidenced.size:
        return _offsets(comparison)
    own = [comparison.has_rate[j] and max(comparison.at_once[j, j], comparison.lagged[j]) >= FOLLOWS for j in evidenced]
    if all(own):
        scaled = _scales(comparison, evidenced)
        return [*(scaled or _offsets(comparison)), *_delays(comparison, evidenced, interval)]
    return _rearranged(comparison, evidenced, accelerations) or _unrelated(comparison, evidenced)


ARRANGEMENTS = {
    'reversed': -np.eye(3),
    'turned': TURNS[[np.allclose(turn, np.diag([-1.0, -1.0, 1.0])) for turn in TURNS].index(True)],
    'roll reversed': np.diag([-1.0, 1.0, 1.0]),
    'pitch reversed': np.diag([1.0, -1.0, 1.0]),
    'left': np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'right': np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    'swapped': np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
"""Which derivative each rate holds, where gravity is as the attitude says."""


def _rearranged(comparison, evidenced, accelerations):
    """Rates on other axes, or with another sign, than their angles."""
    scores = {name: _agreement(comparison, arrangement) for name, arrangement in ARRANGEMENTS.items()}
    name = max(scores, key=scores.get)
    if scores[name] < EXPLAINS:
        return []
    single = [AXIS_NAMES[j] for j in evidenced] if evidenced.size == 1 else None
    if name in ('reversed', 'turned') and single is None:
        return [_both_reversed(comparison, accelerations)]
    if name in ('reversed', 'turned', 'roll reversed', 'pitch reversed'):
        axis = single[0] if single else name.split()[0]
        return [Contradiction('rate-sign', (
            f'the {axis} rate is the derivative of the {axis} angle with the opposite sign: reverse one of the two '
            f'(REP 103: roll positive to starboard, pitch bow down, both rates the same way)'
        ), axis)]  # fmt: skip
    if name == 'swapped':
        return [Contradiction('rates-swapped', (
            'the roll rate follows the pitch angle and the pitch rate the roll angle: exchange the x and y gyroscopes'
        ))]  # fmt: skip
    turn = [0, 0, 90] if name == 'left' else [0, 0, -90]
    return [Contradiction('rates-turned', (
        f'the rates are turned by {turn} deg (roll, pitch, yaw) against the orientation, as is what the gyroscopes sit '
        f'on: {_cure_of_turn(turn)}'
    ))]  # fmt: skip


def _both_reversed(comparison, accelerations):
    turned = 'rates and accelerations are turned by [0, 0, 180] deg (roll, pitch, yaw) against the orientation'
    reversed_signs = 'the signs of the rates are reversed: reverse them in the driver or the file'
    seen = 'roll and pitch rate are the derivatives of their angles with the opposite sign'
    if accelerations < 0:
        return Contradiction('rates-turned', f'{seen}: {turned}: {_cure_of_turn([0, 0, 180])}')
    if accelerations > 0:
        return Contradiction('rate-sign', f'{seen}: {reversed_signs}')
    return Contradiction('rate-sign', (
        f'{seen}: {reversed_signs}, or {turned}: then {_cure_of_turn([0, 0, 180])}'
    ))  # fmt: skip


def _scales(comparison, evidenced):
    """Rates in another unit than the derivatives of the angles."""
    gains = {AXIS_NAMES[j]: comparison.lagged_gain[j] for j in evidenced if comparison.lagged[j] >= EXPLAINS}
    wrong = {axis: gain for axis, gain in gains.items() if not _is_near(gain, 1.0)}
    found = []
    for axis, gain in wrong.items():
        unit = next((unit for factor, unit in UNITS.items() if _is_near(gain, factor)), None)
        alone = axis if len(wrong) < len(gains) or len(gains) == 1 else None
        if unit:
            found.append(Contradiction('rate-unit', (
                f'the {axis} rate is {gain:.3g} times the derivative of the angle: it is in {unit}; give both in the '
                f'same unit, and say which in the name of the column'
            ), alone))  # fmt: skip
        elif _is_near(gain * 57.29578, 1.0):
            found.append(Contradiction('rate-unit', (
                f'the {axis} rate is {gain:.3g} times the derivative of the angle: the angle is in degrees where rad is '
                f'expected; give both in the same unit, and say which in the name of the column'
            ), alone))  # fmt: skip
        else:
            found.append(Contradiction('rate-scale', (
                f'the {axis} rate is {gain:.3g} times the derivative of the angle: look at the units of angle, rate and '
                f'time, and at the scale of the gyroscope'
            ), alone))  # fmt: skip
    return found


def _is_near(gain, factor):
    return factor / UNIT_TOLERANCE < gain < factor * UNIT_TOLERANCE


def _delays(comparison, evidenced, interval):
    """Rates later, or earlier, than their angles."""
    found = []
    for j in evidenced:
        lag = float(comparison.lag[j])
        limit = max(LAG_INTERVALS * interval, LEAST_LAG, LAG_STDS * comparison.lag_std[j])
        if comparison.lagged[j] < EXPLAINS or abs(lag) <= limit:
            continue
        axis = AXIS_NAMES[j]
        late, early = (f'{axis} rate', f'{axis} angle') if lag > 0.0 else (f'{axis} angle', f'{axis} rate')
        found.append(Contradiction('rate-late' if lag > 0.0 else 'angle-late', (
            f'the {late} comes {abs(lag):.2f} s after the {early}: let the driver stamp both when they are measured, or '
            f'shift the column back by as much; a filter that slow needs a faster setting'
        ), axis))  # fmt: skip
    return found


def _offsets(comparison):
    """Rates that are off by a constant."""
    return [
        Contradiction('rate-offset', (
            f'the {axis} rate is {np.degrees(offset):+.1f} deg/s off the change of the angle: calibrate the gyroscope at '
            f'rest, or take the offset away'
        ), axis)
        for axis, offset in zip(AXIS_NAMES[:2], comparison.offset[:2], strict=True) if abs(offset) > LARGEST_OFFSET
    ]  # fmt: skip


def _unrelated(comparison, evidenced):
    """Rates that have nothing to do with the angle while it moves."""
    return [
        Contradiction('rate-unrelated', (
            f'the {AXIS_NAMES[j]} angle moves and its rate does not follow it at any delay: look at what this column '
            f'holds, or leave it out'
        ), AXIS_NAMES[j])
        for j in evidenced
        if comparison.has_rate[j] and comparison.lagged[j] < UNRELATED
        and np.nanmax(np.abs(comparison.at_once[j])) < UNRELATED
    ]  # fmt: skip


def _nearest_quarter(angle):
    """The nearest multiple of 90 deg where it is within 10 deg, else the angle to a degree, rad."""
    degrees = float(np.degrees(angle))
    quarter = 90.0 * round(degrees / 90.0)
    return float(np.radians(quarter if abs(degrees - quarter) <= 10.0 else round(degrees)))


def _angles_of(turn):
    """Roll, pitch and yaw of a rotation that brings axes onto axes."""
    pitch = float(np.arcsin(np.clip(-turn[2, 0], -1.0, 1.0)))
    if abs(turn[2, 0]) > 0.5:
        return 0.0, pitch, float(np.arctan2(-turn[0, 1], turn[1, 1]))
    return float(np.arctan2(turn[2, 1], turn[2, 2])), pitch, float(np.arctan2(turn[1, 0], turn[0, 0]))


def _composed(further, installation):
    """The mounting of a sensor that sits turned by a further rotation beside what its mounting says."""
    turned = attitude.multiply(attitude.quaternion(*further), installation.rotation)
    return tuple(float(angle) for angle in attitude.euler_angles(*turned))


def _in_degrees(mounting):
    return [round(float(np.degrees(angle))) + 0 for angle in mounting]


def contradictions_in(time, channels, installation):
    """What contradicts itself in a whole record.

    The record is judged in stretches; what most of those that can tell find is found.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s, increasing.
    channels : dict of str to ndarray, shape (N,)
        Any of ``roll``, ``pitch``, ``yaw``, ``roll_rate``, ``pitch_rate``, ``yaw_rate``, ``accel_x``, ``accel_y``,
        ``accel_z``, as the installation makes them.
    installation : Installation

    Returns
    -------
    tuple of Contradiction
    """
    parts = [
        np.stack([np.asarray(channels.get(name, np.full(time.size, np.nan)), dtype=float) for name in names], axis=1)
        for names in PARTS
    ]
    interval = float(np.median(np.diff(time)))
    time, *parts = _binned(time, parts, interval)
    size = max(WINDOW_BINS, round(WINDOW / max(float(np.median(np.diff(time))), 1e-9))) if time.size > 1 else WINDOW_BINS
    starts = range(0, max(time.size - size // 2, 1), size // 2)
    judgements = []
    for start in starts[:: max(len(starts) // MOST_STRETCHES, 1)]:
        stretch = slice(start, start + size)
        judgements.append(
            judge(time[stretch], *(part[stretch] for part in parts), installation=installation, interval=interval)
        )
    found = {}
    for judgement in judgements:
        for contradiction in judgement.contradictions:
            found.setdefault((contradiction.code, contradiction.axis), []).append(contradiction)
    return tuple(
        each[len(each) // 2] for each in found.values()
        if len(each) > 0.5 * sum(judgement.decides(each[0]) for judgement in judgements)
    )  # fmt: skip


PARTS = (
    ('roll', 'pitch', 'yaw'), ('roll_rate', 'pitch_rate', 'yaw_rate'), ('accel_x', 'accel_y', 'accel_z')
)  # fmt: skip
MOST_STRETCHES = 60
"""Of a long record; they are spread over it."""


def _binned(time, parts, interval):
    """Samples averaged by so many that a bin is `BIN` long; a value that is missing leaves its bin unknown."""
    count = max(int(BIN / interval + 0.5), 1) if interval > 0.0 else 1
    if count == 1 or time.size < 2 * count:
        return time, *parts
    whole = time.size // count * count
    angles, *others = (part[:whole].reshape(-1, count, 3) for part in parts)
    # a mean of angles across the jump at pi would be none
    first = angles[:, :1]
    angles = first + (angles - first + np.pi) % (2.0 * np.pi) - np.pi
    return (
        time[:whole].reshape(-1, count).mean(axis=1), angles.mean(axis=1), *(other.mean(axis=1) for other in others)
    )


class InstallationCheck:
    """The judgement of a running sensor: what it has been found to contradict, until it no longer does.

    Parameters
    ----------
    installation : Installation
        What frame and mounting are taken to be.
    """

    def __init__(self, installation):
        self._installation = installation
        self._fresh = deque(maxlen=MOST_SAMPLES)
        self._bins = None
        self._votes = {}
        self._judged_ns = None
        self.contradictions = ()

    def add(self, sample):
        """Take in one sample.

        Parameters
        ----------
        sample : CraftSample
        """
        self._fresh.append(sample)

    def judge(self):
        """Judge anew where enough has come in since the last time.

        Returns
        -------
        tuple of Contradiction
            What stands.
        """
        if len(self._fresh) < LEAST_FRESH:
            return self.contradictions
        first_ns, newest_ns = self._fresh[0][0], self._fresh[-1][0]
        if self._judged_ns is None:
            self._judged_ns = first_ns
        # a clock that was set back also is a reason to begin anew
        if 0 <= newest_ns - self._judged_ns < INTERVAL * 1e9:
            return self.contradictions
        self._judged_ns = newest_ns
        time, parts, interval = self._window()
        judgement = judge(
            time, *parts, installation=self._installation, interval=interval, least_duration=LEAST_DURATION
        )
        self._weigh(judgement)
        return self.contradictions

    def _window(self):
        """Time and parts of the last `WINDOW`, in bins, with what is fresh."""
        table = np.array([sample[1:8] + sample[12:] for sample in self._fresh])
        stamps = np.array([sample[0] for sample in self._fresh], dtype=np.int64)
        self._fresh.clear()
        unbroken = np.flatnonzero((np.diff(stamps) <= 0) | (np.diff(stamps) > GAP_NS))
        if unbroken.size:
            stamps, table, self._bins = stamps[unbroken[-1] + 1:], table[unbroken[-1] + 1:], None
        if stamps.size < 2:
            return np.empty(0), tuple(np.empty((3, 0, 3))), 1.0
        if self._bins is not None and not 0 < stamps[0] - self._bins[0] < GAP_NS:
            self._bins = None
        roll, pitch, roll_rate, pitch_rate, accel_x, accel_y, accel_z, yaw, yaw_rate = table.T
        parts = [
            np.stack(part, axis=1) for part in (
                (roll, pitch, yaw), (roll_rate, pitch_rate, yaw_rate), (accel_x, accel_y, accel_z)
            )
        ]  # fmt: skip
        interval = float(np.median(np.diff(stamps))) * 1e-9
        origin = stamps[0] if self._bins is None else self._bins[1]
        time, *parts = _binned((stamps - origin) * 1e-9, parts, interval)
        if self._bins is not None:
            time = np.concatenate([self._bins[2], time])
            parts = [np.concatenate(both) for both in zip(self._bins[3], parts, strict=True)]
        kept = slice(max(time.size - max(WINDOW_BINS, np.count_nonzero(time > time[-1] - WINDOW)), 0), None)
        time, parts = time[kept], [part[kept] for part in parts]
        self._bins = stamps[-1], origin, time, parts
        return time, parts, interval

    def _weigh(self, judgement):
        """Contradictions stand, and fall, when so many judgements in a row agree."""
        found = {(each.code, each.axis): each for each in judgement.contradictions}
        for key, each in found.items():
            votes = self._votes.get(key, (0, None))[0]
            self._votes[key] = min(votes + 1, CONFIRMATIONS), each
        for key, (votes, each) in list(self._votes.items()):
            if key not in found and judgement.decides(each):
                self._votes[key] = votes - 1, each
                if votes <= 1:
                    del self._votes[key]
        held = {(each.code, each.axis) for each in self.contradictions}
        self.contradictions = tuple(
            each for key, (votes, each) in self._votes.items() if votes >= CONFIRMATIONS or key in held
        )


MOST_SAMPLES = 60_000
"""Kept between judgements: a minute at 1 kHz."""

LEAST_FRESH = 2
GAP_NS = 3_000_000_000
"""ns; a longer silence begins a window anew."""
