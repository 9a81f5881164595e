"""A sea state as plain data: what the verb ``sea`` prints and the topic ``sea/state`` holds."""
import yaml

from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.formats.plain_data import finite_or_none

REMARKS = (
    f'this is the heave at the sensor, between {BAND_HZ[0]:g} and {BAND_HZ[1]:g} Hz',
    'under way the periods are those of encounter, not of the sea',
    'a craft is not a wave buoy: waves shorter than a few of its lengths are underestimated',
)
"""What a sea state from own motion is, and what it is not."""

_UNITS = {
    'duration': 's', 'significant_height': 'm', 'significant_height_std': 'm', 'mean_period': 's',
    'mean_period_std': 's', 'peak_period': 's', 'peak_period_interval': 's', 'axis': 'rad', 'axis_std': 'rad',
    'least_height': 'm', 'frequency': 'hz', 'spectrum': 'm2_hz',
}  # fmt: skip

_OF_THE_SPECTRUM = ('frequency', 'spectrum')


def sea_as_data(state):
    """Names with units, to numbers and lists; what is not known is None.

    Parameters
    ----------
    state : SeaState
        Of a record, or of the rows so far.
    """
    return finite_or_none({f'{name}_{unit}': getattr(state, name) for name, unit in _UNITS.items()})


def sea_as_yaml(report, stamp_ns):
    """The text on ``sea/state``: `sea_as_data` without the spectrum.

    Parameters
    ----------
    report : SeaReport
        With a sea state, or why there is none.
    stamp_ns : int
        Of the newest sample.

    Returns
    -------
    str
    """
    data = {} if report.state is None else sea_as_data(report.state)
    numbers = {name: _rounded(value) for name, value in data.items() if not name.startswith(_OF_THE_SPECTRUM)}
    return yaml.safe_dump(
        {'stamp_ns': stamp_ns, 'is_known': report.state is not None, 'reason': report.reason, **numbers,
         'remarks': list(REMARKS)},
        sort_keys=False, allow_unicode=True, width=1000,
    )  # fmt: skip


def _rounded(value):
    """To six figures, for people."""
    if isinstance(value, list):
        return [_rounded(element) for element in value]
    return value if value is None else float(f'{value:.6g}')
