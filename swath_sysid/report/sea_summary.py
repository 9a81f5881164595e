"""A sea state in words and in plain data."""
from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING

from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.report.fit_summary import finite_or_none, warnings_as_data

if TYPE_CHECKING:
    from collections.abc import Iterable

    from swath_sysid.attitude.prediction.sea_state import SeaState
    from swath_sysid.common.advice import Advice

REMARKS = (
    f'this is the heave at the sensor, between {BAND_HZ[0]:g} and {BAND_HZ[1]:g} Hz',
    'under way the periods are those of encounter, not of the sea',
    'a craft is no wave buoy for waves shorter than a few of its lengths: of these it shows less than there is',
)
"""What a sea state from own motion is, and what it is not."""

_UNITS = {
    'duration': 's', 'significant_height': 'm', 'significant_height_std': 'm', 'mean_period': 's',
    'mean_period_std': 's', 'peak_period': 's', 'peak_period_interval': 's', 'axis': 'rad', 'axis_std': 'rad',
    'frequency': 'hz', 'spectrum': 'm2_hz',
}  # fmt: skip


def sea_as_data(found: SeaState, advice: Iterable[Advice] = ()) -> dict:
    """What ``sea --json`` prints; what is not known is None.

    Parameters
    ----------
    found : SeaState
    advice : iterable of Advice
        Of the record.
    """
    plain = {name: getattr(value, 'tolist', lambda value=value: value)() for name, value in asdict(found).items()}
    named = {f'{name}_{_UNITS[name]}': value for name, value in plain.items()}
    return finite_or_none({**named, 'remarks': list(REMARKS), **warnings_as_data(advice)})


def sea_in_words(found: SeaState, name: str) -> list[str]:
    """Lines for a reader; see `sea_as_data`.

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
        *REMARKS,
    ]
