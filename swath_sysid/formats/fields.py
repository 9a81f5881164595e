"""Checks of plain values from files: functions of a value and its place that return what to use, or raise an error."""

import difflib
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import write_text
from swath_sysid.formats.untrusted_yaml import dumped, plain_content, shown, text_of

Built = TypeVar('Built')
Check = Callable[[Any, str], Any]  #: Of a value and its place in the file.

LONGEST_TEXT = 200
LONGEST_WORD = 40  #: Characters of a name that are compared with the known ones.
PSD_ROUNDING = 1e-6  #: Negative eigenvalue of a correlation matrix that is rounding.
STD_ROUNDING = 1e-6  #: Relative difference of a standard deviation and its variance that is rounding.


def within(where: str, name: str) -> str:
    """Where an item of a mapping or list stands."""
    return f'{where}, {shown(name)}' if where else shown(name)


def refused(where: str, problem: str) -> InputError:
    """What is wrong with the value that stands there."""
    return InputError(f'{where}{problem}' if where else problem.lstrip(': '))


def number(lowest: float = -math.inf, highest: float = math.inf, above: float | None = None) -> Check:
    """A finite number, within limits, as float."""

    def check(value: Any, where: str) -> Any:
        # a bool is an int to Python
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise refused(where, f": '{shown(value)}' is not a number")
        if above is not None and not value > above:
            raise refused(where, f' must be greater than {above:g}, not {shown(value)}')
        if not lowest <= value <= highest:
            if lowest == -math.inf:
                raise refused(where, f' must be at most {highest:g}, not {shown(value)}')
            raise refused(where, f' must lie within {lowest:g} and {highest:g}, not {shown(value)}')
        return float(value)

    return check


def text(longest: int = LONGEST_TEXT) -> Check:
    """A text on one line that is not too long."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, str):
            raise refused(where, f": '{shown(value)}' is not text: write it in quotes")
        if len(value) > longest or not value.isprintable():
            raise refused(where, f": '{shown(value)}' is not a name: at most {longest} characters on one line")
        return value

    return check


def one_of(choices: Collection[str], kind: str | None = None) -> Check:
    """One of some texts; errors may call them by their kind."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, str) or value not in choices:
            if kind is not None:
                raise refused(where, f": there is no {kind} '{shown(value)}': choose from {', '.join(choices)}")
            allowed = ' or '.join(map(repr, choices)) if len(choices) < 10 else 'one of ' + ', '.join(map(str, choices))
            raise refused(where, f": '{shown(value)}' must be {allowed}")
        return value

    return check


def whole(lowest: int) -> Check:
    """A whole number from a lowest on."""

    def check(value: Any, where: str) -> Any:
        found = number(lowest)(value, where)
        if found != int(found):
            raise refused(where, f' must be a whole number from {lowest}, not {shown(value)}')
        return int(found)

    return check


def one_or_more(description: Check) -> Check:
    """A list of like items, of which a single one may stand alone."""

    def check(value: Any, where: str) -> Any:
        items = value if isinstance(value, list) else [value]
        if not items or isinstance(value, dict):
            raise refused(where, f": '{shown(value)}' must be a list of names")
        return list_of(description)(items, where)

    return check


def anything(value: Any, where: object) -> Any:
    """Whatever it is; checked elsewhere."""
    return value


def if_known(description: Check, unknown: Any = math.nan) -> Check:
    """What a description says, or null for what is not known."""

    def check(value: Any, where: str) -> Any:
        return unknown if value is None else description(value, where)

    return check


def list_of(description: Check, length: int | None = None) -> Check:
    """A list of like items, as list."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, list) or length not in (None, len(value)):
            counted = '' if length is None else f' of {length} items'
            raise refused(where, f": '{shown(value)}' must be a list{counted}")
        return [description(item, within(where, f'{k}')) for k, item in enumerate(value, 1)]

    return check


def record(required: Mapping[str, Check], optional: Mapping[str, Check] | None = None) -> Check:
    """Named fields, each with its description by name; all those required, and none else but those optional."""
    optional = optional or {}
    known = {**required, **optional}

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, dict):
            raise refused(where, f": '{shown(value)}' must be names and values; fields are {', '.join(known)}")
        found = {}
        for name, item in value.items():
            if name not in known:
                close = difflib.get_close_matches(name[:LONGEST_WORD], known, 1)
                meant = f" '{close[0]}' is meant?" if close else ''
                raise refused(where, f": unknown field '{shown(name)}';{meant} fields are {', '.join(known)}")
            found[name] = known[name](item, within(where, name))
        for name in required:
            if name not in value:
                raise refused(where, f": the field '{name}' is missing")
        return found

    return check


def table_of(names: Collection[str], kind: str, description: Check | dict[str, Check]) -> Check:
    """Some of the names of a kind, with one check for all or one per name; a dict in the order given."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, dict):
            raise refused(where, f": '{shown(value)}' must map names to values")
        found = {}
        for name, item in value.items():
            if name not in names:
                raise refused(where, f": there is no {kind} '{shown(name)}'; choose from {', '.join(names)}")
            one = description[name] if isinstance(description, dict) else description
            found[name] = one(item, within(where, name))
        return found

    return check


def quantities_of(units: Mapping[str, str], kind: str) -> Check:
    """Values with standard deviation and the unit of each name there is, by name; errors call a name by its kind."""
    return table_of(
        units,
        kind,
        {
            name: record({'value': number(), 'std': if_known(number(lowest=0.0)), 'unit': one_of((unit,))})
            for name, unit in units.items()
        },
    )


