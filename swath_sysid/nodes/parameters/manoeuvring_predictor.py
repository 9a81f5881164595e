"""The parameters of manoeuvring_predictor."""

from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlookSettings
from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilterSettings
from swath_sysid.nodes.parameters.parameter import DIAGNOSTICS, NodeParameter, Values, check

TABLE = (
    NodeParameter(
        'model_file', '', 'Model file of manoeuvre identify; empty: wait for manoeuvring/model', read_only=True
    ),
    NodeParameter(
        'leads_s', [1.0, 5.0, 10.0], 'Leads with a topic of their own, rising', 's', 0.1, 120.0, read_only=True
    ),
    NodeParameter('horizon_s', 20.0, 'Length of the path ahead', 's', 1.0, 120.0, read_only=True),
    NodeParameter('horizon_step_s', 0.5, 'Time between poses of the path', 's', 0.1, 10.0, read_only=True),
    NodeParameter('forecast_rate_hz', 5.0, 'Forecasts a second, at most', 'Hz', 0.1, 50.0, read_only=True),
    NodeParameter(
        'gap_limit_s',
        5.0,
        'After a longer silence of the odometry the filter begins anew',
        's',
        0.5,
        60.0,
        read_only=True,
    ),
    NodeParameter(
        'backward_jump_s', 1.0, 'A stamp further back is a clock that was set back', 's', 0.05, 60.0, read_only=True
    ),
    NodeParameter(
        'stop_after_s',
        0.0,
        'Without a command for this long the thrust is zero; 0: the last one holds',
        's',
        0.0,
        60.0,
        read_only=True,
    ),
    NodeParameter(
        'speed_noise_m_s',
        0.05,
        'Noise of the speeds, where the odometry does not report it',
        'm/s',
        1e-4,
        5.0,
        read_only=True,
    ),
    NodeParameter(
        'yaw_rate_noise_rad_s',
        0.01,
        'Noise of the yaw rate, where the sensor does not report it',
        'rad/s',
        1e-5,
        1.0,
        read_only=True,
    ),
    NodeParameter(
        'heading_noise_rad',
        0.01,
        'Noise of the heading, where the odometry does not report it',
        'rad',
        1e-5,
        1.0,
        read_only=True,
    ),
    NodeParameter(
        'position_noise_m',
        0.5,
        'Noise of the position, where the odometry does not report it',
        'm',
        1e-3,
        100.0,
        read_only=True,
    ),
    *DIAGNOSTICS,
)


def manoeuvring_pipeline_settings(values: Values) -> ManoeuvreOutlookSettings:
    """Settings of manoeuvring_predictor's core; raises `InputError` where a value is not allowed."""
    check(TABLE, values)
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
