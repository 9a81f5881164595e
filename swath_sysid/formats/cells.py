"""Cells of tables: what kind of value a text holds, and the value."""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import UTC, date, datetime, time, timedelta
from itertools import pairwise
from typing import Any

import numpy as np

from swath_sysid.common.errors import InputError

#: How a missing value may be written, beside nan.
MISSING = frozenset(('', '-', '--', 'na', 'n/a', '#n/a', 'null', 'none', 'nat', '?'))

_NUMBER = re.compile(
    r"[-+\u2212\u2013]?((\d{1,3}(['\u2019\u00a0\u202f ]\d{3})+|\d{1,3}([.,]\d{3})+|\d+)([.,]\d+|\.)?|[.,]\d+)"
    r'([eEdD][-+]?\d+)?\s?[°%]?'
)
_ISO = re.compile(r'\d{4}-?\d\d-?\d\d[T ]\d\d:?\d\d(:?\d\d([.,]\d+)?)?(Z|[+-]\d\d(:?\d\d)?)?', re.IGNORECASE)
_CLOCK = r'((?P<h>\d{1,2}):)?(?P<m>\d\d?):(?P<s>\d\d([.,:]\d+)?)\s*(?P<half>[ap]\.?m\.?)?\s*(Z|UTC|GMT|[+-]\d\d:?\d\d)?'
_YEAR_FIRST = r'(?P<Y>\d{4})(?P<mark>[-/.])(?P<M>\d\d?)(?P=mark)(?P<D>\d\d?)'
_YEAR_LAST = r'(?P<a>\d\d?)(?P<by>[-/.])(?P<b>\d\d?)(?P=by)(?P<y>\d{4}|\d\d)'
LONGEST_PAUSE = 300  #: Days between two dates of a record.
OPEN_DATES = 'open-dates'  #: Code of the error where day and month of a column may be exchanged.
#: How months begin in English, German, French, Spanish and Italian, without accents.
MONTHS = (
    'jan gen ene', 'feb fev', 'mar mrz', 'apr avr abr', 'may mai mag', 'jun juin giu', 'jul juil lug', 'aug aou ago',
    'sep set', 'oct okt ott', 'nov', 'dec dez dic',
)  # fmt: skip
_NAMED = r'(?P<d>\d\d?)[-/. ]{1,2}(?P<month>[^\W\d_]{3,10})[-/. ]{1,2}(?P<yy>\d{4}|\d\d)'
#: As in ``Nov 27, 2026`` and, from JavaScript, ``Fri Nov 27 2026``.
_NAME_FIRST = r'([^\W\d_]{3},? )?(?P<name>[^\W\d_]{3,10})\.? (?P<of>\d\d?)[,.]? (?P<yyyy>\d{4})'
_DAY = f'({_YEAR_FIRST}|{_YEAR_LAST}|{_NAMED}|{_NAME_FIRST})'
_FORMS = {
    'clock': re.compile(_CLOCK, re.IGNORECASE),
    'day': re.compile(_DAY),
    'date': re.compile(rf'{_DAY}[,T _-]\s*{_CLOCK}', re.IGNORECASE),
}

#: A date that states its parts by their order alone, and the hour of the time beside it.
DATE_IN_NUMBERS = re.compile(r'(?<![\d./-])(\d\d?)([-/.])(\d\d?)\2(\d{4}|\d\d)(?![\d./])(?:\D{1,4}(\d\d?):\d\d)?')
ORDERS = DAY_FIRST, MONTH_FIRST, _ = 'dmy', 'mdy', 'ymd'  #: Of the parts of such a date, the usual one first.
THOUSANDS = re.compile(r'[-+]?\d{1,3}(,\d{3})+')
GROUPED = re.compile(r"\d(['\u2019\u00a0\u202f ])\d{3}(?!\d)")  #: A mark between groups of three digits.
#: Signs and blanks as word processors write them.
OTHER_MARKS = str.maketrans({'\u2212': '-', '\u2013': '-', '\u00a0': ' ', '\u202f': ' ', '\u2019': "'"})


