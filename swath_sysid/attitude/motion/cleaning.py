"""A sensor's record, in whatever frame it was mounted, cleaned and assembled to a trial of the craft."""

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.sensor_checks import FROZEN, TILT_CODES, contradictions_in, is_blank
from swath_sysid.attitude.motion.stamps import GAP_INTERVALS
from swath_sysid.attitude.motion.trial import CHANNELS, FURTHER_CHANNELS, Trial
from swath_sysid.common.account import Loss, in_words
from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.conventions import LOST_SHARE, MIN_ROWS, ROUNDING
from swath_sysid.common.errors import InputError

#: rad, rad, rad/s, m/s^2, m; beyond these a value is a broken packet: MEMS sensors end at 35 rad/s and 16 g.
LARGEST_VALUES = {'angle': np.pi, 'heading': 2 * np.pi, 'rate': 35.0, 'acceleration': 200.0, 'heave': 50.0}

WRAP = 0.8  #: Of a turn; angles that count a whole turn jump by more where they pass zero.
SPIKE = 12.0  #: Of the median distance from what the neighbours say; of Gaussian noise no sample in 10^15 is beyond.
#: The cubic through two samples before and two after one, or two together, at these; by how many of the three steps
#: between those four a spike must be larger.
SPIKES = (
    ([[-1 / 6, 4 / 6, 4 / 6, -1 / 6]], (1.0, 0.0, 1.0)),
    ([[-0.3, 1.0, 0.5, -0.2], [-0.2, 0.5, 1.0, -0.3]], (4.0, 4.0, 4.0)),
)
RESOLVED = 6.0  #: Of the smallest steps: a sensor at rest goes to and fro by its resolution.
TO_AND_FRO = 0.3  #: Correlation of steps from which they are those between two sensors.
SHARED_STAMPS = 0.1  #: Share of the rows with a repeated stamp from which the stamps may be rounded.

Channels = dict[str, np.ndarray]


def one_row_per_sample(time: np.ndarray, channels: Channels) -> tuple[np.ndarray, Channels, list[Advice]]:
    """A record, time (N,) in s and channels (N,), with one row for each sample, and advice on the others: rows without
    a time or a value, which are empty or of another device, are left out, and rows that repeat a sample are merged.
    """
    time, *values = (np.where(np.isfinite(each), each, np.nan) for each in (time, *channels.values()))
    channels = dict(zip(channels, values, strict=True))
    advice: list[Advice] = []
    filled = np.isfinite(time) | np.any([np.isfinite(values) for values in channels.values()], axis=0)
    if (empty := int(np.count_nonzero(~filled))) and filled.any():
        advice += in_words([Loss('empty-rows', empty, time.size)], '')
        time, channels = time[filled], {name: values[filled] for name, values in channels.items()}
    copies = _repeated_samples(np.diff(time, prepend=np.nan) == 0.0, channels)
    if copies.any():
        advice += in_words([Loss('repeated-samples', int(copies.sum()), copies.size)], '')
        sample = np.cumsum(~copies) - 1
        channels = {name: _means(name, values, sample) for name, values in channels.items()}
        time = time[~copies]
    return time, channels, advice


def on_common_rows(time: np.ndarray, channels: Channels) -> tuple[np.ndarray, Channels, list[Advice]]:
    """A record in which sensors with stamps of their own were joined, which leaves cells empty: the rows of the first
    angle, and the channels of other rows interpolated to them, but not over their gaps; and advice.
    """
    known = {name: np.isfinite(values) & np.isfinite(time) for name, values in channels.items()}
    counts = {name: int(np.count_nonzero(rows)) for name, rows in known.items()}
    lead = next(
        (name for name in ('roll', 'pitch', *QUATERNION) if counts.get(name)), max(counts, key=counts.__getitem__)
    )
    base, moved = known[lead], {}
    for name, rows in known.items():
        if np.count_nonzero(rows & base) >= 0.5 * min(counts[name], counts[lead]) or counts[name] < MIN_ROWS:
            continue
        own, first = np.unique(time[rows], return_index=True)
        values = channels[name][rows][first]
        values = np.unwrap(values) if name in ('roll', 'pitch', 'yaw', 'heading') else values
        after = np.clip(np.searchsorted(own, time[base]), 1, own.size - 1)
        near = own[after] - own[after - 1] <= GAP_INTERVALS * np.median(np.diff(own))
        there = np.where(near, np.interp(time[base], own, values, np.nan, np.nan), np.nan)
        if np.count_nonzero(np.isfinite(there)) > 0.5 * min(counts[name], counts[lead]):
            moved[name] = there
    if not moved:
        return time, channels, []
    others = {name: values[base] for name, values in channels.items()}
    return time[base], others | moved, [Advice.of('joined-sensors', channels=', '.join(moved), lead=lead)]


