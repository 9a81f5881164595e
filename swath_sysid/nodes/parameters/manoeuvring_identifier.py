"""From the parameters of manoeuvring_identifier to the settings of the core."""

from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.nodes.parameters.table import Values, check


def manoeuvring_settings(values: Values) -> ManoeuvringSettings:
    """Settings of the identification; raises `InputError` where a value is not allowed."""
    check('manoeuvring_identifier', values)
    return ManoeuvringSettings(mass=values['mass_kg'] or None, lever=values['lever_m'] or None)
