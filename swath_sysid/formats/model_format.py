"""What the model files of both wings share: a head, quantities with units and deviations, and their covariance."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats import schema
from swath_sysid.formats.files import shown, write_text

VERSION = 1
ROUNDING = 1e-6  #: Relative difference of what should be equal, and negative eigenvalue of a correlation, by rounding.


@dataclass(frozen=True)
class ModelFormat:
    """A format of model files: YAML that says its format, version and frame, and is checked on reading and writing."""

    format: str
    frame: str
    fields: Any  #: The dataclass of the other fields.
    remedy: str  #: What to do about a file of another kind or version.
    kind: str = 'model file'  #: What errors call such a file.

    def content(self, text: str, source: str) -> Any:
        """The checked fields of a text."""
        content = schema.plain_content(text, source)
        if not isinstance(content, dict) or content.get('format') != self.format:
            raise InputError(f"{source} is not a {self.kind}: its field 'format' is not '{self.format}'; {self.remedy}")
        version = content.pop('version', None)
        # to Python True is 1
        if version != VERSION or type(version) is not int:
            raise InputError(f'{source} is a {self.kind} of version {shown(version)}, not {VERSION}: {self.remedy}')
        frame = content.pop('frame', None)
        if frame != self.frame:
            raise InputError(f"{source}, frame: '{shown(frame)}' must be '{self.frame}'")
        del content['format']
        return schema.record(self.fields)(content, source)

    def text(self, fields: Any) -> str:
        """The text of a file that holds these fields; those that are None are left out."""
        plain = asdict(fields, dict_factory=lambda items: {name: value for name, value in items if value is not None})
        return schema.dumped({'format': self.format, 'version': VERSION, 'frame': self.frame, **plain})

    def write(self, path: str | Path, text: str, read_text: Callable[[str, str], Any]) -> None:
        """Write a file, whole or not at all, and not what its readers would refuse."""
        read_text(text, f'{path} is not written: what it would hold')
        write_text(path, text)


@dataclass(frozen=True)
class Stated:
    """A value with its standard deviation and its unit."""

    value: float
    std: Annotated[float, schema.if_known(schema.number(lowest=0.0))]
    unit: str


def stated_of(units: Mapping[str, str], kind: str) -> schema.Check:
    """Values with standard deviation and the unit of each name there is, by name; errors call a name by its kind."""
    return schema.table_of(
        {name: schema.record(Stated, unit=schema.one_of((unit,))) for name, unit in units.items()}, kind
    )


def metrics(value: Any, where: str) -> dict:
    """How well a model fits: numbers, texts or null by name, also by name of a name."""
    for name, item in schema.mapping(value, where).items():
        place = f'{where}, {shown(name)}'
        if isinstance(item, dict):
            metrics(item, place)
        elif isinstance(item, list):
            raise InputError(f"{place}: '{shown(item)}' is not a number")
        elif isinstance(item, str):
            schema.text()(item, place)
    return value


def covariance(rows: Any, names: Sequence[str], stated: Mapping[str, Stated], where: str) -> np.ndarray:
    """The covariance (n, n) of named quantities, with the deviations stated; null, not known, becomes NaN."""
    size, place = len(names), f'{where}, covariance'
    if not isinstance(rows, list) or [len(row) if isinstance(row, list) else -1 for row in rows] != [size] * size:
        raise InputError(f'{place}: {size} quantities need {size} rows of {size} numbers')
    found = schema.list_of(schema.list_of(schema.if_known(schema.number())), build=np.array)(rows, place).reshape(
        size, size
    )
    unknown = np.isnan(np.diag(found))
    if not np.array_equal(np.isnan(found), unknown[:, None] | unknown):
        raise InputError(f'{place}: null must fill the row and the column of a quantity that is not known')
    _check_positive(found[np.ix_(~unknown, ~unknown)], place)
    for name, variance in zip(names, np.diag(found).tolist(), strict=True):
        # the current has no std of its own in the file
        if name in stated and not np.isclose(stated[name].std, math.sqrt(variance), ROUNDING, 0.0, equal_nan=True):
            raise InputError(f'{where}, {name}: std {stated[name].std:g} is not that of the covariance')
    return found


def _check_positive(matrix: np.ndarray, where: str) -> None:
    if (np.diag(matrix) < 0.0).any():
        raise InputError(f'{where}: a variance is not negative, as {np.diag(matrix).min():g} is')
    std = np.sqrt(np.diag(matrix))
    limits = np.outer(std, std) * (1.0 + ROUNDING)
    # first each alone, so that the division below cannot overflow
    if (np.abs(matrix) > limits).any():
        raise InputError(f'{where}: a correlation is larger than one: this is not a covariance matrix')
    correlation = np.divide(matrix, limits, out=np.zeros_like(matrix), where=limits > 0.0)
    if np.abs(correlation - correlation.T).max(initial=0.0) > ROUNDING:
        raise InputError(f'{where}: it is not symmetric, so it is not a covariance matrix')
    if matrix.size and np.linalg.eigvalsh(0.5 * (correlation + correlation.T))[0] < -ROUNDING * len(matrix):
        raise InputError(f'{where}: some combination has a negative variance: this is not a covariance matrix')
