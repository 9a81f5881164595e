"""The time of a table: which columns tell it, what they count, and where their counter starts again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.advice import Advice, counted
from swath_sysid.formats.files import shown
from swath_sysid.formats.text_tables import NamedColumns
from swath_sysid.formats.vocabulary import (
    DATE_NAMES,
    FURTHER_TIMES,
    SAMPLES,
    SPANS,
    TIME,
    TIME_NAMES,
    TURNS,
    UNITS,
    WEEK_NAMES,
    readings_of,
)

COUNTER = '0_1_ms'  #: Of a sensor since it was switched on.
SIZES_OF_TEXT = dict.fromkeys(('date', 'day', 'clock'), 1.0)  #: s.
SIZES = {**UNITS, **SIZES_OF_TEXT, 'week': SPANS['week'], 'days': SPANS['day']}  #: s.


@dataclass(frozen=True)
class Column:
    """A column that is read: what it holds, its position and its unit."""

    reading: str
    name: str  #: As written.
    index: int | None  #: None of a time that only a sample rate gives.
    unit: str | None  #: None: none is stated.

    @property
    def in_words(self) -> str:
        """What it was read as."""
        return f"{self.reading} '{shown(self.name)}' ({self.unit or 'no unit'})"

    @property
    def scale(self) -> float:
        """Its unit in SI."""
        return SIZES.get(self.unit or '', 1.0)


@dataclass(frozen=True)
class Clock:
    """A time, and how it was read."""

    time: np.ndarray  #: (N,), s, from the first row where it counts from an epoch.
    start: float  #: The first time, s, from whatever it counts.
    columns: tuple[Column, ...]
    turns: int = 0  #: How often its counter started again.

    @property
    def name(self) -> str:
        """Of its columns, as written."""
        return ' and '.join(column.name for column in self.columns)

    @property
    def in_words(self) -> str:
        """Its columns and their units."""
        return f"time '{shown(self.name)}' ({' and '.join(str(column.unit) for column in self.columns)})"


Clocks = list[tuple[Column, ...]]


def clocks_of(plain: Sequence[str], table: NamedColumns) -> Clocks:
    """The columns that may be the time, the likeliest first: of each a column, or two that are added."""
    ways = [dict(readings_of(name)) for name in plain]

    def column(place: int, unit: str | None) -> Column:
        return Column('time', table.names[place], place, unit)

    def places(names: Sequence[str], *kinds: str) -> list[int]:
        stems = {name.replace('_', '') for name in names}
        return [k for k, way in enumerate(ways) if way.keys() & stems and table.kinds.get(k, '') in kinds]

    times, parts = (*TIME_NAMES, *FURTHER_TIMES, *DATE_NAMES), {'sec': 's', 'nanosec': 'ns'}
    found: Clocks = [(column(k, 'date'),) for k in places(times, 'date')]
    days, hours = (places(times, kind) for kind in ('day', 'clock'))
    found += [(column(days[0], 'day'), column(k, 'clock')) for k in hours[: len(days[:1])]]
    found += [(column(k, 'clock'),) for k in hours if not days]
    for names in (TIME_NAMES, FURTHER_TIMES):
        for name in names:
            here = {
                unit: k for k in places([name], '') for stem, unit in ways[k].items() if stem == name.replace('_', '')
            }
            weeks = places(WEEK_NAMES, '')
            for unit in sorted(here.keys() & {*TIME, SAMPLES}, key=[*TIME, SAMPLES].index):
                is_of_week = bool(weeks) and name in FURTHER_TIMES
                found.append((*(column(k, 'week') for k in weeks[: int(is_of_week)]), column(here[unit], unit)))
            if '' in here:
                found.append((column(here[''], None),))
    for prefix in ('', *(f'{name}_' for name in TIME_NAMES)):
        if all(f'{prefix}{part}' in plain for part in parts):
            found.append(tuple(column(plain.index(f'{prefix}{part}'), unit) for part, unit in parts.items()))
    return [
        each for at, each in enumerate(found) if each[-1].index not in {c.index for other in found[:at] for c in other}
    ]


def with_unit_by_size(column: Column, values: np.ndarray) -> Column:
    """A time without a unit with the one that its size leaves no doubt of: of an epoch, or a day."""
    if column.unit is not None or column.reading != 'time':
        return column
    known = values[np.isfinite(values)]
    steps = np.diff(known)
    first, step = (abs(known[0]), np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else (0.0, np.inf)
    unit = None
    if step < 2.0 / SPANS['day']:
        unit = 'days'  # in seconds faster than any sensor of motion
    elif first > SPANS['epoch']:
        unit = TIME[min(3, int(np.log10(first / SPANS['epoch']) // 3))]
    return Column(column.reading, column.name, column.index, unit)


def clock_of(columns: Sequence[Column], values: Sequence[np.ndarray]) -> Clock:
    """The time of columns in their units, added."""
    scaled = [row if column.scale == 1.0 else row * column.scale for column, row in zip(columns, values, strict=True)]
    start = sum(map(first_finite, scaled))
    if abs(start) > SPANS['epoch'] or columns[-1].unit == 'clock':
        # subtracted before the nanoseconds are added: a double resolves an epoch to 0.2 us only
        scaled = [row - first_finite(row) for row in scaled]
    time, turns = unwrapped(sum(scaled[1:], scaled[0]), columns[-1].unit or '', columns[-1].scale)
    zero = first_finite(time) if columns[-1].unit == COUNTER else 0.0
    return Clock(time - zero, start - zero, tuple(columns), turns)


def unwrapped(time: np.ndarray, unit: str, scale: float) -> tuple[np.ndarray, int]:
    """A time (N,), s, that continues where its clock restarts, and how often that is: at midnight, at the end of summer
    time, or at the largest number of a counter.
    """
    known = np.flatnonzero(np.isfinite(time))
    values = time[known]
    steps = np.diff(values)
    if not np.any(steps < 0.0) or not np.any(steps > 0.0):
        return time, 0
    typical = float(np.median(steps[steps > 0.0]))
    if unit in SIZES_OF_TEXT:
        turns = [SPANS['day'], SPANS['hour']]
    else:
        turns = [turn * (scale * 1e3 if unit == SAMPLES else 1.0) for turn in TURNS]
        turns = [turn for turn in turns if 0.0 <= values.min() and values.max() < turn + typical]
    for turn in turns:
        whole = np.minimum(np.round(steps / turn), 0.0)
        over = steps - whole * turn
        found = (whole < 0.0) & (over > 0.0) & (over <= SPANS['near_steps'] * typical) & (4.0 * typical < turn)
        if found.any():
            time = time.copy()
            time[known[1:]] -= np.cumsum(np.where(found, whole * turn, 0.0))
            # midnight is no fault of a clock
            return time, 0 if turn == SPANS['day'] and unit in SIZES_OF_TEXT else int(np.count_nonzero(found))
    return time, 0


def chosen(clocks: Sequence[Clock]) -> tuple[Clock, tuple[Advice, ...]]:
    """The best of the clocks of a file: the one that goes forward, then evenly, then counts from an epoch."""
    several = len(clocks) > 1
    judged = [(each, *(_quality(each.time) if several else (1.0, 0.0)), _duration(each)) for each in clocks]
    best, forward, jitter, duration = judged[0]
    for each in judged[1:]:
        other, forward_too, jitter_too, duration_too = each
        differ = _apart(duration_too, duration) > SPANS['drift']
        if (
            forward_too > 1.05 * forward
            or forward_too > 0.95 * forward
            and (
                jitter_too < jitter - 0.1
                or (differ and jitter_too < jitter + 0.1 and abs(other.start) > SPANS['epoch'] >= abs(best.start))
            )
        ):
            best, forward, jitter, duration = each
    drifts = {
        other.name: share
        for other, forward_too, _, duration_too in judged
        if other is not best and forward_too > 0.0
        and SPANS['drift'] < (share := _apart(duration_too, duration)) < 0.5
    }  # fmt: skip
    advice = [Advice.of('two-clocks', best=shown(best.name), other=shown(n), share=s) for n, s in drifts.items()]
    if best.turns:
        advice.append(Advice.of('time-unwrapped', name=shown(best.name), turns=counted(best.turns, 'time')))
    return best, tuple(advice)


def _apart(duration: float, from_that_of_the_best: float) -> float:
    """Share by which two durations differ; a clock that stands has none that others could be compared with."""
    return abs(duration / from_that_of_the_best - 1.0) if from_that_of_the_best else np.inf


def _duration(clock: Clock) -> float:
    known = clock.time[np.isfinite(clock.time)]
    return float(known[-1] - known[0]) if known.size > 1 else 0.0


def _quality(time: np.ndarray) -> tuple[float, float]:
    """Share of the rows that are later than the one before, and how far steps are off the median, over it."""
    steps = np.diff(time)
    forward = steps[steps > 0.0]
    if not forward.size:
        return 0.0, np.inf
    return forward.size / max(1, steps.size), float(np.mean(np.abs(forward / np.median(forward) - 1.0) > 0.1))


def first_finite(values: np.ndarray) -> float:
    """The first value that is known, 0 where none is."""
    finite = np.flatnonzero(np.isfinite(values))
    return values[finite[0]] if finite.size else 0.0
