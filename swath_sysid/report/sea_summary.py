"""A sea state in words."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swath_sysid.formats.sea_state import REMARKS

if TYPE_CHECKING:
    from swath_sysid.attitude.prediction.sea_state import SeaState

def sea_in_words(found: SeaState, name: str) -> list[str]:
    """Lines for a reader.

    Parameters
    ----------
    found : SeaState
    name : str
        Of the record.
    """
    low, high = found.peak_period_interval
    if math.isfinite(found.axis):
        side = 'to port' if found.axis > 0.0 else 'to starboard'
        axis = (
            f'along a line {abs(math.degrees(found.axis)):.0f} ± {math.degrees(found.axis_std):.1f} deg {side} of the '
            'bow, either way'
        )
    else:
        axis = 'not known: heave and slope are not coherent'
    return [
        f'{name}: {found.duration / 60.0:.0f} min of motion',
        f'  significant height   {found.significant_height:.3g} ± {found.significant_height_std:.2g} m',
        f'  mean period          {found.mean_period:.2f} ± {found.mean_period_std:.2f} s (zero crossings)',
        f'  peak period          {found.peak_period:.1f} s, 95 % within {low:.1f} and {high:.1f} s',
        f'  the waves run        {axis}',
        f'  least height         {found.least_height:.2g} m: the noise of this sensor may show as much',
        *REMARKS,
    ]