def mapping(value: Any, where: str) -> dict:
    """Anything by name; what it holds is plain data already."""
    if not isinstance(value, dict):
        raise refused(where, f": '{shown(value)}' must map names to values")
    return value


def metrics(value: Any, where: str) -> dict:
    """How well a model fits: numbers, texts or null by name, also by name of a name."""
    for name, item in mapping(value, where).items():
        if isinstance(item, dict):
            metrics(item, f'{where}, {shown(name)}')
        elif isinstance(item, list):
            raise refused(f'{where}, {shown(name)}', f": '{shown(item)}' is not a number")
        elif isinstance(item, str):
            text()(item, f'{where}, {shown(name)}')
    return value


@dataclass(frozen=True)
class ModelFormat:
    """A format of model files: YAML that says its format, version and frame, and is checked on reading and writing."""

    format: str
    frame: str
    remedy: str  #: What to do about a file of another kind or version.
    required: dict  #: The other fields, by name; see `record`.
    optional: dict
    version: int = 1
    kind: str = 'model file'  #: What errors call such a file.

    def content(self, text: str, source: str) -> dict:
        """The checked fields of a text, by name."""
        content = plain_content(text, source)
        if not isinstance(content, dict) or content.get('format') != self.format:
            raise InputError(f"{source} is not a {self.kind}: its field 'format' is not '{self.format}'; {self.remedy}")
        version = content.get('version')
        # to Python True is 1
        if version != self.version or not isinstance(version, int) or isinstance(version, bool):
            raise InputError(
                f'{source} is a {self.kind} of version {shown(version)}; this software reads version '
                f'{self.version}: {self.remedy}'
            )
        headed = {'format': anything, 'version': anything, 'frame': one_of((self.frame,))}
        return record(headed | self.required, self.optional)(content, source)

    def text(self, **fields: Any) -> str:
        """The text of a file that holds these fields."""
        return dumped({'format': self.format, 'version': self.version, 'frame': self.frame, **fields})

    def read(self, path: str | Path, read_text: Callable[[str, str], Built]) -> Built:
        """What `read_text`, of a text and its source, makes of a file."""
        return read_text(text_of(path), str(path))

    def write(self, path: str | Path, text: str, read_text: Callable[[str, str], Built]) -> None:
        """Write a file, whole or not at all, and not what its readers would refuse."""
        read_text(text, f'{path} is not written: what it would hold')
        write_text(path, text)


def built(build: Callable[[], Built], where: str) -> Built:
    """What the core makes of it, with the place added to its errors."""
    try:
        return build()
    except InputError as error:
        raise InputError(f'{where}: {error}') from error


def covariance(rows: object, names: Sequence[str], where: str) -> np.ndarray:
    """The covariance of named quantities, shape (n, n): symmetric and positive semidefinite.

    Null fills the row and column of a quantity that is not known; it becomes NaN.
    """
    size = len(names)
    if not isinstance(rows, list) or [len(row) if isinstance(row, list) else -1 for row in rows] != [size] * size:
        raise InputError(f'{where}: {size} quantities need {size} rows of {size} numbers')
    value_of = if_known(number())
    found = np.array(
        [[value_of(v, f'{where}, {names[i]}') for v in row] for i, row in enumerate(rows)], dtype=float
    ).reshape(size, size)
    unknown = np.isnan(np.diag(found))
    if not np.array_equal(np.isnan(found), unknown[:, None] | unknown):
        raise InputError(f'{where}: null must fill the row and the column of a quantity that is not known')
    _check_positive(found[np.ix_(~unknown, ~unknown)], [n for n, u in zip(names, unknown, strict=True) if not u], where)
    return found


def _check_positive(matrix: np.ndarray, names: Sequence[str], where: str) -> None:
    variances = np.diag(matrix)
    for name, variance in zip(names, variances.tolist(), strict=True):
        if variance < 0.0:
            raise InputError(f'{where}, {name}: a variance is not negative, as {variance:g} is')
    std = np.sqrt(variances)
    limits = np.outer(std, std) * (1.0 + PSD_ROUNDING)
    # first each alone, so that the division below cannot overflow
    if (np.abs(matrix) > limits).any():
        raise InputError(f'{where}: a correlation is larger than one: this is not a covariance matrix')
    correlation = np.divide(matrix, limits, out=np.zeros_like(matrix), where=limits > 0.0)
    if np.abs(correlation - correlation.T).max(initial=0.0) > PSD_ROUNDING:
        raise InputError(f'{where}: it is not symmetric, so it is not a covariance matrix')
    if matrix.size and np.linalg.eigvalsh(0.5 * (correlation + correlation.T))[0] < -PSD_ROUNDING * len(names):
        raise InputError(f'{where}: some combination has a negative variance: this is not a covariance matrix')


def check_std(stated: Mapping[str, float], variances: np.ndarray, where: str) -> None:
    """Refuse standard deviations that contradict the diagonal of their covariance, in one order; NaN: not known."""
    for (name, std), variance in zip(stated.items(), variances.tolist(), strict=True):
        expected = math.sqrt(variance) if variance == variance else math.nan
        if not (math.isclose(std, expected, rel_tol=STD_ROUNDING) or std != std and expected != expected):
            raise InputError(f'{where}, {name}: its std {std:g} is not that of the covariance, {expected:g}')
