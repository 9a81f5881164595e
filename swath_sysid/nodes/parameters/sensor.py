"""From the parameters of the sensor, which imu_buffer and predictor share, to the settings of the core."""

from math import radians

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.table import Values


def installation(values: Values) -> Installation:
    """Frame and mounting of the sensor."""
    if len(values['mounting_deg']) != 3:
        raise InputError('the parameter mounting_deg takes three angles (roll, pitch, yaw), as in [0.0, 0.0, 90.0]')
    roll, pitch, yaw = (radians(angle) for angle in values['mounting_deg'])
    return Installation(values['frame'], (roll, pitch, yaw))


def stamp_settings(values: Values) -> StampSettings:
    """How stamps are judged."""
    return StampSettings(values['backward_jump_s'], values['gap_limit_s'])
