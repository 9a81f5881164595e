"""A sea state as plain data: what the verb ``sea`` prints and the topic ``sea/state`` holds."""

import math
from typing import Any

import numpy as np
import yaml

from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.attitude.prediction.sea_state import SeaReport, SeaState
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.formats.schema import plain_content
from swath_sysid.formats.topics import SEA_TOPIC

#: What a sea state from own motion is, and what it is not.
REMARKS = (
    f'this is the heave at the sensor, between {BAND_HZ[0]:g} and {BAND_HZ[1]:g} Hz',
    'under way the periods are those of encounter, not of the sea',
    'a craft is not a wave buoy: waves shorter than a few of its lengths are underestimated',
)

_UNITS = {
    'duration': 's',
    'significant_height': 'm',
    'significant_height_std': 'm',
    'mean_period': 's',
    'mean_period_std': 's',
    'peak_period': 's',
    'peak_period_interval': 's',
    'axis': 'rad',
    'axis_std': 'rad',
    'least_height': 'm',
    'frequency': 'hz',
    'spectrum': 'm2_hz',
}

_OF_THE_SPECTRUM = ('frequency', 'spectrum')


def sea_as_data(state: SeaState) -> dict:
    """Names with units, to numbers and lists, of a sea state; what is not known is None."""
    return finite_or_none({f'{name}_{unit}': getattr(state, name) for name, unit in _UNITS.items()})


def sea_as_yaml(report: SeaReport, stamp_ns: int) -> str:
    """The text on ``sea/state`` at the newest stamp: `sea_as_data` without the spectrum, or why there is none."""
    data = {} if report.state is None else sea_as_data(report.state)
    numbers = {name: _rounded(value) for name, value in data.items() if not name.startswith(_OF_THE_SPECTRUM)}
    return yaml.safe_dump(
        {
            'stamp_ns': stamp_ns,
            'is_known': report.state is not None,
            'reason': report.reason,
            **numbers,
            'remarks': list(REMARKS),
        },
        sort_keys=False,
        allow_unicode=True,
        width=1000,
    )


def sea_from_yaml(text: str) -> SeaReport:
    """The `SeaReport` that `sea_as_yaml` wrote; of a spectrum nothing is known."""
    data = plain_content(text, SEA_TOPIC)
    try:
        if not data['is_known']:
            return SeaReport(None, str(data['reason']))
        numbers = {
            name: _number(data[f'{name}_{unit}']) for name, unit in _UNITS.items() if name not in _OF_THE_SPECTRUM
        }
        return SeaReport(SeaState(**numbers, frequency=np.empty(0), spectrum=np.empty(0)))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f'{SEA_TOPIC}: this was not written by this software ({error!r})') from error


def _number(value: Any) -> Any:
    """Of plain data: what is not known is NaN."""
    return tuple(map(_number, value)) if isinstance(value, list) else math.nan if value is None else float(value)


def _rounded(value: Any) -> Any:
    """To six figures, for people."""
    if isinstance(value, list):
        return [_rounded(element) for element in value]
    return value if value is None else float(f'{value:.6g}')
