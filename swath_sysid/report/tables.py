"""Tables: their values, and how they are shown to people and to other programs."""

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Self

from swath_sysid.formats.cells import kind_of_text


@dataclass(frozen=True)
class Column:
    """A column: its heading, and how a value is shown to the eye."""

    name: str
    show: Callable = str


def columns_of(shown: dict[str, Callable]) -> tuple[Column, ...]:
    """Columns by heading and how their values are shown."""
    return tuple(Column(name, show) for name, show in shown.items())


@dataclass(frozen=True)
class Table:
    """A table."""

    name: str  #: File name without ending.
    title: str  #: Empty where the section of the page says it.
    note: str
    columns: tuple[Column, ...]
    rows: tuple[tuple, ...]  #: Raw values, as the CSV file holds them.
    marks: dict = field(default_factory=dict)  #: Row and column to ``best`` or ``beyond``.
    finding: str = ''  #: A sentence on what the rows show.

    def shown(self) -> list[list[str]]:
        """The values as they are shown."""
        return [
            ['-' if value is None else column.show(value) for column, value in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def filled_columns(self) -> list[int]:
        """Places of the columns that hold a value."""
        shown = self.shown()
        return [k for k, _ in enumerate(self.columns) if any(row[k] not in ('-', '') for row in shown)]

    @classmethod
    def of(cls, name: str, title: str, note: str, items: Iterable[Any], *columns: tuple) -> Self:
        """A table of like items: each column is a heading, the value of an item, and how it is shown."""
        rows = tuple(tuple(value(item) for _, value, *_ in columns) for item in items)
        return cls(name, title, note, tuple(Column(heading, *show) for heading, _, *show in columns), rows)


SHORT = 12  #: Rows of a table that the terminal shows in full; of a longer one it shows a fourth of them.


def shortened(table: Table) -> Table:
    """A table of which, where it is long, the first rows are shown."""
    if len(table.rows) <= SHORT:
        return table
    left = f'{len(table.rows) - SHORT // 4} more rows are left out: --all or --json shows them.'
    return replace(table, rows=table.rows[: SHORT // 4], finding=left)


def table_as_csv(table: Table) -> str:
    """Text of a CSV file, its numbers with all their digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(map(_as_text, (c.name for c in table.columns)))
    writer.writerows(map(_as_text, row) for row in table.rows)
    return text.getvalue()


def _as_text(cell: Any) -> Any:
    """A cell that a spreadsheet would take for a formula, marked as text; numbers stay numbers."""
    is_formula = (
        isinstance(cell, str) and cell.lstrip().startswith(('=', '+', '-', '@')) and kind_of_text(cell) != 'number'
    )
    return f"'{cell}" if is_formula else cell


def table_in_words(table: Table) -> list[str]:
    """Aligned lines of text; columns without any value are left out."""
    kept = table.filled_columns()
    lines = [[table.columns[k].name for k in kept], *([row[k] for k in kept] for row in table.shown())]
    widths = [max(len(line[k]) for line in lines) for k in range(len(kept))]
    rows = ['  ' + '  '.join(c.rjust(w) for c, w in zip(line, widths, strict=True)) for line in lines]
    return [table.title, *rows, *([f'  {table.finding}'] if table.finding else [])]


def table_as_data(table: Table) -> list[dict[str, Any]]:
    """Rows as dicts by column name."""
    return [dict(zip((c.name for c in table.columns), row, strict=True)) for row in table.rows]
