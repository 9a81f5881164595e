"""Whether the angles, rates and accelerations of a sensor agree: two comparisons, and a table of faults.

Rates are compared with the slopes of their angles, and gravity with the attitude. A fault is reported only where the
data decide it. A pure yaw misalignment cannot be detected: all channels rotate together.
"""

import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion import attitude as sensor_mount
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Installation
from swath_sysid.attitude.motion.rate_comparison import (
    EXPLAINS,
    FOLLOWS,
    MIN_BINS,
    UNIT_TOLERANCE,
    Slope,
    agreement,
    compare_rates,
    is_near,
)
from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.common.advice import SENTENCES, Advice
from swath_sysid.common.conventions import SIGNIFICANT
from swath_sysid.common.errors import InputError

WINDOW = 30.0  #: s over which the accelerations of waves average out.
#: Bins of a window of a sensor so slow that `WINDOW` holds fewer; samples of a fast one are averaged to twice as many.
WINDOW_BINS = 300
MAX_STRETCHES = 20  #: Of a long record, over which they are spread; up to twice as many are judged.

FROZEN = 5.0  #: s of fresh stamps with the same values.
IDENTITY = (0.0, 0.0, 0.0, 1.0)  #: Quaternion of no rotation.
MIN_TURN = np.radians(3.0)  #: rad that the rates turn while the angles stand still; no angle is as coarse.
GRAVITY_TOLERANCE = 0.2  #: Of gravity; consumer accelerometers are within a few percent.
MIN_UPRIGHT = np.cos(np.radians(45.0))  #: Cosine of the largest mean list at which a craft floats.
LEVEL = np.cos(np.radians(5.0))  #: Cosine of the mean list from which a sensor may be mounted at an angle.
TILT_PARTS = 3  #: Of a stretch, each of which shows a tilt that is the sensor's; a craft that is held is let go.
#: Cosine between gravity and attitude below which they contradict each other; alignment errors are a few degrees.
CONTRADICTED = np.cos(np.radians(30.0))

MAX_OFFSET = np.radians(2.0)  #: rad/s; uncalibrated gyroscopes at rest stay within 1 deg/s by their data sheets.
LAG_INTERVALS = 2.5  #: Sample intervals up to which a delay is not reported.

#: What is wrong where the rate is this many times the slope of the angle.
UNITS = {
    float(np.degrees(1.0)): 'the rate is in deg/s where rad/s is expected',
    float(np.radians(1.0)): 'the angle is in degrees where rad is expected',
}

#: Slopes (columns: angles) that roll and pitch rates (rows) hold; the first needs one moving axis, the others two.
ARRANGEMENTS = {
    'reversed': ((-1, 0), (0, -1)),
    'roll reversed': ((-1, 0), (0, 1)),
    'pitch reversed': ((1, 0), (0, -1)),
    'to port': ((0, 1), (-1, 0)),
    'to starboard': ((0, -1), (1, 0)),
    'exchanged': ((0, 1), (1, 0)),
    'exchanged and reversed': ((0, -1), (-1, 0)),
}

FRAMES_ALIKE = {'flu': 'forward-left-up', 'frd': 'forward-right-down'}
OPPOSITE_FRAME = {'flu': 'frd', 'frd': 'flu'}

PARTS = ('roll', 'pitch', 'yaw'), ('roll_rate', 'pitch_rate', 'yaw_rate'), ('accel_x', 'accel_y', 'accel_z')

#: All faults, by what must be compared to find them.
REPEAT_CODES = frozenset({'sensor-frozen', 'angles-frozen'})
TILT_CODES = frozenset({'sensor-tilted'})
GRAVITY_CODES = TILT_CODES | {'accelerations-in-g', 'gravity-missing', 'sensor-turned', 'axes-of-sensor'}
ARRANGED_CODES = frozenset({'rates-swapped', 'rates-turned', 'rate-sign', 'rate-unit', 'rate-scale'})
LAG_CODES = frozenset({'rate-late', 'angle-late'})
RATE_CODES = ARRANGED_CODES | LAG_CODES | {'rate-unrelated'}
OFFSET_CODES = frozenset({'rate-offset'})

#: Those that leave the rest of the data usable.
DOUBTFUL_CODES = TILT_CODES | {'angles-frozen', 'gravity-missing', 'sensor-frozen'}


