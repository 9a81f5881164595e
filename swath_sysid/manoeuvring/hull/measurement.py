"""What sensors record: speeds over ground in a current, a compass with deviation, a sensor off the centre.

The recorded heading is psi + B sin(recorded) + C cos(recorded), the semicircular deviation; recorded speeds are those
of the sensor over ground, in axes turned by that deviation.
"""

from collections.abc import Sequence

import numpy as np

from swath_sysid.manoeuvring.hull.terms import DEVIATION_B, DEVIATION_C, SENSOR_X, SENSOR_Y, Numbers
from swath_sysid.manoeuvring.motion.trial import turned

INVERSIONS = 4  #: Fixed-point rounds from true to recorded heading.


def deviation(recorded_heading: Numbers, p: np.ndarray) -> Numbers:
    """Compass error at a recorded heading, rad, positive where the compass reads to port."""
    return p[DEVIATION_B] * np.sin(recorded_heading) + p[DEVIATION_C] * np.cos(recorded_heading)


def recorded_heading(heading: Numbers, p: np.ndarray) -> Numbers:
    """Compass reading at a true heading, rad."""
    found = heading
    for _ in range(INVERSIONS):
        found = heading + deviation(found, p)
    return found


def recorded_speeds(
    u: Numbers, v: Numbers, r: Numbers, heading: Numbers, current: Sequence | np.ndarray, p: np.ndarray
) -> tuple[Numbers, Numbers]:
    """Recorded surge and sway over ground, m/s, of u, v, r of the origin through the water; ``p`` is (n, ...)."""
    surge, sway = turned(u - r * p[SENSOR_Y], v + r * p[SENSOR_X], deviation(heading, p))
    along, across = turned(current[0], current[1], heading)
    return surge + along, sway + across


def through_water(
    surge: Numbers, sway: Numbers, r: Numbers, heading: Numbers, current: Sequence | np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of `recorded_speeds`; an unmeasured speed (NaN) stays NaN and counts as zero in the other."""
    along, across = turned(current[0], current[1], heading)
    u, v = turned(np.nan_to_num(surge - along), np.nan_to_num(sway - across), -deviation(heading, p))
    r = np.nan_to_num(r)
    return np.where(np.isnan(surge), np.nan, u + r * p[SENSOR_Y]), np.where(np.isnan(sway), np.nan, v - r * p[SENSOR_X])


def recorded_position(x: Numbers, y: Numbers, heading: Numbers, p: np.ndarray) -> tuple[Numbers, Numbers]:
    """Position of the sensor, m, of a craft at x, y with a true heading, rad."""
    cosine, sine = np.cos(heading), np.sin(heading)
    return x + p[SENSOR_X] * cosine - p[SENSOR_Y] * sine, y + p[SENSOR_X] * sine + p[SENSOR_Y] * cosine
