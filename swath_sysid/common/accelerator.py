"""The optional accelerator: numba where it is installed, plain Python where it is not."""

import os
from collections.abc import Callable
from functools import cached_property, update_wrapper
from importlib.util import find_spec
from typing import Any, TypeVar, cast

Function = TypeVar('Function', bound=Callable)

#: Whether `accelerated` compiles.
HAS_NUMBA = find_spec('numba') is not None and os.environ.get('NUMBA_DISABLE_JIT', '0') in ('', '0')


def compiler() -> Any:
    """The module numba, loaded now; None where it is not installed or wanted, or not for this version of numpy."""
    if not HAS_NUMBA:
        return None
    try:
        import numba
    except ImportError:
        return None
    return numba


class _Compiled:
    """A function that numba compiles at its first call: loading numba alone takes as long as loading numpy."""

    def __init__(self, function: Callable) -> None:
        self._function = function
        update_wrapper(self, function)

    @cached_property
    def _dispatcher(self) -> Any:
        numba = compiler()
        return self._function if numba is None else numba.njit(cache=True, error_model='numpy')(self._function)

    @property
    def _numba_type_(self) -> Any:
        # by this name numba finds what a compiled function calls
        return self._dispatcher._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        return self._dispatcher(*arguments)


def accelerated(function: Function) -> Function:
    """Compile with numba (extra ``fast``) at the first call or, without it, return the function itself.

    The same source runs either way, called by position; ``test_hull_simulation`` requires the same results of both.
    """
    return cast(Function, _Compiled(function)) if HAS_NUMBA else function
