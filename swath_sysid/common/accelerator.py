"""The optional accelerator: numba where it is installed and can be loaded, plain Python where not."""

import os
from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from importlib.util import find_spec
from typing import Any, TypeVar, cast

from swath_sysid.common.advice import Advice

Function = TypeVar('Function', bound=Callable)

_IS_INSTALLED = find_spec('numba') is not None
_IS_WANTED = os.environ.get('NUMBA_DISABLE_JIT', '0') in ('', '0')


def compiler() -> Any:
    """The module numba, loaded now; None where it is not installed, not wanted, or cannot be loaded."""
    return _loaded()[0]


def has_numba() -> bool:
    """Whether `accelerated` compiles; loads numba."""
    return compiler() is not None


def why_slower() -> Advice | None:
    """Why fits take longer than they could with numba, which is loaded, or why the start did, if kernels have run; None
    also where numba is not installed.
    """
    if _IS_INSTALLED and not _IS_WANTED:
        return Advice.of('numba-disabled')
    error = _loaded()[1]
    return why_uncached() if error is None else Advice.of('numba-fails', error=error)


def why_uncached() -> Advice | None:
    """Why kernels that have run had to be compiled although a cache is kept, if so; loads nothing."""
    return Advice.of('kernels-uncached', error=_cache_failures[0]) if _cache_failures else None


@cache
def _loaded() -> tuple[Any, str | None]:
    """The module, and what kept it from being loaded."""
    if not (_IS_INSTALLED and _IS_WANTED):
        return None, None
    try:
        import numba
    except (ImportError, AttributeError, TypeError, ValueError, RuntimeError, SystemError, OSError) as error:
        # all that mismatched versions of numpy or llvmlite have led to
        _pass_on_interrupt(error)
        return None, ' '.join(str(error).split()) or type(error).__name__
    return numba, None


def _pass_on_interrupt(error: BaseException) -> None:
    """Raise the KeyboardInterrupt that an error hides: extensions go on after it and fail at their next step."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        cause = cause.__cause__


_cache_failures: list[str] = []


def _cached(dispatcher: Any) -> Any:
    """A dispatcher of numba that keeps what it compiles, where it can."""
    try:
        from swath_sysid.common.kernel_cache import KernelCache

        dispatcher._cache = KernelCache(dispatcher.py_func, _cache_failures.append)
    except (ImportError, AttributeError, RuntimeError, OSError) as error:
        # a numba whose cache is another, or no home folder
        _cache_failures.append(str(error))
    return dispatcher


class _Compiled:
    """A function that numba compiles at its first call: loading numba alone takes as long as loading numpy."""

    def __init__(self, function: Callable, otherwise: Callable) -> None:
        self._function, self._otherwise = function, otherwise
        update_wrapper(self, function)

    @cached_property
    def _dispatcher(self) -> Any:
        numba = compiler()
        return self._otherwise if numba is None else _cached(numba.njit(error_model='numpy')(self._function))

    @property
    def _numba_type_(self) -> Any:
        # by this name numba finds what a compiled function calls
        return self._dispatcher._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        try:
            return self._dispatcher(*arguments)
        except SystemError as error:
            _pass_on_interrupt(error)
            raise


def accelerated(function: Function, otherwise: Function | None = None) -> Function:
    """Compile with numba (extra ``fast``) at the first call; without numba, the function itself or ``otherwise``."""
    plain = function if otherwise is None else otherwise
    return cast(Function, _Compiled(function, plain)) if _IS_INSTALLED and _IS_WANTED else plain
