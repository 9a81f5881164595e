"""Dataclasses of numbers, texts and arrays as plain data that JSON holds, and back, exact to the last bit."""

import math
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np


def as_plain(value: Any) -> Any:
    """Dicts, lists, numbers and texts of a dataclass, an array, or containers of them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [as_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: as_plain(item) for name, item in value.items()}
    if is_dataclass(value):
        return {each.name: as_plain(getattr(value, each.name)) for each in fields(value) if each.init}
    return value


def from_plain(kind: Any, plain: Any) -> Any:
    """A value of an annotated type, from what `as_plain` gave, also after a way through JSON."""
    arguments = get_args(kind)
    if plain is None:
        return None
    if get_origin(kind) is UnionType:
        (kind,) = (each for each in arguments if each is not NoneType)
        return from_plain(kind, plain)
    if get_origin(kind) is tuple:
        kinds = arguments[:1] * len(plain) if arguments[-1] is Ellipsis else arguments
        return tuple(map(from_plain, kinds, plain))
    if get_origin(kind) is dict:
        return {name: from_plain(arguments[1], item) for name, item in plain.items()}
    if hasattr(kind, '__dataclass_fields__'):
        hints = get_type_hints(kind)
        return kind(**{name: from_plain(hints[name], item) for name, item in plain.items()})
    return np.array(plain, dtype=float) if kind is np.ndarray else plain


def finite_or_none(value: Any) -> Any:
    """The same data with lists for arrays and tuples, and None for numbers that are not finite."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: finite_or_none(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_none(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
