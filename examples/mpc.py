"""A template for controllers that plan over the horizon: a winch that keeps a hanging load still.

    python examples/mpc.py morro_buoy.csv --frame frd --figure mpc.png

The winch pays out at a speed that its motor can change by 0.6 m/s^2 only.  At each step it plans its accelerations
over the horizon, such that the load's speed, deck plus winch, is least where the forecast is sure, and carries out the
first.
Live the same numbers are in ``forecast/<point>/horizon``.
"""
import sys

import numpy as np
from craft_in_waves import voyage_of_command_line
from scipy.optimize import lsq_linear

from swath_sysid.common.errors import InputError
from swath_sysid.report.figures import MEASURED, SERIES, new_figure, quiet, save_figure

STEP, STEPS, LARGEST, EFFORT = 0.2, 10, 0.6, 0.05
"""s and number of steps planned; m/s^2; weight of an acceleration beside a speed, s."""

SUM = np.tril(np.full((STEPS, STEPS), STEP))


def plan(speed, deck, deviation):
    """Accelerations of the winch, shape (STEPS,): least (deck + winch speed) / deviation, within the motor's limits."""
    weight = deviation[0] / deviation
    matrix = np.vstack([weight[:, None] * SUM, EFFORT * np.eye(STEPS)])
    target = np.concatenate([-weight * (deck + speed), np.zeros(STEPS)])
    return lsq_linear(matrix, target, (-LARGEST, LARGEST)).x


def control(voyage):
    """Speed of the deck and of the load by what the plan is made from: (times, {name: m/s})."""
    chosen = np.searchsorted(voyage.stamps, np.arange(voyage.stamps[0], voyage.stamps[-1], STEP) - 0.01)
    places = [int(np.abs(voyage.leads - STEP * k).argmin()) for k in range(1, STEPS + 1)]
    deck, acceleration = voyage.truth(voyage.stamps[chosen])[:, 1:3].T
    ahead = voyage.mean[chosen][:, places, 1]
    deviation = np.sqrt(voyage.covariance[chosen][:, places, 1, 1])
    even = np.ones_like(deviation)
    inputs = {
        'forecast': (ahead, deviation),
        'constant rate': (deck[:, None] + acceleration[:, None] * STEP * np.arange(1, STEPS + 1), even),
        'persistence': (np.repeat(deck[:, None], STEPS, axis=1), even),
    }
    speeds = {'deck': deck}
    for name, horizon in inputs.items():
        winch = np.zeros(deck.size)
        for k in range(deck.size - 1):
            winch[k + 1] = winch[k] + STEP * plan(winch[k], horizon[0][k], horizon[1][k])[0]
        speeds[name] = deck + winch
    return voyage.stamps[chosen], speeds


def main(argv=None):
    """Print the table and draw the figure; returns the exit code."""
    try:
        voyage, file = voyage_of_command_line('A winch that plans over the horizon.', argv)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    time, speeds = control(voyage)
    print(f'{"planned from":16}{"RMS speed of the load, m/s":>28}')
    for name, speed in speeds.items():
        print(f'{"(not at all)" if name == "deck" else name:16}{np.sqrt(np.mean(speed**2)):28.3f}')
    figure, shown = new_figure(9.0, 3.5), time < time[0] + 60.0
    axes = quiet(figure.subplots())
    for name, colour in zip(speeds, (MEASURED, SERIES[1], SERIES[0], SERIES[2]), strict=True):
        axes.plot(time[shown] - time[0], speeds[name][shown], color=colour, label=name)
    axes.set(xlabel='time, s', ylabel='vertical speed, m/s')
    axes.legend(frameon=False, ncols=4)
    save_figure(figure, file)
    return 0


if __name__ == '__main__':
    sys.exit(main())
