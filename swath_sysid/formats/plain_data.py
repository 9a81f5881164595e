"""Plain data: what JSON and YAML can hold."""

import math
from typing import Any

import numpy as np


def finite_or_none(value: Any) -> Any:
    """The same data with lists for arrays and tuples, and None for numbers that are not finite."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, dict):
        return {key: finite_or_none(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_none(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