def _repeated_samples(repeats: np.ndarray, channels: Channels) -> np.ndarray:
    """Which rows with the stamp of the previous one hold the same sample: copies, where most of them are copies; else
    all of them, where they differ from it less than the motion does from one stamp to the next.
    """
    if not repeats.any():
        return repeats
    steps = {name: _distance(name, values, np.r_[np.nan, values[:-1]]) for name, values in channels.items()}
    copies = repeats & np.all([(step == 0.0) | np.isnan(step) for step in steps.values()], axis=0)
    if np.count_nonzero(copies) > 0.5 * np.count_nonzero(repeats):
        return copies
    # of a sensor that moves, angles have the least noise; another channel may be held from one stamp to the next
    angles = [steps[name] for name in ('roll', 'pitch', *QUATERNION) if name in steps] or list(steps.values())
    sizes = [
        [float(np.nanmean(step[rows] ** 2)) for rows in (~repeats, repeats)]
        for step in angles
        if np.isfinite(step[repeats]).any() and np.isfinite(step[~repeats]).any()
    ]
    is_alike = any(between > GAP_INTERVALS * within for between, within in sizes)
    return repeats & (is_alike and np.mean(repeats) > SHARED_STAMPS)


def _distance(name: str, values: np.ndarray, others: np.ndarray | float) -> np.ndarray:
    """Values less others, of angles on the shorter way."""
    apart, turn = values - others, 2.0 * np.pi
    around = np.remainder(apart + 0.5 * turn, turn) - 0.5 * turn
    return around if name in ('roll', 'pitch', 'yaw', 'heading') else apart


