"""From the parameters of imu_buffer to the settings of the core."""

from math import radians

from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.nodes.parameters.sensor import installation, stamp_settings
from swath_sysid.nodes.parameters.table import Values, check


def window_settings(values: Values) -> WindowSettings:
    """Settings of imu_buffer's core; raises `InputError` where a value is not allowed."""
    check('imu_buffer', values)
    return WindowSettings(
        window=values['window_s'],
        max_rate=values['max_rate_hz'],
        detect_decay=values['auto_detect_decay'],
        smallest_decay=radians(values['smallest_decay_deg']),
        installation=installation(values),
        stamps=stamp_settings(values),
    )
