"""Descriptions of what a file may hold: each checks a plain value and names the field that is wrong.

A description is a function of a value and of where it stands, for the errors; it returns the value
as it is used from then on, or raises `InputError`.
"""

import math

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.untrusted_yaml import shown

LONGEST_TEXT = 200
PSD_ROUNDING = 1e-6
"""Least eigenvalue of a correlation matrix below zero that is rounding, not a mistake."""

STD_ROUNDING = 1e-6
"""Relative difference of a standard deviation from the root of its variance that is rounding."""


def number(lowest=-math.inf, highest=math.inf, above=None):
    """A finite number, within limits, as float."""

    def check(value, where):
        # a bool is an int to Python
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{where}: '{shown(value)}' is not a number")
        if above is not None and not value > above:
            raise InputError(f'{where} must be greater than {above:g}, not {shown(value)}')
        if not lowest <= value <= highest:
            raise InputError(f'{where} must lie within {lowest:g} and {highest:g}, not {shown(value)}')
        return float(value)

    return check


def text(longest=LONGEST_TEXT):
    """A text on one line that is not too long."""

    def check(value, where):
        if not isinstance(value, str):
            raise InputError(f"{where}: '{shown(value)}' is no text")
        if len(value) > longest or not value.isprintable():
            raise InputError(f"{where}: '{shown(value)}' is no name: at most {longest} characters on one line")
        return value

    return check


def one_of(choices):
    """One of some texts."""

    def check(value, where):
        if not isinstance(value, str) or value not in choices:
            raise InputError(f"{where}: '{shown(value)}' must be {' or '.join(map(repr, choices))}")
        return value

    return check


def if_known(description, unknown=math.nan):
    """What a description says, or null for what is not known."""

    def check(value, where):
        return unknown if value is None else description(value, where)

    return check


def list_of(description, length=None):
    """A list of like items, as list."""

    def check(value, where):
        if not isinstance(value, list) or length not in (None, len(value)):
            counted = '' if length is None else f' of {length} items'
            raise InputError(f"{where}: '{shown(value)}' must be a list{counted}")
        return [description(item, f'{where} {number}') for number, item in enumerate(value, 1)]

    return check


def record(required, optional=None):
    """Named fields, each with its description; all those required, and none else.

    Parameters
    ----------
    required, optional : dict of str to callable
    """
    optional = optional or {}
    known = {**required, **optional}

    def check(value, where):
        if not isinstance(value, dict):
            raise InputError(f"{where}: '{shown(value)}' must have the fields {', '.join(required)}")
        for name in value:
            if name not in known:
                raise InputError(f"{where}: unknown field '{shown(name)}'; fields are {', '.join(known)}")
        for name in required:
            if name not in value:
                raise InputError(f"{where}: the field '{name}' is missing")
        return {name: known[name](item, f'{where}, {name}') for name, item in value.items()}

    return check


def table_of(names, kind, description):
    """Some of the names of a kind, each with the same description; a dict in the order given.

    Parameters
    ----------
    names : collection of str
    kind : str
        What a name stands for, in the errors.
    description : callable, or dict of str to callable
        One for all, or one a name.
    """

    def check(value, where):
        if not isinstance(value, dict):
            raise InputError(f"{where}: '{shown(value)}' must map names to values")
        found = {}
        for name, item in value.items():
            if name not in names:
                raise InputError(f"{where}: there is no {kind} '{shown(name)}'; choose from {', '.join(names)}")
            one = description[name] if isinstance(description, dict) else description
            found[name] = one(item, f'{where}, {name}')
        return found

    return check


def mapping(value, where):
    """Anything by name; what it holds is plain data already."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: '{shown(value)}' must map names to values")
    return value


def metrics(value, where):
    """How well a model fits: numbers, texts or null by name, also by name of a name."""
    for name, item in mapping(value, where).items():
        if isinstance(item, dict):
            metrics(item, f'{where}, {shown(name)}')
        elif isinstance(item, list):
            raise InputError(f"{where}, {shown(name)}: '{shown(item)}' is not a number")
        elif isinstance(item, str):
            text()(item, f'{where}, {shown(name)}')
    return value


def covariance(rows, names, where):
    """The covariance of some quantities: finite, symmetric, positive semidefinite.

    Parameters
    ----------
    rows : object
        As the file has it. A quantity whose variance is not known has nothing but null in its row
        and column.
    names : sequence of str
    where : str

    Returns
    -------
    ndarray, shape (n, n)
        NaN where not known.

    Raises
    ------
    InputError
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


def _check_positive(matrix, names, where):
    variances = np.diag(matrix)
    for name, variance in zip(names, variances.tolist(), strict=True):
        if variance < 0.0:
            raise InputError(f'{where}, {name}: a variance is not negative, as {variance:g} is')
    std = np.sqrt(variances)
    limits = np.outer(std, std) * (1.0 + PSD_ROUNDING)
    # first each alone, so that the division below cannot overflow
    if (np.abs(matrix) > limits).any():
        raise InputError(f'{where}: a correlation is larger than one: it is no covariance')
    correlation = np.divide(matrix, limits, out=np.zeros_like(matrix), where=limits > 0.0)
    if np.abs(correlation - correlation.T).max(initial=0.0) > PSD_ROUNDING:
        raise InputError(f'{where}: it is not symmetric: it is no covariance')
    if matrix.size and np.linalg.eigvalsh(0.5 * (correlation + correlation.T))[0] < -PSD_ROUNDING * len(names):
        raise InputError(f'{where}: some combination has a negative variance: it is no covariance')


def check_std(told, variances, where):
    """Refuse standard deviations that contradict their covariance.

    Parameters
    ----------
    told : dict of str to float
        NaN where not known.
    variances : ndarray, shape (n,)
    where : str

    Raises
    ------
    InputError
    """
    for (name, std), variance in zip(told.items(), variances.tolist(), strict=True):
        expected = math.sqrt(variance) if variance == variance else math.nan
        if not (math.isclose(std, expected, rel_tol=STD_ROUNDING) or std != std and expected != expected):
            raise InputError(f'{where}, {name}: its std {std:g} is not that of the covariance, {expected:g}')
