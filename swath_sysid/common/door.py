"""Arguments of public names, checked against their annotations when they are given."""

import functools
import inspect
import os
import reprlib
from collections.abc import Callable, Collection, Mapping
from numbers import Integral, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from swath_sysid.common.errors import InputError

_Public = TypeVar('_Public', bound=Callable)
#: Kinds of numbers and texts by annotation: what is taken for one, and its words.
_PLAIN: dict[Any, tuple[Any, str]] = {
    bool: ((bool, np.bool_), 'True or False'),
    int: (Integral, 'a whole number'),
    float: (Real, 'a number'),
    str: (str, 'a text'),
    Path: (os.PathLike, 'a path'),
    np.ndarray: (np.ndarray, 'an array of numbers'),
    NoneType: (NoneType, 'None'),
}
#: Public functions that read what is wanted from a file.
_READERS = {
    'a Trial': 'read_trial',
    'an IdentifiedModel': 'read_model',
    'a ManoeuvringTrial': 'read_manoeuvring_csv',
    'a ManoeuvringModel': 'read_manoeuvring_model',
}


def checked(public: _Public) -> _Public:
    """A public function that rejects arguments of a wrong kind with `InputError`; a class whose constructor does."""
    function: Any = public.__init__ if inspect.isclass(public) else public  # type: ignore[misc]
    signature = inspect.signature(function)

    called = public.__name__ if inspect.isclass(public) else public.__qualname__

    @functools.cache
    def kinds() -> dict[str, Any]:
        hints = get_type_hints(function)
        return {name: hints[name] for name in signature.parameters if name in hints}

    @functools.wraps(function)
    def with_check(*args: Any, **kwargs: Any) -> Any:
        for name, value in signature.bind(*args, **kwargs).arguments.items():
            if name in kinds() and not fits(value, kinds()[name]):
                wanted = f'{called}: {name} must be {in_words(kinds()[name])}, not {_given(value)}'
                raise InputError(wanted + _remedy(value, kinds()[name]))
        return function(*args, **kwargs)

    if not inspect.isclass(public):
        return with_check  # type: ignore[return-value]
    setattr(public, '__init__', with_check)  # noqa: B010 - mypy takes no method for an attribute
    return public


def fits(value: Any, kind: Any) -> bool:
    """Whether a value is one of an annotated kind; what has no check of its own fits."""
    inner, origin = get_args(kind), get_origin(kind)
    if origin in (Union, UnionType):
        return any(fits(value, each) for each in inner)
    if kind is np.ndarray and isinstance(value, list | tuple):
        return all(isinstance(each, Real) or fits(each, kind) for each in value)
    if kind is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype.kind in 'biuf'
    if kind in _PLAIN:
        return isinstance(value, _PLAIN[kind][0]) and (kind is bool or not isinstance(value, bool))
    if origin is Callable:
        return callable(value)
    if not isinstance(origin, type):
        return isinstance(value, kind) if isinstance(kind, type) else True
    if issubclass(origin, Mapping):
        return isinstance(value, Mapping) and all(fits(k, inner[0]) and fits(v, inner[1]) for k, v in value.items())
    if not issubclass(origin, Collection):
        return isinstance(value, origin)
    if not isinstance(value, Collection) or isinstance(value, str | bytes | Mapping):
        return False
    of_each = inner if origin is tuple and inner[-1] is not ... else (inner[0],) * len(value)
    return len(of_each) == len(value) and all(map(fits, value, of_each))


def in_words(kind: Any) -> str:
    """An annotated kind as a sentence has it: ``a Trial or None``."""
    inner, origin = get_args(kind), get_origin(kind)
    if origin in (Union, UnionType):
        words = list(dict.fromkeys(in_words(each) for each in inner if not (each is str and Path in inner)))
        return ' or '.join([', '.join(words[:-1]), words[-1]] if len(words) > 1 else words)
    if kind in _PLAIN:
        return _PLAIN[kind][1]
    if origin is Callable:
        return 'a function'
    if not isinstance(origin, type):
        return _one(kind.__name__) if isinstance(kind, type) else 'anything'
    if issubclass(origin, Mapping):
        return f'a mapping from {in_words(inner[0])} to {in_words(inner[1])}'
    if origin is tuple and inner[-1] is not ...:
        return f'{len(inner)} values, each {in_words(inner[0])}'
    return f'a sequence, each item {in_words(inner[0])}'


def _one(name: str) -> str:
    return f'{"an" if name[0] in "AEIOUaeiou" else "a"} {name}'


def _given(value: Any) -> str:
    """What was given, as a sentence has it."""
    if value is None or isinstance(value, str | Real):
        return reprlib.repr(value)
    held = value.values() if isinstance(value, dict) else value if type(value) in (list, tuple) else ()
    of = ''.join(f' with {_one(type(first).__name__)} in it' for first in [*held][:1])
    return _one(type(value).__name__) + of


def _remedy(value: Any, kind: Any) -> str:
    """What reads the file that was given, or the field of what was given that would fit, as a sentence's end."""
    if isinstance(value, str | os.PathLike):
        return next((f': read it with {reader}' for name, reader in _READERS.items() if name in in_words(kind)), '')
    for name in getattr(value, '__dataclass_fields__', ()):
        field = getattr(value, name, None)
        if type(field).__module__.startswith(__name__.partition('.')[0]) and fits(field, kind):
            return f': give its {name}'
    return ''
