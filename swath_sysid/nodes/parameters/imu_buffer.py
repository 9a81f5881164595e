"""The parameters of imu_buffer."""

from math import radians

from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.nodes.parameters.parameter import (
    DIAGNOSTICS,
    SENSOR,
    NodeParameter,
    Values,
    check,
    installation,
    stamp_settings,
)

TABLE = (
    *SENSOR,
    NodeParameter('window_s', 60.0, 'Length of the motion window', 's', 1.0, 3600.0, read_only=True),
    NodeParameter(
        'max_rate_hz',
        1000.0,
        'Memory is reserved for this many samples a second; faster ones shorten the window',
        'Hz',
        1.0,
        10000.0,
        read_only=True,
    ),
    NodeParameter('record_at_start', True, 'Fill the window from the start (else after ~/record)', read_only=True),
    NodeParameter('auto_detect_decay', True, 'Publish the window automatically when a free decay has ended'),
    NodeParameter(
        'smallest_decay_deg',
        1.0,
        'A decay of a smaller first amplitude is not published automatically',
        'deg',
        0.05,
        45.0,
        read_only=True,
    ),
    *DIAGNOSTICS,
)


def window_settings(values: Values) -> WindowSettings:
    """Settings of imu_buffer's core; raises `InputError` where a value is not allowed."""
    check(TABLE, values)
    return WindowSettings(
        window=values['window_s'],
        max_rate=values['max_rate_hz'],
        detect_decay=values['auto_detect_decay'],
        smallest_decay=radians(values['smallest_decay_deg']),
        installation=installation(values),
        stamps=stamp_settings(values),
    )
