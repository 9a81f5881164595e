"""filterpy's extended Kalman filter without two parts of scipy.

Its statistics, for a likelihood that nobody asks for, would take half a second and 30 MB at a start, and its inverse
takes a quarter of an update.
"""

import sys
from importlib import import_module
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

__all__ = ['ExtendedKalmanFilter']

STATISTICS = 'filterpy.stats'


def log_density(*arguments: Any, **named: Any) -> float:
    """All that filterpy's filters take from its statistics, which are loaded now."""
    return import_module(STATISTICS).logpdf(*arguments, **named)


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Of the covariance (n, n) of measurements, as numpy's; of two in closed form."""
    if len(matrix) == 2:
        a, b, c, d = matrix.ravel().tolist()
        if determinant := a * d - b * c:
            return np.array([[d, -b], [-c, a]]) / determinant
    return np.linalg.inv(matrix)


_stand_in: Any = ModuleType(STATISTICS)
_stand_in.logpdf = log_density
_is_first = sys.modules.setdefault(STATISTICS, _stand_in) is _stand_in
try:
    from filterpy.kalman import ExtendedKalmanFilter
finally:
    if _is_first:
        del sys.modules[STATISTICS]
_filter: Any = sys.modules[ExtendedKalmanFilter.__module__]
_filter.linalg = SimpleNamespace(inv=inverse)
