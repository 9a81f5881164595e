"""Parameters of Nav2's MPPI controller and velocity smoother, from simulated runs of the craft."""

import math

import numpy as np
import yaml

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.formats.export.expressible import Export
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre, simulate
from swath_sysid.manoeuvring.motion.trial import STEP

DURATION = 180.0  #: s, after which a craft under held inputs is steady.
SHARES = (0.25, 0.5, 0.75)  #: Mean inputs as shares of the largest; the faster thruster has the rest for steering.

RISE = 1.0 - math.exp(-1.0)

UNUSABLE = (
    'this craft does not run ahead, turn and stop in the simulation: check its standard tests before giving its '
    'limits to Nav2'
)
HEAD = """\
# Limits of an identified craft in still water; merge into the parameters of Nav2.
# The mean input of both thrusters is at most {share:.0%} of the largest: the rest steers;
# wz_max is reached at every speed of the table craft. model_delay_* are delay and lag of the thrusters;
# Nav2 has these parameters from Lyrical on and leaves them unread in Jazzy and Kilted. From Lyrical on
# motion_model names a plugin: write diff_drive, and diff_drive: {{plugin: "mppi::DiffDriveMotionModel"}}.
# WARNING {warning}
"""


def nav2(model: ManoeuvringModel) -> Export:
    """Parameters of Nav2's MPPI controller and velocity smoother, from what the craft does in simulation.

    Args:
        model: As identified.

    Returns:
        The text (YAML), a table of what the craft does at three speeds included, and advice.

    Raises:
        InputError: The craft does not move ahead, turn or stop in the simulation.

    Example:
        >>> export = nav2(read_manoeuvring_model('wamv.yaml').model)
        >>> 'vx_max' in export.text
        True
    """
    full = model.largest_input
    rows = [_row(model, share) for share in SHARES]
    cruise, delay = SHARES[-1] * full, model['delay'] + model['lag']
    ahead, astern = (_held(model, side * cruise, side * cruise) for side in (1.0, -1.0))
    turn = _held(model, (2.0 * SHARES[-1] - 1.0) * full, full, rows[-1]['speed_m_s'], cruise)
    spin = _held(model, -full, full)
    yaw_rate = min(abs(float(spin.yaw_rate[-1])), *(row['yaw_rate_rad_s'] for row in rows))
    limits = {
        'vx_max': rows[-1]['speed_m_s'],
        'vx_min': min(float(astern.u[-1]), 0.0),
        'wz_max': yaw_rate,
        'ax_max': _mean_rise(ahead.u, delay),
        'ax_min': -rows[-1]['speed_m_s'] / rows[-1]['stopping_time_s'],
        'az_max': _mean_rise(np.abs(turn.yaw_rate), delay),
    }
    if not all(math.isfinite(value) for value in limits.values()) or yaw_rate <= 0.0:
        raise InputError(UNUSABLE)
    advice = Advice.of(
        'motion-simplified',
        drift=math.degrees(max(row['drift_angle_rad'] for row in rows)),
        change=rows[-1]['turning_speed_m_s'] / rows[-1]['speed_m_s'] - 1.0,
    )
    limits, delay = {name: _rounded(value) for name, value in limits.items()}, _rounded(delay)
    v, w, table = limits['vx_max'], limits['wz_max'], {key: [_rounded(row[key]) for row in rows] for key in rows[0]}
    follow = {'plugin': 'nav2_mppi_controller::MPPIController', 'motion_model': 'DiffDrive', **limits}
    smoother = {
        'max_velocity': [v, 0.0, w],
        'min_velocity': [limits['vx_min'], 0.0, -w],
        'max_accel': [limits['ax_max'], 0.0, limits['az_max']],
        'max_decel': [limits['ax_min'], 0.0, -limits['az_max']],
    }
    nodes = {
        'controller_server': {'FollowPath': {**follow, 'model_delay_vx': delay, 'model_delay_wz': delay}},
        'velocity_smoother': smoother,
        'craft': table,
    }
    content = {name: {'ros__parameters': parameters} for name, parameters in nodes.items()}
    head = HEAD.format(share=SHARES[-1], warning=advice.message)
    return Export(head + yaml.safe_dump(content, sort_keys=False), (advice,))


def _held(model: ManoeuvringModel, port: float, starboard: float, speed: float = 0.0, before: float = 0.0) -> Manoeuvre:
    """Run in still water under inputs that step from ``before``, long held, at `STEP` s."""
    steps = round(DURATION / STEP)
    left, right = (np.append(before, np.full(steps, value)) for value in (port, starboard))
    return simulate(model, left, right, STEP, (speed, 0.0, 0.0), current=(0.0, 0.0))


def _row(model: ManoeuvringModel, share: float) -> dict[str, float]:
    """Straight speed, hardest turn to port, and full astern from that speed, at a mean input."""
    full, base = model.largest_input, share * model.largest_input
    straight = float(_held(model, base, base).u[-1])
    turn = _held(model, (2.0 * share - 1.0) * full, full, straight, base)
    speed, rate = float(np.hypot(turn.u[-1], turn.v[-1])), abs(float(turn.yaw_rate[-1]))
    stop = _held(model, -full, -full, straight, base)
    stopped = np.flatnonzero(stop.u <= 0.0)
    if not (rate > 0.0 and straight > 0.0 and np.isfinite(speed) and stopped.size):
        raise InputError(UNUSABLE)
    end = stopped[0]
    return {
        'input_share': share,
        'speed_m_s': straight,
        'turning_speed_m_s': speed,
        'yaw_rate_rad_s': rate,
        'turn_radius_m': speed / rate,
        'drift_angle_rad': abs(float(np.arctan2(turn.v[-1], turn.u[-1]))),
        'stopping_distance_m': float(np.sum(np.hypot(np.diff(stop.x[1 : end + 1]), np.diff(stop.y[1 : end + 1])))),
        'stopping_time_s': float(stop.time[end] - STEP),
    }


def _mean_rise(values: np.ndarray, delay: float) -> float:
    """Mean slope of a step response up to 63 % of its final value, without the delay."""
    reached = np.flatnonzero(values >= RISE * values[-1])
    return float(RISE * values[-1] / max((reached[0] - 1) * STEP - delay, STEP)) if reached.size else float('nan')


def _rounded(value: float) -> float:
    return float(f'{value:.5g}')
