"""The optional accelerator: numba where it is installed, plain Python where it is not."""

try:
    import numba
except ImportError:
    numba = None

HAS_NUMBA = numba is not None and not numba.config.DISABLE_JIT
"""Whether `accelerated` compiles."""


def accelerated(function):
    """Compile with numba (extra ``fast``) or, without it, return the function itself.

    The same source runs either way; ``test_hull_simulation`` holds both to the same numbers.
    """
    return numba.njit(cache=True)(function) if HAS_NUMBA else function
