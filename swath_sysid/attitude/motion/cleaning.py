"""Cleaning: a record as it came from a sensor, made fit to be a trial."""

from bisect import bisect_left

import numpy as np

from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.errors import InputError

MIN_ROWS = 8  #: Fewer rows than this hold no motion to identify.

#: Beyond these (rad, rad, rad/s, m/s^2, m) a value is a broken packet: MEMS sensors end at 35 rad/s and 16 g, and no
#: wave lifts a craft by 50 m.
LARGEST_VALUES = {'angle': np.pi, 'heading': 2 * np.pi, 'rate': 35.0, 'acceleration': 200.0, 'heave': 50.0}

GAP_INTERVALS = 3.0  #: An interval longer than this many median intervals is a gap.

#: The 90 % band of the intervals, relative to their median, from which a time base counts as uneven.
UNEVEN_SPREAD = 0.1


Channels = dict[str, np.ndarray]


def clean(
    time: np.ndarray, channels: Channels, source: str = 'the record'
) -> tuple[np.ndarray, Channels, tuple[Advice, ...]]:
    """Leave out what cannot be used, mark what cannot be true, and say so.

    Rows without a finite stamp, with the stamp of the row before, or out of order are left out
    (the longest increasing sequence of stamps stays, so one stray stamp costs one row). Absurd
    values become NaN. Channels without a finite value are left out. Gaps and an uneven time base
    are only reported.

    Args:
        time: (N,); seconds.
        channels: dict of str to (N,); SI units. What a value may be follows from the name: ``roll`` and ``pitch`` are
            angles, ``yaw`` and ``heading`` headings, ``*_rate`` and ``gyro_*`` rates, ``accel_*`` accelerations,
            ``heave`` itself; others are only looked at for NaN.
        source: What to call the record in messages.

    Returns:
        time: (M,); strictly increasing and finite.
        channels: dict of str to (M,); naN marks a missing value.
        advice: Codes ``missing-stamps``, ``repeated-stamps``, ``out-of-order-stamps``, ``absurd-values``,
            ``missing-values``, ``empty-channel``, ``gaps``, ``uneven-time-base``.

    Raises:
        InputError: Fewer than `MIN_ROWS` rows have a stamp of their own, or hold a usable value.
    """
    time = np.asarray(time, dtype=float)
    rows, advice = _usable_rows(time)
    if rows is not None:
        time = time[rows]
    channels = {
        name: np.asarray(values, dtype=float)[... if rows is None else rows] for name, values in channels.items()
    }
    channels, value_advice = _plausible_channels(channels)
    advice += value_advice
    if time.size < MIN_ROWS:
        raise InputError(
            f'{source} holds {counted(time.size, "row")} with a stamp of its own and at least {MIN_ROWS} are '
            f'needed: check that it was recorded to the end and that its stamps increase'
        )
    filled = np.zeros(time.size, dtype=bool)
    for values in channels.values():
        filled |= np.isfinite(values)
    usable = int(np.count_nonzero(filled))
    if usable < MIN_ROWS:
        raise InputError(
            f'{source} holds usable values in {counted(usable, "row")} of {time.size} and at least {MIN_ROWS} are '
            f'needed: check that the sensor sent data and that the units are right'
        )
    return time, channels, tuple(advice + _time_base_advice(time))


def _usable_rows(time: np.ndarray) -> tuple[np.ndarray | None, list[Advice]]:
    """A mask of the rows to keep (None: all of them) and advice."""
    advice: list[Advice] = []
    with np.errstate(invalid='ignore'):
        if np.isfinite(time).all() and np.all(np.diff(time) > 0):
            return None, advice
    rows = np.flatnonzero(np.isfinite(time))
    if rows.size < time.size:
        advice.append(
            Advice(
                'missing-stamps',
                (
                    f'{counted(time.size - rows.size, "row")} without a finite time left out: check what wrote the '
                    'stamps'
                ),
            )
        )
    fresh = np.ones(rows.size, dtype=bool)
    fresh[1:] = time[rows][1:] != time[rows][:-1]
    repeated = int(rows.size - np.count_nonzero(fresh))
    rows = rows[fresh]
    if repeated:
        advice.append(
            Advice(
                'repeated-stamps',
                (
                    f'{counted(repeated, "row")} with the stamp of the row before left out: if most are, write the '
                    f'time with more digits'
                ),
            )
        )
    ordered = _longest_increasing(time[rows])
    disordered = int(rows.size - np.count_nonzero(ordered))
    if disordered:
        advice.append(
            Advice(
                'out-of-order-stamps',
                (
                    f'{counted(disordered, "row")} out of order left out: if these are two recordings in one file or a '
                    f'replay that looped, split it'
                ),
            )
        )
    keep = np.zeros(time.size, dtype=bool)
    keep[rows[ordered]] = True
    return keep, advice


