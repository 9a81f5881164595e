"""Where a table begins in rows of cells, and what its columns are called, whatever stands above."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, time, timedelta
from typing import Any

from swath_sysid.formats.cells import MISSING, kind_of_text
from swath_sysid.formats.vocabulary import is_known, is_unit, with_unit

RULE = re.compile(r'[-=_*+#|~. ]*')  #: A line that only separates.
ROWS_OF_SAMPLE = 400  #: In which a table is looked for.

Row = Sequence[Any]  #: Of cells: texts, numbers, times, None.


@dataclass(frozen=True)
class Located:
    """A table in rows."""

    names: tuple[str, ...]  #: With the units of a row of their own; empty where no row holds names.
    first: int  #: The first row of numbers.
    used: tuple[int, ...]  #: Rows of names and units.


def kind_of_cell(cell: Any) -> str:
    """``number``, ``date``, ``day`` or ``clock``; ``text``; or nothing where it is empty."""
    if isinstance(cell, str):
        cell = cell.strip().strip('"\'').strip()
        return '' if cell.lower() in MISSING else kind_of_text(cell)
    if cell is None:
        return ''
    if isinstance(cell, datetime):
        return 'date'
    return 'clock' if isinstance(cell, time | timedelta) else 'number'


def balance(row: Row) -> tuple[int, int]:
    """How many cells hold a value, and how many a text."""
    kinds = [kind_of_cell(cell) for cell in row]
    return sum(kind not in ('', 'text') for kind in kinds), kinds.count('text')


def locate(rows: Sequence[Row], comments: Sequence[Row | None] = ()) -> Located | None:
    """The table in rows: the largest run of rows with at least as many values as texts, and the names above. Comments
    are rows by their place; names are taken from them where no other row holds any.
    """
    best, size, begun, held = None, 0, None, 0
    for at, row in enumerate((*rows, ('end',))):
        values, texts = balance(row)
        if values and values >= texts:
            begun, held = (at, 0) if begun is None else (begun, held)
            held += values
        elif texts and begun is not None:
            if held > size:
                best, size = begun, held
            begun = None
    if best is None:
        return None
    found = _below_names(rows, comments, best)
    # a header that is repeated, as by a logger that was started again, ends no table
    earlier = rows.index(rows[found.used[0]]) if found.used and rows[found.used[0]] else best
    again = next((at for at in range(earlier, best) if _holds_values(rows[at])), best)
    return found if again == best else _below_names(rows, comments, again)


def _below_names(rows: Sequence[Row], comments: Sequence[Row | None], first: int) -> Located:
    lines = {at: rows[at] for at in range(first) if _is_title(rows[at])}
    if not lines:
        lines = {at: row for at, row in enumerate(comments[:first]) if row is not None and _is_title(row)}
    names, used = _names(lines)
    return Located(names, first, used)


def _holds_values(row: Row) -> bool:
    values, texts = balance(row)
    return values > 0 and values >= texts


def _is_title(row: Row) -> bool:
    texts = ''.join(str(cell) for cell in row if cell is not None)
    return bool(re.search(r'[^\W\d_]|°', texts)) and not RULE.fullmatch(texts)


def _names(lines: dict[int, Row]) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """The names among the lines above the numbers: the line with most that are known, else the lowest."""
    last = sorted(lines)
    texts = {at: [str('' if cell is None else cell).strip().strip('"\'').strip() for cell in lines[at]] for at in last}
    named = [at for at in last if not _are_units(texts[at])] or last
    if not named:
        return (), ()
    at = max(named, key=lambda each: (sum(map(is_known, filter(None, texts[each]))), each))
    units = next((each for each in last if each > at and _are_units(texts[each])), None)
    above = [each for each in last if each < at][-1:]
    if units is None and above and len(texts[above[0]]) == len(texts[at]) and all(map(is_unit, texts[above[0]])):
        units = above[0]
    texts[at] = _qualified(texts[at], [texts[each] for each in last if each < at and each != units])
    if units is None:
        return tuple(texts[at]), (at,)
    below = [*texts[units], *[''] * len(texts[at])]
    return tuple(with_unit(name, unit) for name, unit in zip(texts[at], below, strict=False)), (at, units)


def _qualified(names: list[str], above: Sequence[list[str]]) -> list[str]:
    """Names that recur, such as the X, Y, Z of several bodies, with what the rows above call each of them."""
    times = Counter(names)
    again = [place for place, name in enumerate(names) if name and times[name] > 1]
    parts = [[names[place]] for place in again]
    for row in above if again else ():
        if len(row) >= len(names) and all(row[place] for place in again):
            prefixes = [row[place] for place in again]
        elif {times[names[place]] for place in again} == {len(row) - 1}:
            # a key, and then a name for each body
            prefixes = [row[1 + names[:place].count(names[place])] for place in again]
        else:
            continue
        finer = [[*part[:-1], prefix, part[-1]] for prefix, part in zip(prefixes, parts, strict=True)]
        if len(set(map(tuple, finer))) > len(set(map(tuple, parts))):
            parts = finer
    if len(set(map(tuple, parts))) < len(parts):
        return names
    full = dict(zip(again, map('/'.join, parts), strict=True))
    return [full.get(place, name) for place, name in enumerate(names)]


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row holds units: of columns that are not read, they need not be known."""
    filled = [cell for cell in cells if cell]
    return any(map(is_unit, filled)) and not any(is_known(cell) and not is_unit(cell) for cell in filled)
