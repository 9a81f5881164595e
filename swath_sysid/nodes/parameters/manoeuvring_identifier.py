"""The parameters of manoeuvring_identifier."""

from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.window import AUTO, THRUST_INPUTS
from swath_sysid.nodes.parameters.parameter import DIAGNOSTICS, WORKER, NodeParameter, Values, check

TABLE = (
    NodeParameter(
        'window_s',
        900.0,
        'Length of the window of odometry and thrust that is fitted',
        's',
        60.0,
        7200.0,
        read_only=True,
    ),
    NodeParameter(
        'thrust_input',
        AUTO,
        'What the thruster topics carry: N or commands of -1 to 1',
        choices=THRUST_INPUTS,
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
    NodeParameter('mass_kg', 0.0, 'Mass of the craft, cargo included; 0: not known', 'kg', 0.0, 1e6),
    NodeParameter(
        'lever_m',
        0.0,
        'Half the distance between the thrusters; 0: that of a WAM-V 16',
        'm',
        0.0,
        100.0,
    ),
    NodeParameter(
        'model_path',
        '',
        'Model file of the manoeuvring model, read at the start if it exists and replaced '
        'whenever the model changes; empty: none',
        read_only=True,
    ),
    NodeParameter(
        'least_improvement',
        0.001,
        'A refit replaces the model if its errors on held-out motion are smaller by this part',
        '',
        0.0,
        0.9,
    ),
    *WORKER,
    *DIAGNOSTICS,
)


def manoeuvring_settings(values: Values) -> ManoeuvringSettings:
    """Settings of the identification; raises `InputError` where a value is not allowed."""
    check(TABLE, values)
    return ManoeuvringSettings(mass=values['mass_kg'] or None, lever=values['lever_m'] or None)