@dataclass(frozen=True)
class Contradiction(Advice):
    """A record or sensor that contradicts itself, and its cure; the axis where only one is concerned."""

    axis: str | None = None

    @property
    def is_plain(self) -> bool:
        """Whether nothing should be identified or forecast from such data."""
        return self.code not in DOUBTFUL_CODES


@dataclass(frozen=True)
class SensorFindings:
    """The contradictions in a stretch of data, and the codes that it could decide."""

    contradictions: tuple[Contradiction, ...] = ()
    decided: frozenset[str] = frozenset()


def refuse_contradictions(trial: Trial, axis: str | None = None, lags: bool = True) -> None:
    """Reject a record whose channels plainly contradict each other (of one axis, if given), and if by ``lags`` only."""
    for advice in trial.advice:
        if not lags and advice.code in LAG_CODES:
            continue
        if isinstance(advice, Contradiction) and advice.is_plain and (axis is None or advice.axis in (None, axis)):
            raise InputError(f'{trial.source}: {advice.message}' if trial.source else advice.message)


def contradictions_in(
    time: np.ndarray, channels: dict[str, np.ndarray], installation: Installation
) -> tuple[Contradiction, ...]:
    """Faults of the sensor in a whole record: channels (N,) by name, as the installation makes them. A contradiction
    must show in most stretches that can show it; a frozen sensor, in any; a tilted one, in all.
    """
    if time.size < MIN_BINS:
        return ()
    # a damaged interval may be so small that the window would hold infinitely many samples
    interval = max(float(np.median(np.diff(time))), 1e-9)
    size = max(WINDOW_BINS * samples_a_bin(interval), round(WINDOW / interval))
    starts = range(0, max(time.size - size // 2, 1), size // 2)
    judgements = []
    for start in starts[:: max(len(starts) // MAX_STRETCHES, 1)]:
        rows = slice(start, start + size)
        unknown = np.full(time[rows].size, np.nan)
        parts = [np.stack([channels[n][rows] if n in channels else unknown for n in names], axis=1) for names in PARTS]
        judgements.append(judge(*binned(time[rows], parts, interval), installation=installation, interval=interval))
    found: dict[tuple[str, str | None], list[Contradiction]] = {}
    for judgement in judgements:
        for contradiction in judgement.contradictions:
            found.setdefault((contradiction.code, contradiction.axis), []).append(contradiction)
    return tuple(
        each[len(each) // 2]
        for (code, _), each in found.items()
        if code in REPEAT_CODES
        or len(each) > (len(judgements) - 1 if code in TILT_CODES else 0.5 * sum(code in j.decided for j in judgements))
    )


def judge(
    time: np.ndarray,
    angles: np.ndarray,
    rates: np.ndarray,
    force: np.ndarray,
    *,
    installation: Installation,
    interval: float,
) -> SensorFindings:
    """Judge one stretch of data: roll, pitch and yaw, rad, their rates, rad/s, and specific force, m/s^2, each (N, 3).
    All are in the axes of the craft as the installation makes them, NaN where unknown; the interval is the sensor's, s.
    """
    repeated = None if time.size < MIN_BINS else _repeats(time, angles, rates, force)
    if repeated is None:
        return SensorFindings()
    if repeated:
        return SensorFindings(tuple(repeated), REPEAT_CODES)
    up, mean_force = mean_up(angles), mean_force_of(force)
    evened = _evened(time, angles[:, :2], rates)
    slopes = () if evened is None else compare_rates(*evened)
    decided = REPEAT_CODES if mean_force is None and up is None else REPEAT_CODES | GRAVITY_CODES
    is_turned, found = _gravity_against_attitude(mean_force, up, slopes, installation)
    if evened is not None and not is_turned:
        decided |= OFFSET_CODES | (RATE_CODES if slopes else frozenset())
        found += _rates_against_angles(slopes, interval, accelerations_follow(angles, force), installation)
        if not any(each.code in ARRANGED_CODES for each in found):
            found += _offsets(*evened)
    if not any(each.code in GRAVITY_CODES for each in found):
        found += _tilt(angles, force, installation)
    return SensorFindings(tuple(found), decided)


def samples_a_bin(interval: float) -> int:
    """This many samples of an interval (s) are averaged to a bin."""
    return max(int(WINDOW / (2 * WINDOW_BINS) / interval + 0.5), 1)


def binned(time: np.ndarray, parts: Sequence[np.ndarray], interval: float) -> tuple[np.ndarray, ...]:
    """Time (N,) and angles, rates and specific force (N, 3) averaged over bins, NaN if one is missing."""
    count = samples_a_bin(interval)
    if count == 1 or time.size < 2 * count:
        return time, *parts
    whole = time.size // count * count
    angles, *others = (part[:whole].reshape(-1, count, 3) for part in parts)
    # a mean of angles across the jump at pi would be none
    first = angles[:, :1]
    angles = first + (angles - first + np.pi) % (2.0 * np.pi) - np.pi
    return tuple(part.mean(axis=1) for part in (time[:whole].reshape(-1, count), angles, *others))


def _found(key: str, axis: str | None = None, **values: Any) -> list[Contradiction]:
    """A fault of the catalogue with its values; nothing where one of them is not finite."""
    if not all(isfinite(value) for value in values.values() if isinstance(value, float)):
        return []
    return [Contradiction(key.partition(':')[0], SENTENCES[key].format(axis=axis, **values), axis)]


def _repeats(time: np.ndarray, angles: np.ndarray, rates: np.ndarray, force: np.ndarray) -> list[Contradiction] | None:
    """What has frozen; None where nothing changes, so that nothing can be judged."""
    values = np.hstack([angles, rates, force])
    steps = np.abs(np.diff(values, axis=0))
    if not np.any(steps > 0.0):
        return None
    since = 1 + int(np.flatnonzero(np.any(steps > 0.0, axis=1))[-1])
    if time[-1] - time[since] >= FROZEN and time.size - since >= MIN_BINS // 2:
        return _found('sensor-frozen', seconds=FROZEN) if _resolves_motion(steps[:since, 3:]) else []
    still = min(int(np.searchsorted(time, time[-1] - FROZEN)), time.size - MIN_BINS // 2)
    if still <= 0:
        return []
    angles_still = np.isfinite(angles[still:, :2]).all() and not np.any(steps[still:, :3] > 0.0)
    step, rates = float(np.median(np.diff(time))), rates[still:, :2]
    turned = np.ptp(np.cumsum(rates - rates.mean(axis=0), axis=0), axis=0) * step
    walk = np.sqrt(0.5 * np.mean(np.diff(rates, axis=0) ** 2, axis=0) * len(rates)) * step
    is_turning = np.any(turned > np.maximum(MIN_TURN, SIGNIFICANT * walk))
    return _found('angles-frozen', seconds=FROZEN) if angles_still and is_turning else []


def _resolves_motion(steps: np.ndarray) -> bool:
    """Whether changes (N, 6) of rates and accelerations exceed one step of the sensor, as those of a coarse one at rest
    do not. Angles that come alone may stand still.
    """
    resolution = np.min(steps, axis=0, where=steps > 0.0, initial=np.inf)
    return bool(np.any(np.median(steps[-(MIN_BINS // 2) :], axis=0) > 1.5 * resolution))


class RepeatedMessages:
    """Notices a sensor that repeats its last message with fresh stamps."""

    def __init__(self) -> None:
        self._stamp_ns, self._bytes, self._run, self._is_frozen = 0, b'', 0, False
        self._past: deque[tuple[Sequence[float], int]] = deque(maxlen=WINDOW_BINS)  # values, and their repeats

    def add(self, stamp_ns: int, angles: Sequence[float], others: Sequence[float]) -> bool:
        """Add angles, rates and accelerations (6,) of a message; whether it repeats more often than others did."""
        if stamp_ns == self._stamp_ns:
            return self._is_frozen
        self._stamp_ns = stamp_ns
        # bitwise, also where not a number
        packed = struct.pack(f'{len(angles) + 6}d', *angles, *others)
        if packed != self._bytes:
            self._bytes, self._is_frozen = packed, False
            self._past.append((others, self._run))
            self._run = 0
            return False
        self._run += 1
        if self._run == 1 + max(run for _, run in self._past):
            steps = np.abs(np.diff([values for values, _ in self._past], axis=0))
            self._is_frozen = len(steps) > 0 and _resolves_motion(steps)
        return self._is_frozen


class BlankOrientation:
    """Notices quaternions that were never filled in: the identity in every message while the gyroscope turns."""

    def __init__(self) -> None:
        self._turned, self._is_blank = np.zeros(3), False

    def add(self, orientation: Sequence[float], rates: Sequence[float], interval: float) -> bool:
        """Add the quaternion x, y, z, w of a message and its rates, rad/s, an interval, s, after the one before."""
        if tuple(orientation) != IDENTITY:
            self._turned[:], self._is_blank = 0.0, False
        elif not self._is_blank:
            turn = interval * np.asarray(rates)
            self._turned += np.where(np.isfinite(turn), turn, 0.0)
            # the craft comes back
            self._is_blank = bool(np.any(np.abs(self._turned) > MIN_TURN))
        return self._is_blank


def is_blank(time: np.ndarray, orientation: np.ndarray, rates: np.ndarray) -> bool:
    """The same of a whole record: time (N,), s, quaternions (N, 4) and rates (N, 3)."""
    turned = np.nancumsum(rates[1:] * np.diff(time)[:, None], axis=0)
    return bool(np.all(orientation == IDENTITY) and np.any(np.abs(turned) > MIN_TURN))


def mean_up(angles: np.ndarray) -> np.ndarray | None:
    """Mean direction of up in the axes of the craft, shape (3,), as the angles (N, 3) have it; None: unknown."""
    known = np.isfinite(angles[:, :2]).all(axis=1)
    if not known.any():
        return None
    up = np.mean(attitude.up_in_body(angles[known, 0], angles[known, 1]), axis=1)
    length = float(np.linalg.norm(up))
    return up / length if length > MIN_UPRIGHT else None


def mean_force_of(force: np.ndarray) -> np.ndarray | None:
    """Mean of a specific force (N, 3) in units of gravity; None where unknown, or all zero: not set by the driver."""
    known = np.isfinite(force).all(axis=1)
    if not known.any() or not np.any(force[known]):
        return None
    mean = force[known].mean(axis=0) / STANDARD_GRAVITY
    size, usual = np.linalg.norm(mean), np.linalg.norm(force[known], axis=1).mean() / STANDARD_GRAVITY
    # heavy rolling shortens the mean
    return mean * usual / size if size > GRAVITY_TOLERANCE and abs(usual - 1.0) <= GRAVITY_TOLERANCE else mean


def _gravity_against_attitude(
    mean_force: np.ndarray | None, up: np.ndarray | None, slopes: Sequence[Slope], installation: Installation
) -> tuple[bool, list[Contradiction]]:
    """Whether rates and accelerations are rotated against the attitude, and faults of gravity."""
    found: list[Contradiction] = []
    if mean_force is not None:
        size = float(np.linalg.norm(mean_force))
        in_g = abs(size * STANDARD_GRAVITY - 1.0) <= GRAVITY_TOLERANCE
        if in_g or size <= GRAVITY_TOLERANCE:
            name = 'accelerations-in-g' if in_g else 'gravity-missing'
            found = _found(name, force=size * STANDARD_GRAVITY, gravity=STANDARD_GRAVITY)
        if in_g or size > GRAVITY_TOLERANCE:
            direction = mean_force / size
            if up is None:
                return False, found + _direction_alone(direction, installation)
            if direction @ up < CONTRADICTED:
                is_turned, contradictions = _turned_gravity(direction, up, slopes, installation)
                return is_turned, found + contradictions
    return False, found + _list_of_craft(up, installation)


def _list_of_craft(up: np.ndarray | None, installation: Installation) -> list[Contradiction]:
    """A craft that would float on its side or upside down: a rotated sensor."""
    if up is None or up[2] >= MIN_UPRIGHT:
        return []
    roll, pitch = attitude.tilt_angles(*up)
    mounting = sensor_mount.mounting_after(
        (sensor_mount.nearest_quarter(roll), sensor_mount.nearest_quarter(pitch), 0.0), installation
    )
    degrees = sensor_mount.in_degrees([roll, pitch])
    return _found('sensor-turned', roll=degrees[0], pitch=degrees[1], mounting=mounting)


def _tilt(angles: np.ndarray, force: np.ndarray, installation: Installation) -> list[Contradiction]:
    """A sensor that is never level on average, by its attitude or, without one, by gravity."""
    ups = [mean_up(part) for part in np.array_split(angles, TILT_PARTS)]
    has_attitude = all(up is not None for up in ups)
    if not has_attitude:
        ups = [mean_force_of(part) for part in np.array_split(force, TILT_PARTS)]
    known = [up / np.linalg.norm(up) for up in ups if up is not None and np.any(up)]
    if len(known) < TILT_PARTS or max(up[2] for up in known) >= LEVEL:
        return []
    # a craft is held at the start if at all
    settled = angles[len(angles) // TILT_PARTS :, :2]
    tilt = np.nanmedian(settled, axis=0) if has_attitude else attitude.tilt_angles(*np.mean(known[1:], axis=0))
    roll, pitch = map(float, tilt)
    # a motion of that size hides it
    swing = float(np.nanmax(np.nanstd(settled, axis=0))) if has_attitude else 0.0
    if np.cos(roll) * np.cos(pitch) >= min(LEVEL, np.cos(swing)):
        return []
    mounting = sensor_mount.mounting_after((roll, pitch, 0.0), installation, digits=1)
    return _found('sensor-tilted', roll=np.degrees(roll), pitch=np.degrees(pitch), mounting=mounting)


def _turned_gravity(
    direction: np.ndarray, up: np.ndarray, slopes: Sequence[Slope], installation: Installation
) -> tuple[bool, list[Contradiction]]:
    """The rotation or frame that explains gravity away from where the attitude puts it."""
    as_it_is = agreement(slopes, np.eye(3))
    best, best_score = None, -np.inf
    for turn in sensor_mount.TURNS:
        score = agreement(slopes, turn.T)
        if direction @ (turn.T @ up) >= CONTRADICTED and score > best_score + 1e-6:
            best, best_score = turn, score
    cosine = float(direction @ up)
    reading = _reading_of(direction)
    # the frame explains opposite gravity, unless rates say otherwise
    if -cosine >= CONTRADICTED and (best is None or as_it_is >= best_score - 1e-6):
        return False, _found('axes-of-sensor: other frame', reading=reading, **_frames(installation))
    if best is None:
        off = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        return True, _found('axes-of-sensor: not right-angled', off=off)
    return True, _found('axes-of-sensor', reading=reading, **_turn_values(sensor_mount.angles_of(best), installation))


def _direction_alone(direction: np.ndarray, installation: Installation) -> list[Contradiction]:
    """The mounting by gravity alone, without an orientation, but for its yaw."""
    turn = max(sensor_mount.TURNS, key=lambda turn: float(turn[2] @ direction))
    if direction[2] >= MIN_UPRIGHT or turn[2] @ direction < MIN_UPRIGHT:
        return []
    return _found(
        'axes-of-sensor: hanging' if direction[2] <= -MIN_UPRIGHT else 'axes-of-sensor: on its side',
        reading=_reading_of(direction),
        mounting=sensor_mount.mounting_after(sensor_mount.angles_of(turn), installation),
        **_frames(installation),
    )


def _frames(installation: Installation) -> dict[str, str]:
    other = OPPOSITE_FRAME[installation.frame]
    return {'axes': FRAMES_ALIKE[installation.frame], 'other_axes': FRAMES_ALIKE[other], 'other_frame': other}


def _turn_values(turn: Sequence[float], installation: Installation) -> dict[str, Any]:
    return {'turn': sensor_mount.in_degrees(turn), 'mounting': sensor_mount.mounting_after(turn, installation)}


def _reading_of(direction: np.ndarray) -> str:
    """What gravity reads, in words."""
    axis = int(np.argmax(np.abs(direction)))
    seen = f"gravity reads {STANDARD_GRAVITY * direction[axis]:+.1f} m/s^2 on the craft's {'xyz'[axis]} axis"
    along_z = '' if axis == 2 else f' and {STANDARD_GRAVITY * direction[2]:+.1f} on z,'
    return f'{seen}{along_z} where {STANDARD_GRAVITY:+.1f} is expected'


def accelerations_follow(angles: np.ndarray, force: np.ndarray) -> int:
    """Sign with which horizontal accelerations (of ``force``, (N, 3)) follow the tilt; 0 where they do not show it."""
    known = np.isfinite(angles[:, :2]).all(axis=1) & np.isfinite(force).all(axis=1)
    up = np.stack(attitude.up_in_body(angles[known, 0], angles[known, 1])[:2], axis=1)
    horizontal = force[known, :2]
    scale = np.sqrt(np.sum(up**2) * np.sum(horizontal**2))
    common = float(np.sum(up * horizontal) / scale) if scale > 0.0 else 0.0
    return int(np.sign(common)) if abs(common) > FOLLOWS else 0


def _rates_against_angles(
    slopes: Sequence[Slope], interval: float, accelerations: int, installation: Installation
) -> list[Contradiction]:
    """Contradictions between rates and angles; ``accelerations`` is the sign with which they follow the tilt, or 0."""
    if slopes and not all(slope.follows for slope in slopes):
        delayed = float(np.mean([slope.lagged for slope in slopes]))
        rearranged = _rearranged(slopes, accelerations, installation, max(EXPLAINS, delayed))
        if rearranged:
            return rearranged
    return [found for slope in slopes for found in _faults_of(slope, interval)]


def _rearranged(
    slopes: Sequence[Slope], accelerations: int, installation: Installation, least: float
) -> list[Contradiction]:
    """Rates on other axes, or with another sign, than their angles."""
    possible = ARRANGEMENTS if len(slopes) == 2 else {'reversed': ARRANGEMENTS['reversed']}
    scores = {name: agreement(slopes, np.array(arrangement)) for name, arrangement in possible.items()}
    name = max(scores, key=lambda name: scores[name])
    if scores[name] < least:
        return []
    if 'exchanged' in name:
        # what stands exchanged in FRD axes is exchanged and reversed in those of the craft
        as_named = (name == 'exchanged') == (installation.frame == 'flu')
        return _found('rates-swapped' if as_named else 'rates-swapped: reversed')
    if name in ('to port', 'to starboard'):
        turn = (0.0, 0.0, 0.5 * np.pi if name == 'to port' else -0.5 * np.pi)
        return _found('rates-turned: quarter', **_turn_values(turn, installation))
    if name == 'reversed' and len(slopes) == 2:
        both = {-1: 'rates-turned: half', 0: 'rate-sign: perhaps turned', 1: 'rate-sign'}[accelerations]
        return _found(both, **_turn_values((0.0, 0.0, np.pi), installation))
    return _found('rate-sign: one', AXES[slopes[0].axis] if name == 'reversed' else name.split()[0])


def _faults_of(slope: Slope, interval: float) -> list[Contradiction]:
    """A rate in another unit than the slope of its angle, later or earlier, or unrelated to it."""
    axis = AXES[slope.axis]
    if slope.lagged >= EXPLAINS:
        found = []
        if slope.differs:
            unit = next((unit for factor, unit in UNITS.items() if is_near(slope.gain, factor)), None)
            found = _found('rate-unit' if unit else 'rate-scale', axis, gain=slope.gain, unit=unit)
        if slope.is_late and abs(slope.lag) > LAG_INTERVALS * interval:
            found += _found('rate-late' if slope.lag > 0.0 else 'angle-late', axis, lag=abs(slope.lag))
        return found
    # noise makes the rate larger, and the slope: together they allow a gain up to this
    largest_gain = slope.gain / max(slope.lagged**2, 1e-6)
    is_poor = slope.lagged < 1.0 - FOLLOWS or largest_gain < 1.0 / UNIT_TOLERANCE
    is_small = slope.gain < (1.0 - FOLLOWS) ** 2 and slope.differs
    return _found('rate-unrelated', axis) if is_poor and is_small else []


def _offsets(step: float, angles: np.ndarray, rates: np.ndarray) -> list[Contradiction]:
    """Rates that are off by a constant; arguments as for `compare_rates`."""
    apart = 0.5 * (rates[1:] + rates[:-1])[:, :2] - np.diff(angles, axis=0) / step
    mean, std = apart.mean(axis=0), apart.std(axis=0) / np.sqrt(len(apart))
    found: list[Contradiction] = []
    for axis, offset, deviation in zip(AXES, mean.tolist(), std.tolist(), strict=True):
        if abs(offset) > max(MAX_OFFSET, SIGNIFICANT * deviation):
            found += _found('rate-offset', axis, offset=float(np.degrees(offset)))
    return found


def _evened(time: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> tuple[float, np.ndarray, np.ndarray] | None:
    """Step, angles and rates on an even time base; None where there is too little of either."""
    values = np.hstack([angles, rates])
    measured = np.isfinite(values).any(axis=0)
    if not measured[:2].any() or not measured[2:].any():
        return None
    whole = np.isfinite(values[:, measured]).all(axis=1)
    step, kept = float(np.median(np.diff(time))), time[whole]
    # what is left out is bridged, unless it is much; before an array is sized by stamps, which may be absurd
    if kept.size < max(MIN_BINS, 0.5 * time.size, 0.5 * (time[-1] - time[0]) / step):
        return None
    even = np.arange(kept[0], kept[-1], step)
    if np.max(np.diff(kept)) > max(1.0, 4.0 * step) or even.size < MIN_BINS:
        return None
    values[whole, :2] = np.unwrap(angles[whole], axis=0)
    evened = np.full((even.size, values.shape[1]), np.nan)
    for place in np.flatnonzero(measured):
        evened[:, place] = np.interp(even, kept, values[whole, place])
    return step, evened[:, :2], evened[:, 2:]
