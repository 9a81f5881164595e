"""A comparison of forecasts as a script: flags are what its function takes, lines are printed or told as JSON."""

import json
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from inspect import Parameter, signature
from typing import Annotated, Any, NamedTuple, Self, get_args, get_origin

import numpy as np

from swath_sysid.common.plain import finite_or_none

HALF_90 = 1.645  #: Standard deviations from the mean to either end of the 90 % interval.


class Line(NamedTuple):
    """One line of a table."""

    label: str
    groups: Mapping[str, Iterable[float]]  #: Figures by what they are, as the heading says.
    form: str = '5.2f'

    def __str__(self) -> str:
        figures = (' '.join(format(value, self.form) for value in values) for values in self.groups.values())
        return ' | '.join([self.label, *figures])


@dataclass(frozen=True)
class LeadErrors:
    """Errors of forecasts and the standard deviations issued with them, (N, L), at ages (N,); NaN where none came."""

    age: np.ndarray
    error: np.ndarray
    deviation: np.ndarray

    @classmethod
    def joined(cls, parts: Iterable[Sequence[np.ndarray]]) -> Self:
        """Those of several runs."""
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def within(self, begin: float, end: float) -> Self:
        """Those of an age from ``begin`` until before ``end``."""
        now = (self.age >= begin) & (self.age < end)
        return type(self)(self.age[now], self.error[now], self.deviation[now])

    @property
    def rms(self) -> np.ndarray:
        """Root mean square error, (L,)."""
        return np.sqrt(np.nanmean(self.error**2, axis=0))

    @property
    def held(self) -> np.ndarray:
        """Coverage of the 90 % intervals, (L,)."""
        known = np.where(np.isfinite(self.error), np.abs(self.error) < HALF_90 * self.deviation, np.nan)
        return np.nanmean(known, axis=0)


class Benchmark(NamedTuple):
    """A script's text of help, and the function that makes its lines.

    What the function takes by place are arguments of the command line, its keywords are flags: a tuple takes several
    values, ``Annotated[str, CHOICES, 'its help']`` has choices or a help. What it returns is the exit code.
    """

    doc: str | None
    lines: Callable[..., Generator[Line | str, None, int | None]]

    def run(self, words: Sequence[str] | None = None) -> int:
        """Print the lines as they come; returns the exit code."""
        given = vars(self._parser().parse_args(words))
        shown, made = _as_json if given.pop('json') else str, self.lines(*given.pop('places', ()), **given)
        while True:
            try:
                line = next(made)
            except StopIteration as end:
                return end.value or 0
            print(shown(line), flush=True)

    def _parser(self) -> ArgumentParser:
        parser = ArgumentParser(description=self.doc, formatter_class=RawDescriptionHelpFormatter)
        parser.add_argument('--json', action='store_true', help='print one JSON object for each line')
        for name, taken in signature(self.lines).parameters.items():
            said = get_args(taken.annotation)[1:] if get_origin(taken.annotation) is Annotated else ()
            choices = next((each for each in said if not isinstance(each, str)), None)
            entry: dict[str, Any] = {'help': next((each for each in said if isinstance(each, str)), None)}
            flag, default = f'--{name.replace("_", "-")}', taken.default
            if taken.kind is Parameter.VAR_POSITIONAL:
                # none given is compared with the choices as well
                parser.add_argument('places', nargs='*', metavar=name.upper(), choices=[[], *(choices or ())], **entry)
            elif default is False:
                parser.add_argument(flag, action='store_true', **entry)
            else:
                several = isinstance(default, tuple)
                entry |= {'type': type(default[0] if several else default), 'nargs': '+' if several else None}
                parser.add_argument(flag, default=default, choices=choices, **entry)
        return parser


def _as_json(line: Line | str) -> str:
    """A line as an object; a heading or a remark has a text alone."""
    return json.dumps(
        {'text': line.strip()} if isinstance(line, str) else {'label': line.label, **finite_or_none(dict(line.groups))}
    )
