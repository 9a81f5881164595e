"""From the parameters of the manoeuvring nodes to the settings of the core."""

from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.prediction.filter_settings import ManoeuvreFilterSettings
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlookSettings
from swath_sysid.nodes.parameters.table import Values, check


def manoeuvring_settings(values: Values) -> ManoeuvringSettings:
    """Settings of manoeuvring_identifier's core; raises `InputError` where a value is not allowed."""
    check('manoeuvring_identifier', values)
    return ManoeuvringSettings(mass=values['mass_kg'] or None, lever=values['lever_m'] or None)


def manoeuvring_pipeline_settings(values: Values) -> ManoeuvreOutlookSettings:
    """Settings of manoeuvring_predictor's core; raises `InputError` where a value is not allowed."""
    check('manoeuvring_predictor', values)
    noise = ManoeuvreFilterSettings(
        speed_noise=values['speed_noise_m_s'],
        yaw_rate_noise=values['yaw_rate_noise_rad_s'],
        heading_noise=values['heading_noise_rad'],
        position_noise=values['position_noise_m'],
    )
    return ManoeuvreOutlookSettings(
        tuple(values['leads_s']),
        values['horizon_s'],
        values['horizon_step_s'],
        values['forecast_rate_hz'],
        values['gap_limit_s'],
        values['backward_jump_s'],
        values['stop_after_s'],
        noise,
    )