def _longest_increasing(values: np.ndarray) -> np.ndarray:
    """A mask of the longest strictly increasing subsequence.

    Patience sorting (Fredman, 1975), run only over the rows in dispute: one that exceeds all
    before it and is exceeded by all after it belongs to every longest sequence.
    """
    keep = np.ones(values.size, dtype=bool)
    if values.size < 2:
        return keep
    keep[1:] &= values[1:] > np.maximum.accumulate(values)[:-1]
    keep[:-1] &= values[:-1] < np.minimum.accumulate(values[::-1])[::-1][1:]
    disputed = np.flatnonzero(~keep)
    tails: list[float] = []
    tail_positions: list[int] = []
    previous: list[int] = []
    for position, value in enumerate(values[disputed].tolist()):
        length = bisect_left(tails, value)
        previous.append(tail_positions[length - 1] if length else -1)
        if length == len(tails):
            tails.append(value)
            tail_positions.append(position)
        else:
            tails[length] = value
            tail_positions[length] = position
    position = tail_positions[-1] if tail_positions else -1
    while position >= 0:
        keep[disputed[position]] = True
        position = previous[position]
    return keep


def _plausible_channels(channels: Channels) -> tuple[Channels, list[Advice]]:
    """The channels that hold something, absurd values as NaN, and advice."""
    plausible, advice = {}, []
    missing: dict[str, int] = {}
    absurd: dict[str, int] = {}
    empty: list[str] = []
    for name, values in channels.items():
        finite = np.isfinite(values)
        missing[name] = values.size - int(np.count_nonzero(finite))
        largest = LARGEST_VALUES.get(_kind(name), np.inf)
        wild = finite & (np.abs(values) > largest)
        absurd[name] = int(np.count_nonzero(wild))
        if absurd[name] or np.isinf(values).any():
            values = np.where(finite & ~wild, values, np.nan)
        if np.isfinite(values).any():
            plausible[name] = values
        else:
            empty.append(name)
    if any(absurd.values()):
        advice.append(
            Advice(
                'absurd-values',
                (
                    f'values no craft can have left out ({_listed(absurd)}): check the units in the column names, or '
                    f'look for broken packets'
                ),
            )
        )
    missing = {name: count for name, count in missing.items() if name in plausible}
    if any(missing.values()):
        advice.append(Advice('missing-values', (f'values missing ({_listed(missing)}): they are left out of the fit')))
    if empty:
        advice.append(
            Advice(
                'empty-channel',
                (f'no usable value in {", ".join(empty)}: left out; check that the sensor was set to send it'),
            )
        )
    return plausible, advice


def _time_base_advice(time: np.ndarray) -> list[Advice]:
    """Advice on gaps and uneven intervals."""
    advice = []
    intervals = np.diff(time)
    low, median, high = np.percentile(intervals, [5, 50, 95])
    gaps = np.flatnonzero(intervals > GAP_INTERVALS * median)
    if gaps.size:
        longest = gaps[np.argmax(intervals[gaps])]
        advice.append(
            Advice(
                'gaps',
                (
                    f'{counted(gaps.size, "gap")} in the time base, the longest of {intervals[longest]:.4g} s after '
                    f't = {time[longest]:.6g} s (samples come every {median:.4g} s): nothing is filled in; choose a '
                    f'part without gaps if the fit is poor'
                ),
            )
        )
    if high - low > UNEVEN_SPREAD * median:
        advice.append(
            Advice(
                'uneven-time-base',
                (
                    f'sample intervals run from {low:.4g} to {high:.4g} s about a median of {median:.4g} s: if these '
                    f'are times of arrival, use the stamps of the sensor'
                ),
            )
        )
    return advice


def _kind(name: str) -> str:
    """The kind of quantity a channel holds, by its name."""
    if name in ('roll', 'pitch'):
        return 'angle'
    if name in ('yaw', 'heading'):
        return 'heading'
    if name == 'heave':
        return name
    if name.endswith('_rate') or name.startswith('gyro_'):
        return 'rate'
    return 'acceleration' if name.startswith('accel_') else ''


def _listed(counts: dict[str, int]) -> str:
    return ', '.join(f'{name}: {count}' for name, count in counts.items() if count)
