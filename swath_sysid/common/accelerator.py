"""The optional accelerator: numba where it is installed, plain Python where it is not."""

from collections.abc import Callable
from typing import Any, TypeVar

numba: Any
try:
    import numba
except ImportError:
    numba = None

Function = TypeVar('Function', bound=Callable)

HAS_NUMBA = numba is not None and not numba.config.DISABLE_JIT
"""Whether `accelerated` compiles."""


def accelerated(function: Function) -> Function:
    """Compile with numba (extra ``fast``) or, without it, return the function itself.

    The same source runs either way; ``test_hull_simulation`` holds both to the same numbers.
    """
    return numba.njit(cache=True)(function) if HAS_NUMBA else function
