"""From the parameters of a node to the settings of its core, which alone is loaded for it."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isnan, radians
from typing import TYPE_CHECKING

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.common.advice import counted
from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.table import EXAMPLE, Values, check

if TYPE_CHECKING:
    from swath_sysid.attitude.hull.craft_simulator import CraftSettings
    from swath_sysid.attitude.identification.refit import RefitSettings
    from swath_sysid.attitude.motion.window import WindowSettings
    from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
    from swath_sysid.pipeline.forecast_pipeline import PipelineSettings


def installation(values: Values) -> Installation:
    """Frame and mounting of the sensor; NaN, the default, states none."""
    stated = [radians(angle) for angle in values['mounting_deg'] if not isnan(angle)]
    if len(values['mounting_deg']) != 3 or len(stated) not in (0, 3):
        raise InputError('the parameter mounting_deg takes three angles (roll, pitch, yaw), as in [0.0, 0.0, 90.0]')
    return Installation(values.get('frame', 'flu'), (stated[0], stated[1], stated[2]) if stated else None)


def stamp_settings(values: Values) -> StampSettings:
    """How stamps are judged."""
    return StampSettings(values['backward_jump_s'], values['gap_limit_s'])


def window_settings(values: Values) -> WindowSettings:
    """Settings of imu_buffer's core; raises `InputError` where a value is not allowed."""
    from swath_sysid.attitude.motion.window import WindowSettings

    check('imu_buffer', values)
    return WindowSettings(
        window=values['window_s'],
        max_rate=values['max_rate_hz'],
        detect_decay=values['auto_detect_decay'],
        smallest_decay=radians(values['smallest_decay_deg']),
        installation=installation(values),
        stamps=stamp_settings(values),
    )


def refit_settings(values: Values) -> RefitSettings:
    """Settings of identifier's core; raises `InputError` where a value is not allowed."""
    from swath_sysid.attitude.identification.refit import RefitSettings
    from swath_sysid.attitude.identification.result import IdentificationSettings
    from swath_sysid.attitude.identification.search import SearchSettings
    from swath_sysid.attitude.identification.stability_watch import StabilitySettings

    check('identifier', values)
    identification = IdentificationSettings(
        equation=values['equation'],
        objective=values['objective'],
        search=SearchSettings(
            algorithm=values['search'],
            generations=values['generations'] or None,
            population=values['population'] or None,
            seed=values['seed'],
        ),
    )
    stability = StabilitySettings(values['stability_limit'], values['known_gm_m'])
    return RefitSettings(tuple(values['axes']), identification, stability)


def frames_at(leads: Sequence[float]) -> tuple[float, ...]:
    """The leads of `frames_at_s` that are asked for."""
    return tuple(lead for lead in leads if lead)


def pipeline_settings(values: Values) -> PipelineSettings:
    """Settings of predictor's core; raises `InputError` where a value is not allowed."""
    from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
    from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
    from swath_sysid.attitude.prediction.outlook import ErrorLimit
    from swath_sysid.attitude.prediction.point import Point
    from swath_sysid.pipeline.forecast_pipeline import PipelineSettings

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
    from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits

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


def craft_settings(values: Values) -> CraftSettings:
    """Settings of simulated_craft's core; raises `InputError` where a value is not allowed."""
    from swath_sysid.attitude.hull.catalogue import hull_named
    from swath_sysid.attitude.hull.craft_simulator import CraftSettings, SensorNoise, release_angle

    check('simulated_craft', values)
    model = hull_named(values['hull']).model
    angle = radians(values['angle_deg']) or release_angle(model)
    # a small attitude sensor at rest at 100 Hz; the published trials were noisier, up to five times
    noise = SensorNoise(angle=0.0005, rate=0.003, acceleration=0.02)
    return CraftSettings(model, angle, noise=noise, seed=values['noise_seed'], sea=radians(values['sea_deg']))
