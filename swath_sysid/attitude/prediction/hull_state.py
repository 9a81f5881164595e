"""The state of a hull's filter: places and bounds, without the filter, whose libraries only forecasts need."""

import math

from swath_sysid.attitude.hull.terms import TERM_NAMES

ANGLE, RATE, TRIM, RATIOS = range(4)  #: Places in the state; the last of the first ratio.
HULL_STATES = RATIOS + len(TERM_NAMES)  #: Place of the moment's first state.
OF_HULL = slice(TRIM, HULL_STATES)  #: Trim and ratios.
USUAL_PERIOD = 3.2  #: s; of a small craft, before its motion is known.
LARGEST_JUMP = 33.0  #: Over the unknown moment's size at the start: largest moment, and change between two samples.

LARGEST_ANGLE_VARIANCE = math.pi**2
LARGEST_RATE_VARIANCE = 100.0  #: Bounds the variance where the angle is not observed.
NOW = 2.0  #: Periods that show what a motion is like now: its amplitude, its activity, its phase.
LONGEST_STEP = 0.05  #: s; of a prediction.
LEAST_SIZE = 1e-4  #: rad and rad/s; a craft that moves less is at rest.
#: Periods; after which sizes are forgotten, of errors as of the motion: a shorter one follows wave groups, in
#: which errors grow less than the motion. A silence as long is bridged, and a new sea shows in as many.
MEMORY_OF_SIZE = 19.0
