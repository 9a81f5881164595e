"""What is meant throughout by chance, by a confident interval, by a verdict, by rounding, and by a history."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

TWO_STD = 2.0  #: Standard deviations within which chance stays in 95 % of cases: the coverage factor k.
THREE_STD = 3.0  #: Standard deviations that chance exceeds in one of 300 cases.
SIGNIFICANT = 4.0  #: Standard deviations beyond which a difference is not chance.
CRITERION_MARGIN = 10.0  #: A difference of twice the log-likelihood that Kass and Raftery (1995) call very strong.
UNCERTAIN = 0.5  #: An error, or a standard deviation, beyond this share of a value makes it uncertain.
CONFIDENCE = 0.95  #: Of the intervals that are stated.

LEVELS = REJECTED, DOUBTFUL, ADEQUATE = 'rejected', 'doubtful', 'adequate'  #: Of verdicts, the worst first.


LOST_SHARE = 0.05  #: Of the rows or values of a record, from which what is lost for one cause makes it no record.
MIN_ROWS = 8  #: Fewer rows than this hold no motion to identify, and are no share of a record.

NEGLIGIBLE = 1e-3  #: A share that is as good as nothing.
ROUNDING = 1e-9  #: What is smaller, in its unit, is zero but for rounding.


def digits(count: int) -> Callable[[Any], str]:
    """A function that shows numbers with this many significant digits, and what is not known as a dash."""

    def show(value: Any) -> str:
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return '-'
        return np.format_float_positional(float(f'{value:.{count}g}'), trim='-')

    return show


def percent(share: float | None, count: int = 3) -> str:
    """A share in percent, with this many digits."""
    return '-' if share is None or math.isnan(share) else f'{digits(count)(100.0 * share)} %'


LONGEST = 20  #: Models, or files of them, that are kept.

#: A day before the last stamp that a message can state: what is forecast beyond must have one too.
LATEST_STAMP_NS = (2**31 - 86_400) * 10**9
