"""The parameters of predictor."""

import re
from collections.abc import Sequence
from math import inf, radians

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.point import Point
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.common.errors import InputError
from swath_sysid.nodes.parameters.parameter import (
    DIAGNOSTICS,
    SENSOR,
    NodeParameter,
    Table,
    Values,
    check,
    installation,
    stamp_settings,
)
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings

TABLE = (
    *SENSOR,
    NodeParameter(
        'leads_s',
        list(ForecasterSettings().leads),
        'Leads with a topic of their own, increasing',
        's',
        0.01,
        120.0,
        read_only=True,
    ),
    NodeParameter('horizon_s', 5.0, 'Length of forecast/horizon', 's', 0.1, 120.0, read_only=True),
    NodeParameter('horizon_step_s', 0.1, 'Step of forecast/horizon', 's', 0.005, 10.0, read_only=True),
    NodeParameter(
        'forecast_rate_hz',
        10.0,
        'Forecasts at the leads and over the horizon a second (forecast/next comes with every sample)',
        'Hz',
        0.1,
        1000.0,
        read_only=True,
    ),
    NodeParameter(
        'waves_window_s',
        ForecasterSettings().window,
        'The past that the waves are learnt from',
        's',
        10.0,
        3600.0,
        read_only=True,
    ),
    NodeParameter(
        'waves_first_fit_s',
        ForecasterSettings().first_refit,
        'The least past that the waves are learnt from (more: later, but not from a craft that is handled)',
        's',
        2.0,
        3600.0,
        read_only=True,
    ),
    NodeParameter(
        'waves_refit_interval_s',
        ForecasterSettings().refit_interval,
        'Least time between fits of the waves, which run in the background',
        's',
        1.0,
        600.0,
        read_only=True,
    ),
    *(
        NodeParameter(
            f'quiet_{axis}_deg',
            3.0,
            f'Largest {axis} either way of a quiet craft, for the probability on '
            'forecast/quiescence; 0: does not matter',
            'deg',
            0.0,
            180.0,
        )
        for axis in AXES
    ),
    *(
        NodeParameter(
            f'quiet_{axis}_rate_deg_s',
            0.0,
            f'Largest {axis} rate either way of a quiet craft; 0: does not matter',
            'deg/s',
            0.0,
            1000.0,
        )
        for axis in AXES
    ),
    NodeParameter(
        'quiet_for_s',
        0.0,
        'How long from now the craft is to stay quiet, at most horizon_s; 0: horizon_s',
        's',
        0.0,
        120.0,
        read_only=True,
    ),
    NodeParameter(
        'quiet_heave_m',
        0.0,
        'Largest heave either way, about the mean level, of a quiet craft at each of points; 0: does not matter',
        'm',
        0.0,
        100.0,
    ),
    NodeParameter(
        'quiet_vertical_velocity_m_s',
        0.0,
        'Largest vertical velocity either way of a quiet craft at each of points; 0: does not matter',
        'm/s',
        0.0,
        100.0,
    ),
    NodeParameter('quiet_about_trim', False, 'The limits of roll and pitch are about the present trim'),
    NodeParameter(
        'quiet_probability',
        QuiescenceLimits().probability,
        'With which a window of calm on forecast/calm is to hold',
        '',
        0.01,
        0.999,
    ),
    NodeParameter(
        'points',
        [''],
        'Names of points whose vertical motion is forecast, as in [bow, crane_tip]; each has a '
        'parameter points.NAME, [x, y, z] in m from the sensor, forward, port, up',
        read_only=True,
    ),
    NodeParameter(
        'frames_at_s',
        [0.0],
        'Some of leads_s, for which the predicted frame of the craft goes to /tf, as '
        'base_link_in_1_0s, beside base_link_now; [0.0]: none',
        's',
        0.0,
        120.0,
        read_only=True,
    ),
    NodeParameter(
        'in_step',
        False,
        'For records that are replayed faster than they were measured: forecast from every sample '
        'and wait for each fit of the waves, as play-through does, instead of staying with the newest sample',
        read_only=True,
    ),
    NodeParameter(
        'loading',
        0.0,
        'Draft or displacement the craft floats at, in the unit its model is scheduled on; '
        '0: as published on craft/loading, or not known',
        '',
        0.0,
        1e9,
    ),
    NodeParameter(
        'gate_probability',
        HullFilterSettings().gate_probability,
        'A true measurement is taken for an outlier with this probability',
        '',
        1e-30,
        0.01,
        read_only=True,
    ),
    NodeParameter(
        'gate_patience',
        HullFilterSettings().gate_patience,
        'After this many rejected samples in a row the sensor is accepted again',
        'samples',
        1,
        1000,
        read_only=True,
    ),
    *DIAGNOSTICS,
)


def further(values: Values) -> Table:
    """The places of the points that are named; raises `InputError` for names that no topic can have."""
    names = [name for name in values['points'] if name]
    for name in names:
        if not re.fullmatch(r'[a-z][a-z0-9_]*', name) or names.count(name) > 1:
            raise InputError(
                f"the parameter points cannot hold '{name}': give each point a name of its own, of small letters, "
                'digits and underscores'
            )
    return tuple(
        NodeParameter(
            f'points.{name}',
            [0.0, 0.0, 0.0],
            f'Place of {name} from the sensor: forward, port, up',
            'm',
            -1000.0,
            1000.0,
            read_only=True,
        )
        for name in names
    )


def frames_at(leads: Sequence[float]) -> tuple[float, ...]:
    """The leads of `frames_at_s` that are asked for."""
    return tuple(lead for lead in leads if lead)


def pipeline_settings(values: Values) -> PipelineSettings:
    """Settings of predictor's core; raises `InputError` where a value is not allowed."""
    places = further(values)
    check((*TABLE, *places), values)
    for lead in frames_at(values['frames_at_s']):
        if lead not in values['leads_s']:
            raise InputError(f'the parameter frames_at_s cannot hold {lead:g}: add it to leads_s, or name one of those')
    if any(len(values[place.name]) != 3 for place in places):
        raise InputError('the parameters points.NAME take three lengths (forward, port, up), as in [2.5, 0.0, 0.0]')
    return PipelineSettings(
        installation=installation(values),
        stamps=stamp_settings(values),
        forecaster=ForecasterSettings(
            hull=HullFilterSettings(gate_probability=values['gate_probability'], gate_patience=values['gate_patience']),
            leads=tuple(values['leads_s']),
            horizon=values['horizon_s'],
            horizon_step=values['horizon_step_s'],
            forecast_rate=values['forecast_rate_hz'],
            window=values['waves_window_s'],
            refit_interval=values['waves_refit_interval_s'],
            first_refit=values['waves_first_fit_s'],
            quiescence=quiescence_limits(values),
            points=tuple(Point(p.name.removeprefix('points.'), tuple(values[p.name])) for p in places),
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
