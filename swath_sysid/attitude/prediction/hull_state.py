"""The state of a hull's filter: places and bounds, without the filter, whose libraries only forecasts need."""

import math

from swath_sysid.attitude.hull.terms import TERM_NAMES

ANGLE, RATE, TRIM, RATIOS = range(4)  #: Places in the state; the last of the first ratio.
HULL_STATES = RATIOS + len(TERM_NAMES)  #: Place of the moment's first state.
OF_HULL = slice(TRIM, HULL_STATES)  #: Trim and ratios.
LARGEST_JUMP = 33.0  #: Over the unknown moment's size at the start: largest moment, and change between two samples.

LARGEST_ANGLE_VARIANCE = math.pi**2
LARGEST_RATE_VARIANCE = 100.0  #: Bounds the variance where the angle is not observed.
LONGEST_STEP = 0.05  #: s; of a prediction.