def kind_of_text(cell: str) -> str:
    """``number``, ``date`` (with its time), ``day``, ``clock`` or ``text``."""
    try:
        float(cell)
        return 'number' if '_' not in cell else 'text'
    except ValueError:
        pass
    if _NUMBER.fullmatch(cell):
        return 'number'
    if _ISO.fullmatch(cell):
        return 'date'
    return next((kind for kind, form in _FORMS.items() if form.fullmatch(cell)), 'text')


def known_number(cell: str) -> float:
    """A number, NaN where it is missing; also with Fortran's exponent, or with a sign of degrees behind."""
    cell = cell.strip()
    if cell.lower() in MISSING:
        return np.nan
    try:
        return float(cell)
    except ValueError:
        if not _NUMBER.fullmatch(cell):
            raise
        return float(re.sub('[dD]', 'e', cell.rstrip(' °%\u00c2')))


def seconds_of_text(cell: str, order: str = DAY_FIRST) -> float:
    """Seconds since 1970 of a date, with or without a zone (UTC then), or of the day; a number stays."""
    cell = cell.strip()
    try:
        is_iso = cell[4:5] == '-' or cell[8:9] in ('T', 't', ' ')
        return _since_1970(datetime.fromisoformat(cell)) if is_iso else known_number(cell)
    except ValueError:
        found = next((match for form in _FORMS.values() if (match := form.fullmatch(cell))), None)
        if found is None:
            raise
    said = found.groupdict()
    seconds = 0.0
    if said.get('m'):
        hour = int(said['h'] or 0) % (12 if said['half'] else 24)
        late = 12 if (said['half'] or '').lower().startswith('p') else 0
        seconds = 3600.0 * (hour + late) + 60.0 * int(said['m']) + float(re.sub('[,:]', '.', said['s']))
    if any(said.get(year) for year in ('Y', 'y', 'yy', 'yyyy')):
        seconds += _since_1970(datetime(*_year_month_day(said, order)))
    return seconds


def _year_month_day(said: dict[str, str], order: str) -> tuple[int, int, int]:
    if said['Y']:
        return int(said['Y']), int(said['M']), int(said['D'])
    if named := said['month'] or said['name']:
        name = plain_letters(named).replace('mae', 'mar')
        month = next((at for at, ways in enumerate(MONTHS, 1) if name.startswith(tuple(ways.split()))), 0)
        return _whole_year(said['yy'] or said['yyyy']), month, int(said['d'] or said['of'])
    return _in_order((said['a'], said['b'], said['y']), order)


def _in_order(said: Sequence[str], order: str) -> tuple[int, int, int]:
    year, month, day = (said[order.index(part)] for part in 'ymd')
    return _whole_year(year), int(month), int(day)


def order_of_dates(texts: Iterable[str]) -> str:
    """The order of day, month and year in all the dates of a column: that in which most are dates, no year passes from
    one to the next, midnight is followed by the next day, and time goes forward. Raises `InputError` where two orders
    are left that differ in the time between rows.
    """
    hours: dict[tuple[str, ...], list[str]] = {}  # the first and the last of each date
    for said in (each.groups() for text in texts for each in DATE_IN_NUMBERS.finditer(text)):
        hours.setdefault(said[:4], [said[4], said[4]])[1] = said[4]
    days = {order: _days([(a, b, y) for a, _, b, y in hours], order) for order in ORDERS}
    fitting = [order for order in ORDERS if len(days[order]) == max(map(len, days.values()))]
    if DAY_FIRST in fitting and any(mark == '.' for _, mark, *_ in hours):
        fitting = [order for order in fitting if order != MONTH_FIRST]  # nobody writes it so with points
    steps = {order: np.diff(days[order]) for order in fitting}
    over = [before[1] in ('23', '11') and after[0] in ('00', '0', '12') for before, after in pairwise(hours.values())]
    # four dates or more that follow one another are no months
    over = over if any(over) else [len(over) > 2] * len(over)
    for is_likely in (
        lambda each: np.all(each < LONGEST_PAUSE),
        lambda each: each.size == len(over) and np.all(each[over] == 1) and any(over),
        lambda each: np.all(each > 0),
    ):
        fitting = [order for order in fitting if is_likely(steps[order])] or fitting
    if {DAY_FIRST, MONTH_FIRST} <= {*fitting} and not np.array_equal(steps[DAY_FIRST], steps[MONTH_FIRST]):
        spans = [' to '.join(f'{date.fromordinal(days[order][at]):%d %b %Y}' for at in (0, -1)) for order in ORDERS[:2]]
        raise InputError(
            f'its dates may run from {" or from ".join(spans)}: write the year first, as in 2026-11-05', OPEN_DATES
        )
    return fitting[0]


