"""filterpy's extended Kalman filter without scipy.stats, which it loads for a likelihood that nobody here asks for.

With it a start takes half a second of processor time more, and each process that forecasts 30 MB.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

__all__ = ['ExtendedKalmanFilter']

STATISTICS = 'filterpy.stats'


def log_density(*arguments: Any, **named: Any) -> float:
    """All that filterpy's filters take from its statistics, which are loaded now."""
    return import_module(STATISTICS).logpdf(*arguments, **named)


_stand_in: Any = ModuleType(STATISTICS)
_stand_in.logpdf = log_density
_is_first = sys.modules.setdefault(STATISTICS, _stand_in) is _stand_in
try:
    from filterpy.kalman import ExtendedKalmanFilter
finally:
    if _is_first:
        del sys.modules[STATISTICS]
