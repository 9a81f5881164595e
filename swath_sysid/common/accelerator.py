"""The optional accelerator: numba where it is installed and can be loaded, plain Python where not.

A process that computes compiles a kernel at its first call. A process that has to answer at once runs the same source
uncompiled until `load_kernels` has found the kernels in the cache, and never compiles.
"""

import os
import threading
from collections.abc import Callable, Sequence
from functools import cache, cached_property, update_wrapper
from importlib.util import find_spec
from typing import Any, TypeVar, cast

from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError

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
_names: set[str] = set()  #: Of all accelerated functions of the loaded modules.
_at_hand: set[str] = set()  #: Of those that were found in the cache, or compiled.


class _NotCachedError(Exception):
    """The cache lacks a kernel that this process must not compile."""


class _AtOnce:
    """Whether this process has to answer at once, and how far its kernels are loaded."""

    is_wanted = False
    has_loaded = False
    loader: int | None = None  #: The thread that loads them.

    @classmethod
    def is_loading_here(cls) -> bool:
        """Whether this thread loads kernels."""
        return threading.get_ident() == cls.loader


def answer_at_once(is_wanted: bool = True) -> None:
    """Have this process run kernels uncompiled until `load_kernels` has succeeded, and compile none; or no longer."""
    _AtOnce.is_wanted, _AtOnce.has_loaded = is_wanted, False


def load_kernels(use: Callable[[], None]) -> bool:
    """Load the kernels that a function calls and use them from now on, unless the cache lacks one; whether they are."""
    _AtOnce.loader = threading.get_ident()
    try:
        use()
    except _NotCachedError:
        return False
    finally:
        _AtOnce.loader = None
    _AtOnce.has_loaded = True
    return True


def compile_kernels(
    uses: Sequence[Callable[[], None]],
    progress: Callable[[float], None] = lambda share: None,
    should_cancel: Callable[[], bool] = lambda: False,
) -> None:
    """Compile the kernels that some functions call into the cache, unless they are there.

    Raises:
        InputError: numba cannot be used or the cache cannot be written, and what to do: nothing has been compiled.
    """
    if not has_numba():
        why = why_slower()
        raise InputError(why.message if why else 'numba is not installed: pip install "swath_sysid[fast]"')
    from swath_sysid.common.kernel_cache import check_writable

    check_writable()
    _reports.append(lambda: progress(len(_at_hand) / len(_names)))
    for use in uses:
        if should_cancel():
            raise Cancelled
        use()
    progress(1.0)


_reports: list[Callable[[], None]] = []  #: Called whenever another kernel is at hand.


def _note_at_hand(name: str) -> None:
    _at_hand.add(name)
    for report in _reports:
        report()


def _note_lacking(name: str) -> None:
    """A kernel is to be compiled: an error where this process compiles none."""
    if _AtOnce.is_wanted:
        raise _NotCachedError(name)


def _cached(dispatcher: Any) -> Any:
    """A dispatcher of numba that keeps what it compiles, where it can."""
    try:
        from swath_sysid.common.kernel_cache import KernelCache

        dispatcher._cache = KernelCache(dispatcher.py_func, _cache_failures.append, _note_at_hand, _note_lacking)
    except (ImportError, AttributeError, RuntimeError, OSError) as error:
        # a numba whose cache is another, or no home folder
        _cache_failures.append(str(error))
    return dispatcher


class _Compiled:
    """A function that numba compiles at its first call: loading numba alone takes as long as loading numpy."""

    def __init__(self, function: Callable, otherwise: Callable) -> None:
        self._function, self._otherwise = function, otherwise
        update_wrapper(self, function)
        _names.add(function.__qualname__)

    @cached_property
    def _dispatcher(self) -> Any:
        numba = compiler()
        return (
            self._otherwise
            if numba is None
            else _cached(numba.njit(error_model='numpy', no_cfunc_wrapper=True)(self._function))
        )

    @property
    def _numba_type_(self) -> Any:
        # by this name numba finds what a compiled function calls
        return self._dispatcher._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        if _AtOnce.is_wanted and not (_AtOnce.has_loaded or _AtOnce.is_loading_here()):
            return self._otherwise(*arguments)
        try:
            return self._dispatcher(*arguments)
        except _NotCachedError:
            if _AtOnce.is_loading_here():
                raise
            # from now on, for arguments of types that nobody has compiled it for
            self._dispatcher = self._otherwise
            return self._otherwise(*arguments)
        except SystemError as error:
            _pass_on_interrupt(error)
            raise


def accelerated(function: Function, otherwise: Function | None = None) -> Function:
    """Compile with numba (extra ``fast``) at the first call; without numba, the function itself or ``otherwise``."""
    plain = function if otherwise is None else otherwise
    return cast(Function, _Compiled(function, plain)) if _IS_INSTALLED and _IS_WANTED else plain