def _means(name: str, values: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """The mean of the values of each sample, whose number is that of the row."""
    known = np.isfinite(values)
    one = np.fmin.reduceat(values, np.flatnonzero(np.diff(sample, prepend=-1)))
    apart = np.where(known, _distance(name, values, one[sample]), 0.0)
    return one + np.bincount(sample, apart) / np.maximum(np.bincount(sample, known), 1)


def clean(
    time: np.ndarray, channels: Channels, source: str = 'the record'
) -> tuple[np.ndarray, Channels, tuple[Advice, ...]]:
    """Clean a record, time (N,) in s and channels (N,) in SI units: increasing stamps, NaN for missing values. The
    longest increasing sequence of stamps is kept. Rows that share rounded stamps are spread evenly, impossible values
    (`limit_of`) become NaN, channels without a finite value are left out; gaps are only reported. A record that loses
    more than `LOST_SHARE` of its rows or values for one cause is refused.
    """
    time = np.asarray(time, dtype=float)
    channels = {name: np.asarray(values, dtype=float) for name, values in channels.items()}
    time, channels, advice = _in_time(time, channels, source)
    channels, turn_advice = _within_half_turns(channels)
    channels, spike_advice = _without_spikes(time, channels, source)
    channels, value_advice = _plausible_channels(channels, source)
    channels, stuck_advice = _without_stuck(time, channels)
    advice += [*turn_advice, *spike_advice, *value_advice, *stuck_advice]
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
    return time, channels, tuple(advice + _gap_advice(time))


def _in_time(time: np.ndarray, channels: Channels, source: str) -> tuple[np.ndarray, Channels, list[Advice]]:
    """The rows with a stamp of their own, in order, and advice on the others."""
    with np.errstate(invalid='ignore'):
        is_ordered = np.isfinite(time).all() and np.all(np.diff(time) > 0)
    advice: list[Advice] = []
    rows = np.flatnonzero(np.isfinite(time))
    in_bursts = _out_of_bursts(time[rows], channels, rows)
    if in_bursts is not None:
        time, is_ordered = time.copy(), rows.size == time.size
        time[rows], told = in_bursts
        advice.append(told)
    if is_ordered:
        return time, channels, advice
    if rows.size < time.size:
        advice += in_words([Loss('missing-stamps', time.size - rows.size, time.size)], source)
    _refuse_reversed(time[rows], source)
    fresh = np.ones(rows.size, dtype=bool)
    fresh[1:] = np.diff(time[rows]) != 0.0
    shared = int(np.count_nonzero(~fresh))
    if shared > SHARED_STAMPS * rows.size:
        spread, resolution = _spread_evenly(time[rows])
        if any(_is_of_two(channels[name][rows]) for name in ('roll', 'pitch', *QUATERNION) if name in channels):
            raise InputError(
                f'{source}: the rows that share a stamp are those of two sensors, between which the angle jumps to and '
                'fro: keep the rows of one'
            )
        if spread is not None:
            interval = float(np.median(np.diff(spread)))
            each = round(resolution / interval)
            advice.append(Advice.of('rounded-stamps', resolution=resolution, each=each, interval=interval))
            time = time.copy()
            time[rows] = spread
            fresh = np.ones(rows.size, dtype=bool)
        elif shared > 0.5 * rows.size:
            raise InputError(
                f'{source}: {shared} of {rows.size} rows have the stamp of the previous row, and no even sampling '
                f'explains it: write the time with more digits'
            )
    advice += in_words([Loss('repeated-stamps', int(np.count_nonzero(~fresh)), rows.size)], source)
    rows = rows[fresh]
    ordered = _longest_increasing(time[rows])
    disordered = int(rows.size - np.count_nonzero(ordered))
    if disordered:
        stepped = np.flatnonzero(np.diff(time[rows]) < 0.0)
        before, after = time[rows][stepped[0]], time[rows][stepped[0] + 1]
        said = {'times': counted(stepped.size, 'time'), 'before': before, 'after': after}
        advice += in_words([Loss('out-of-order-stamps', disordered, rows.size, said=said)], source)
    rows = rows[ordered]
    return time[rows], {name: values[rows] for name, values in channels.items()}, advice


def _is_of_two(values: np.ndarray) -> bool:
    """Whether a channel (N,) jumps to and fro between two sensors: its steps are opposite to the next ones, as in no
    motion that is resolved, and like those after these, as in no noise.
    """
    steps = np.diff(values[np.abs(values) <= np.pi])
    opposite, alike = -steps[1:] @ steps[:-1], steps[2:] @ steps[:-2]
    return bool(min(opposite, alike) > TO_AND_FRO * (steps @ steps) > 0.0)


def _out_of_bursts(time: np.ndarray, channels: Channels, rows: np.ndarray) -> tuple[np.ndarray, Advice] | None:
    """Even stamps for rows that arrive several at once, and advice; None where they do not. Within a burst the motion
    goes on as from one burst to the next, which it does not over a pause of the recorder.
    """
    steps = np.diff(time)
    if time.size < MIN_ROWS or not np.all(steps > 0.0):
        return None
    # over their number first: damaged stamps may be as large as a double
    begins = steps > np.sum(steps / steps.size) / GAP_INTERVALS
    if not MIN_ROWS <= np.count_nonzero(begins) <= 0.5 * steps.size:
        return None
    for values in channels.values():
        moved = np.abs(np.diff(values[rows]))
        if np.nanmean(moved[begins]) > GAP_INTERVALS * np.nanmean(moved[~begins]):
            return None
    spread, _ = _spread_evenly(time[np.maximum.accumulate(np.r_[0, np.where(begins, np.arange(1, time.size), 0)])])
    if spread is None:
        return None
    each, interval = round(time.size / (1 + np.count_nonzero(begins))), float(np.median(np.diff(spread)))
    return spread, Advice.of('bursts', each=each, interval=interval)


def _refuse_reversed(time: np.ndarray, source: str) -> None:
    """Reject a record in which hardly a stamp is later than the previous one."""
    if MIN_ROWS * np.count_nonzero(np.diff(time) > 0.0) < time.size and time[-1] < time[0]:
        raise InputError(
            f'{source}: the time runs backwards, from {time[0]:.6g} to {time[-1]:.6g} s: reverse the order of its '
            f'rows, or correct the sign of its time'
        )


def _spread_evenly(time: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Even stamps of which those given are roundings, or None, and the step of the rounding, s. Between gaps the rows
    are placed on a least-squares line, which must be within one step of every stamp.
    """
    steps = np.diff(time)
    if np.any(steps < 0.0) or not np.any(steps > 0.0):
        return None, 0.0
    resolution = float(np.median(steps[steps > 0.0]))
    ends = [*(np.flatnonzero(steps > GAP_INTERVALS * resolution) + 1).tolist(), time.size]
    spread, start = np.empty(time.size), 0
    for end in ends:
        if end - start < MIN_ROWS:
            return None, resolution
        rows = np.arange(end - start) - 0.5 * (end - start - 1)
        slope = float(rows @ time[start:end] / (rows @ rows))
        spread[start:end] = np.mean(time[start:end]) + slope * rows
        start = end
    is_even = np.all(np.abs(spread - time) < resolution) and np.all(np.diff(spread) > 0.0)
    return (spread if is_even else None), resolution


def _longest_increasing(values: np.ndarray) -> np.ndarray:
    """A mask of the longest strictly increasing subsequence, by patience sorting (Fredman, 1975)."""
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


def counts_whole_turns(angle: np.ndarray) -> bool:
    """Whether an angle (N,), rad, runs from 0 to a turn: it jumps where it passes zero, or exceeds half a turn."""
    if not angle.size or np.fmax.reduce(angle) <= np.pi:
        return False
    known, turn = angle[np.isfinite(angle)], 2.0 * np.pi
    if not known.size:
        return False
    within = np.mean((known >= 0.0) & (known <= turn + 0.01))
    jumps = np.abs(np.diff(known)) > WRAP * turn
    return bool(within >= 1.0 - 0.1 * LOST_SHARE and (jumps.any() or known.min() > np.pi))


def _within_half_turns(channels: Channels) -> tuple[Channels, list[Advice]]:
    """Angles from 0 to 360 deg as those from -180 to 180."""
    turned = [name for name in ('roll', 'pitch') if name in channels and counts_whole_turns(channels[name])]
    halves: Channels = {name: np.remainder(channels[name] + np.pi, 2.0 * np.pi) - np.pi for name in turned}
    advice = [Advice.of('angles-unwrapped', channels=' and '.join(turned))] if turned else []
    return channels | halves, advice


def _without_spikes(time: np.ndarray, channels: Channels, source: str) -> tuple[Channels, list[Advice]]:
    """Roll and pitch without single wrong samples, and advice."""
    angles = [name for name in ('roll', 'pitch') if name in channels]
    spikes: Channels = {name: spikes_in(time, channels[name]) for name in angles}
    losses = [_lost('wrong-samples', name, wrong) for name, wrong in spikes.items()]
    kept = {name: np.where(wrong, np.nan, channels[name]) for name, wrong in spikes.items() if wrong.any()}
    return channels | kept, [*in_words(losses, source)]


_windows = np.lib.stride_tricks.sliding_window_view


def spikes_in(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Which samples of an angle, rad, both (N,), jump away from their neighbours and back, one or two at a time: each
    is compared with the cubic through the two before and the two after, as far from which no other near it is.
    """
    wrong, known = np.zeros(time.size, dtype=bool), np.flatnonzero(np.isfinite(time) & np.isfinite(angle))
    if known.size < 4 * MIN_ROWS:
        return wrong
    centre = np.angle(np.mean(np.exp(1j * angle[known])))
    values, intervals = _distance('roll', angle[known], centre), np.diff(time[known])
    steps = np.diff(values)
    moves = np.abs(steps[steps != 0.0])
    if not moves.size:
        return wrong
    least, limit = RESOLVED * np.quantile(moves, LOST_SHARE), np.empty(0)
    for weights, kinks in SPIKES:
        width = len(weights)
        rows = _windows(values, width + 4)
        around = np.delete(rows, np.s_[2 : 2 + width], axis=1)
        apart = rows[:, 2 : 2 + width] - around @ np.transpose(weights)
        off = np.min(np.abs(apart), axis=1)
        if not limit.size:
            near = np.median(_windows(np.pad(off, MIN_ROWS, 'reflect'), 2 * MIN_ROWS + 1), axis=1)
            limit = np.maximum(SPIKE * np.maximum(near, np.median(off)), least)
        is_most = off == np.max(_windows(np.pad(off, 2), 5), axis=1)
        is_even = np.all(_windows(intervals, width + 3) < GAP_INTERVALS * np.median(intervals), axis=1)
        out, back = steps[1 : off.size + 1], steps[width + 1 : off.size + width + 1]
        jumps = (out * back < 0.0) & (np.minimum(np.abs(out), np.abs(back)) > 0.5 * off)
        # more than at a kink, as of values that a logger interpolates; of two, more than a craft moves at a low rate
        jumps &= off > np.max(np.abs(np.diff(around, axis=1)) * kinks, axis=1)
        jumps &= (off > limit[: off.size]) & np.all(apart[:, :1] * apart > 0.0, axis=1)
        for at in np.flatnonzero(jumps & is_most & is_even):
            wrong[known[at + 2 : at + 2 + width]] = True
    return wrong


def _without_stuck(time: np.ndarray, channels: Channels) -> tuple[Channels, list[Advice]]:
    """Angles without those that a sensor repeats after it lost the craft, where no rate can tell: they stand still away
    from their mean to the end of the record, or stop and go on with a jump, as no craft that is held and released does.
    """
    angles = {name: channels[name] for name in ('roll', 'pitch') if name in channels}
    if not angles or time.size < MIN_ROWS or any('rate' in name or name in (*GYRO, *QUATERNION) for name in channels):
        return channels, []
    moved = np.max([np.abs(np.diff(values)) for values in angles.values()], axis=0)
    edges = np.flatnonzero(np.diff(np.r_[1.0, moved, 1.0] == 0.0))
    moves = moved[moved > 0.0]
    # a coarse sensor of a craft at rest stands still, too, and goes on by one step of its own
    usual = max(float(np.median(moves)), 2.0 * float(moves.min())) if moves.size else np.inf
    advice = []
    for first, last in edges.reshape(-1, 2).tolist():
        if time[last] - time[first] < FROZEN or first == 0:
            continue
        is_away = any(abs(v[first] - np.nanmedian(v[:first])) > np.nanstd(v[:first]) for v in angles.values())
        jumps = min(moved[first - 1], moved[last] if last < moved.size else 0.0) >= usual
        if jumps or (is_away and last == moved.size):
            share = (last - first) / time.size
            advice.append(Advice.of('angles-stuck', start=time[first], end=time[last], share=share))
            angles = {
                name: np.r_[v[: first + 1], np.full(last - first, np.nan), v[last + 1 :]] for name, v in angles.items()
            }
    return channels | angles, advice


def _plausible_channels(channels: Channels, source: str) -> tuple[Channels, list[Advice]]:
    """The channels that hold something, absurd values as NaN, and advice."""
    finite = {name: np.isfinite(values) for name, values in channels.items()}
    with np.errstate(invalid='ignore'):
        absurd = {name: finite[name] & (np.abs(values) > limit_of(name)) for name, values in channels.items()}
    held = [name for name in channels if np.any(finite[name] & ~absurd[name])]
    losses = []
    for name in held:
        known = channels[name][finite[name]]
        losses.append(_lost('absurd-values', name, absurd[name], known.size, largest=np.abs(known).max()))
    losses += [_lost('missing-values', name, ~finite[name]) for name in held]
    advice = [*in_words(losses, source)]
    if empty := ', '.join(name for name in channels if name not in held):
        advice.append(Advice.of('empty-channel', channels=empty))
    return {name: np.where(finite[name] & ~absurd[name], channels[name], np.nan) for name in held}, advice


def _lost(code: str, name: str, rows: np.ndarray, of: int = 0, **said: object) -> Loss:
    """The values of a channel that were left out, by a mask of the rows."""
    return Loss(code, int(np.count_nonzero(rows)), of or rows.size, f'values of {name}', said)


def _gap_advice(time: np.ndarray) -> list[Advice]:
    intervals = np.diff(time)
    median = np.median(intervals)
    gaps = np.flatnonzero(intervals > GAP_INTERVALS * median)
    if not gaps.size:
        return []
    at, number = gaps[np.argmax(intervals[gaps])], counted(gaps.size, 'gap')
    return [Advice.of('gaps', gaps=number, longest=intervals[at], time=time[at], median=median)]


def limit_of(name: str) -> float:
    """The largest value that a channel of that name may hold, of a record or of a message; infinite: any."""
    kind = {'roll': 'angle', 'pitch': 'angle', 'yaw': 'heading'}.get(name, name)
    if name.endswith('_rate') or name.startswith('gyro_'):
        kind = 'rate'
    elif name.startswith('accel_'):
        kind = 'acceleration'
    return LARGEST_VALUES.get(kind, np.inf)


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
    understood: Sequence[str] = (),
) -> Trial:
    """A trial from the readings of a sensor, (N,) each, in SI units: cleaned, in the craft's axes, with Euler rates.
    Readings are any of ``roll``, ``pitch``, ``yaw`` or ``quaternion_x`` ... ``_w``; ``heading``, clockwise from north;
    Euler rates ``roll_rate`` ... or body rates ``gyro_x`` ...; specific force ``accel_x`` ...; ``heave`` along the
    frame's vertical.
    """
    installation = installation or Installation()
    name = source or 'the record'
    time, readings, sample_advice = one_row_per_sample(time, readings)
    time, readings, joined_advice = on_common_rows(time, readings)
    recorded = len(time)
    time, readings, cleaning_advice = clean(time, readings, name)
    channels, motion_advice = _craft_channels(time, readings, installation, name)
    channels = {key: values for key, values in channels.items() if np.isfinite(values).any()}
    is_of_sensor = installation.mounting is not None or not {*QUATERNION, *GYRO}.isdisjoint(readings)
    contradictions = contradictions_in(time, channels, installation)
    if not is_of_sensor:
        # columns that name the angles of the craft may well show its trim
        contradictions = tuple(each for each in contradictions if each.code not in TILT_CODES)
    trial = Trial(
        time=time,
        **{key: values for key, values in channels.items() if key in (*CHANNELS, *FURTHER_CHANNELS)},
        source=source,
        draft=draft,
        initial_angle=initial_angle,
        advice=(*advice, *sample_advice, *joined_advice, *cleaning_advice, *motion_advice, *contradictions),
        usable_share=len(time) / recorded,
        understood=tuple(understood),
        installation=installation if is_of_sensor else None,
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
    if _has(readings, (*QUATERNION, *GYRO)) and is_blank(
        time, np.column_stack(_parts(readings, QUATERNION)), np.column_stack(_parts(readings, GYRO))
    ):
        readings = {part: values for part, values in readings.items() if part not in QUATERNION}
        advice.append(Advice.of('blank-orientation', name=name))
    angles = _angles(readings, installation, name)
    if not _has(readings, QUATERNION) and _has(readings, ('roll', 'pitch')):
        # the last tenth before a quarter turn, where an error of the roll is six times that of the sensor
        steep = np.abs(readings['pitch'])[np.abs(readings['pitch']) > 0.9 * 0.5 * np.pi]
        if steep.size >= MIN_ROWS:
            advice.append(Advice.of('near-vertical', pitch=np.degrees(steep.max())))
    if _has(readings, QUATERNION):
        invalid = int(np.count_nonzero(~attitude.is_orientation(*_parts(readings, QUATERNION))))
        if invalid:
            advice.append(Advice.of('invalid-orientation', invalid=invalid, number=len(time)))
        angles, spike_advice = _without_spikes(time, angles, name)
        advice += spike_advice
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