def _days(found: Sequence[Sequence[str]], order: str) -> list[int]:
    """The numbers of the days, those left out that do not exist in this order."""
    days = []
    for said in found:
        with suppress(ValueError):
            days.append(date(*_in_order(said, order)).toordinal())
    return days


def _whole_year(year: str) -> int:
    return int(year) + 2000 * (len(year) == 2)


def plain_letters(text: str) -> str:
    """A text in lower case and without accents."""
    return re.sub('[\u0300-\u036f]', '', unicodedata.normalize('NFKD', text.lower().replace('ß', 'ss')))


def numbers_of(values: Any) -> np.ndarray:
    """Values of any kind as float64, dates as seconds since 1970; NaN for anything else."""
    array = np.asarray(values)
    if array.dtype.kind in 'Mm':
        whole = array.astype(f'{array.dtype.kind}8[ns]').astype(np.int64) / 1e9
        return np.where(np.isnat(array), np.nan, whole)
    if array.dtype.kind in 'biuf':
        return array.astype(float)
    cells = [cell.translate(OTHER_MARKS) if isinstance(cell, str) else cell for cell in array.tolist()]
    marks = marks_of([cell for cell in cells if isinstance(cell, str) and kind_of_text(cell.strip()) == 'number'])
    order = order_of_dates(cell for cell in cells if isinstance(cell, str))
    return np.array([number_of(cell, *marks, order) for cell in cells], dtype=float)


def marks_of(cells: Sequence[str]) -> tuple[bool, str]:
    """Whether numbers as written have decimal commas, and what stands between their groups of three digits."""
    commas = [cell for cell in cells if ',' in cell]
    if any(re.search(r'\.\d{3},', cell) for cell in commas):
        return True, '.'
    points = any(re.search(r'\.\d', cell) for cell in cells)
    if any('.' in cell for cell in commas) or points and commas and all(THOUSANDS.fullmatch(cell) for cell in commas):
        return False, ','
    # blanks and apostrophes are plain ones by then
    grouped = ("'" if mark[1] in "'\u2019" else ' ' for cell in cells if (mark := GROUPED.search(cell)))
    return bool(commas), next(grouped, '')


def plain_text(text: str, decimal_comma: bool, thousands: str) -> str:
    """A text in which numbers are written with a decimal point and without marks between groups of digits."""
    if thousands:
        text = re.sub(rf'(?<=\d){re.escape(thousands)}(?=\d\d\d(?!\d))', '', text)
    return text.replace(',', '.') if decimal_comma else text


def _since_1970(moment: datetime) -> float:
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def number_of(cell: Any, decimal_comma: bool, thousands: str, order: str) -> float:
    """A number, or a date or a clock time as s, as it is written or stored; NaN where it is none."""
    try:
        if isinstance(cell, datetime):
            return _since_1970(cell)
        if isinstance(cell, time):
            cell = datetime.combine(datetime.min, cell) - datetime.min
        if isinstance(cell, timedelta):
            return cell.total_seconds()
        if isinstance(cell, str):
            return seconds_of_text(plain_text(cell, decimal_comma, thousands), order)
        return float(cell)
    except (TypeError, ValueError):
        return np.nan
