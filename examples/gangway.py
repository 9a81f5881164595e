"""A gangway that holds still: heave, roll and pitch taken out by actuators with a delay and a lag.

    python examples/gangway.py morro_buoy.csv --frame frd --figure gangway.png

A command acts 0.2 s later, is held for 0.1 s, and is followed with a lag of 0.3 s.  It is, of the motion as measured
now (raw); as it will be when the command acts, by its rate now (constant rate) or by the forecast, either put through
the inverse of the lag.  Printed: the variance of what is left, over that of the motion.

Heave as measured is that of an ideal reference unit: right at low frequencies, which an IMU alone is not.  All three
start from its heave, velocity and acceleration; the forecast adds the accelerations to come.  The last three rows do
without such a unit: heave and velocity of now are what the IMU makes of them, forecast a step before.
"""

import sys

import numpy as np
from craft_in_waves import STEP, carry_out

from swath_sysid import InputError
from swath_sysid.report.figures import MEASURED, SERIES, new_figure, quiet

DELAY, LAG = 2, 0.3
"""Steps until a command acts, and s."""

KEPT = np.exp(-STEP / LAG)
AXES = {'heave': (0, 1, 2), 'roll': (3, 5, None), 'pitch': (4, 6, None)}
"""Places of the motion, its rate and its acceleration."""

SETTLED = 50


def through_inverse_lag(begin, end):
    """The held command that takes a lag from one value to the next in a step."""
    return (end - KEPT * begin) / (1.0 - KEPT)


def follow(command):
    """What the actuator makes of commands, one a step, shape (N,); NaN before the first acts."""
    position, value = np.full(command.size, np.nan), command[0]
    for k in range(command.size - DELAY - 1):
        value = KEPT * value + (1.0 - KEPT) * command[k]
        position[k + DELAY + 1] = value
    return position


def integrated_twice(value, rate, acceleration):
    """Positions a step apart from now on, from accelerations that change linearly between, shapes (N,) and (N, K)."""
    positions = [value]
    for before, after in zip(acceleration.T, acceleration.T[1:], strict=False):
        positions.append(positions[-1] + STEP * rate + STEP**2 * (before / 3.0 + after / 6.0))
        rate = rate + 0.5 * STEP * (before + after)
    return np.stack(positions, axis=1)


def commands_from(motion, rate, to_come):
    """Commands by method, from motion and rate now and the motion when a command acts and when its hold ends (N, 2)."""
    steady = [motion + rate * STEP * k for k in (DELAY, DELAY + 1)]
    return {
        'raw': motion,
        'constant rate': through_inverse_lag(*steady),
        'forecast': through_inverse_lag(*to_come.T),
    }


def hold(voyage):
    """Motion of each axis, and what is left of it by method: {axis: (motion, {method: shape (N,)})}."""
    time = np.arange(voyage.stamps[0], voyage.stamps[-1] + 0.5 * STEP, STEP)
    # where a forecast is missing, the one before it stands
    newest = np.searchsorted(voyage.stamps, time + 0.1 * STEP, side='right') - 1
    ahead, now = voyage.mean[newest], voyage.truth(time)
    if not np.allclose(voyage.leads[: DELAY + 1], STEP * np.arange(1, DELAY + 2)):
        raise InputError('the gangway steps with the horizon: forecast at every 0.1 s')
    left, before = {}, voyage.mean[np.maximum(newest - 1, 0), 0]
    for axis, (place, of_rate, of_acceleration) in AXES.items():
        motion, rate = now[:, place], now[:, of_rate]
        alone = to_come = ahead[:, DELAY - 1 : DELAY + 1, place]
        of_imu = motion, rate
        if of_acceleration is not None:
            accelerations = np.column_stack([now[:, of_acceleration], ahead[:, : DELAY + 1, of_acceleration]])
            to_come = integrated_twice(motion, rate, accelerations)[:, DELAY:]
            of_imu = before[:, place], before[:, of_rate]
        commands = commands_from(motion, rate, to_come) | {
            f'{method}, IMU alone': command for method, command in commands_from(*of_imu, alone).items()
        }
        left[axis] = motion, {method: motion - follow(command) for method, command in commands.items()}
    return left


def residual_variances(left):
    """Variance of what is left over that of the motion: {axis: {method: float}}."""
    return {
        axis: {method: float(np.nanvar(rest[SETTLED:]) / np.var(motion)) for method, rest in rests.items()}
        for axis, (motion, rests) in left.items()
    }


def draw(left):
    """The figure: a minute of each axis and of what is left."""
    figure = new_figure(9.0, 7.0)
    shown = slice(SETTLED, SETTLED + 600)
    for axes, (axis, (motion, rests)) in zip(figure.subplots(3, sharex=True), left.items(), strict=True):
        unit, factor = ('m', 1.0) if axis == 'heave' else ('deg', np.degrees(1.0))
        quiet(axes).set(ylabel=f'{axis}, {unit}')
        time = STEP * np.arange(motion.size)[shown]
        axes.plot(time, factor * (motion - motion.mean())[shown], color=MEASURED, linewidth=0.8, label='motion')
        for k, method in enumerate(('raw', 'constant rate', 'forecast')):
            axes.plot(time, factor * rests[method][shown], color=SERIES[(2, 0, 1)[k]], label=f'left: {method}')
    axes.set_xlabel('time, s')
    figure.axes[0].legend(frameon=False, ncols=4, fontsize=8)
    return figure


def demonstrate(voyage):
    """Print the table; returns the figure."""
    left = hold(voyage)
    found = residual_variances(left)
    print(f'{"variance left":26}' + ''.join(f'{axis:>12}' for axis in found))
    for method in found['heave']:
        print(f'{method:26}' + ''.join(f'{of[method]:12.2g}' for of in found.values()))
    for method in ('raw', 'constant rate'):
        print(f'{method + " / forecast":26}' + ''.join(f'{of[method] / of["forecast"]:12.0f}' for of in found.values()))
    return draw(left)


if __name__ == '__main__':
    sys.exit(carry_out('A gangway fed by the forecast at its own delay.', demonstrate))
