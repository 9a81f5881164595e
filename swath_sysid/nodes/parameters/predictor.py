"""From the parameters of predictor to the settings of the core."""

from collections.abc import Sequence
from math import inf, radians

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.outlook import ErrorLimit
from swath_sysid.attitude.prediction.point import Point
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.common.advice import counted
from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.sensor import installation, stamp_settings
from swath_sysid.nodes.parameters.table import EXAMPLE, Values, check
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings


def frames_at(leads: Sequence[float]) -> tuple[float, ...]:
    """The leads of `frames_at_s` that are asked for."""
    return tuple(lead for lead in leads if lead)


def pipeline_settings(values: Values) -> PipelineSettings:
    """Settings of predictor's core; raises `InputError` where a value is not allowed."""
    check('predictor', values)
    for lead in frames_at(values['frames_at_s']):
        if lead not in values['leads_s']:
            raise InputError(f'the parameter frames_at_s cannot hold {lead:g}: add it to leads_s, or name one of those')
    points = {name: tuple(values[f'points.{name}']) for name in values['points'] if name}
    for name, position in points.items():
        if len(position) != 3:
            raise InputError(f'the parameter points.{name} has {counted(len(position), "number")}: give three{EXAMPLE}')
    return PipelineSettings(
        installation=installation(values),
        stamps=stamp_settings(values),
        forecaster=ForecasterSettings(
            hull=HullFilterSettings(gate_probability=values['gate_probability'], gate_patience=values['gate_patience']),
            leads=tuple(values['leads_s']),
            horizon=values['horizon_s'],
            horizon_step=values['horizon_step_s'],
            forecast_rate=values['forecast_rate_hz'],
            window=values['waves_window_periods'],
            refit_interval=values['waves_refit_interval_periods'],
            first_refit=values['waves_first_fit_periods'],
            quiescence=quiescence_limits(values),
            points=tuple(Point(name, position) for name, position in points.items()),
            valid_error=ErrorLimit(values['valid_error'], values['valid_error_rad']),
        ),
    )


def quiescence_limits(values: Values) -> QuiescenceLimits:
    """What predictor takes for a quiet craft."""

    def limit(name: str) -> float:
        return radians(values[name]) or inf

    return QuiescenceLimits(
        roll=limit('quiet_roll_deg'),
        pitch=limit('quiet_pitch_deg'),
        roll_rate=limit('quiet_roll_rate_deg_s'),
        pitch_rate=limit('quiet_pitch_rate_deg_s'),
        duration=values['quiet_for_s'] or values['horizon_s'],
        points=tuple(
            PointLimits(name, values['quiet_heave_m'] or inf, values['quiet_vertical_velocity_m_s'] or inf)
            for name in values['points']
            if name
        ),
        about_trim=values['quiet_about_trim'],
        probability=values['quiet_probability'],
    )
