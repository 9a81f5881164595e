"""A template for controllers that plan over the horizon: a winch that keeps a hanging load still.

    python examples/mpc.py morro_buoy.csv --frame frd --figure mpc.png

The motor changes the winch's speed by 0.6 m/s^2 at most.  At each step accelerations are planned over the horizon such
that the load's speed, deck plus winch, is least where the forecast is sure; the first is carried out.
"""

import sys

import numpy as np
from craft_in_waves import carry_out
from scipy.optimize import lsq_linear

from swath_sysid.report.figures import MEASURED, SERIES, new_figure, quiet

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
    """Times and speeds of the deck and of the load, {planned from: m/s}."""
    chosen = np.searchsorted(voyage.stamps, np.arange(voyage.stamps[0], voyage.stamps[-1], STEP) - 0.01)
    places = [int(np.abs(voyage.leads - STEP * k).argmin()) for k in range(1, STEPS + 1)]
    deck, acceleration = voyage.truth(voyage.stamps[chosen])[:, 1:3].T
    deviation = np.sqrt(voyage.covariance[chosen][:, places, 1, 1])
    horizons = {
        'forecast': (voyage.mean[chosen][:, places, 1], deviation),
        'constant rate': (deck[:, None] + acceleration[:, None] * SUM.sum(axis=1), np.ones_like(deviation)),
        'persistence': (np.repeat(deck[:, None], STEPS, axis=1), np.ones_like(deviation)),
    }
    speeds = {'(not at all)': deck}
    for name, (ahead, spread) in horizons.items():
        winch = np.zeros(deck.size)
        for k in range(deck.size - 1):
            winch[k + 1] = winch[k] + STEP * plan(winch[k], ahead[k], spread[k])[0]
        speeds[name] = deck + winch
    return voyage.stamps[chosen], speeds


def demonstrate(voyage):
    """Print the table; returns the figure."""
    time, speeds = control(voyage)
    axes = quiet(new_figure(9.0, 3.5).subplots())
    print(f'{"planned from":16}{"RMS speed of the load, m/s":>28}')
    for (name, speed), colour in zip(speeds.items(), (MEASURED, SERIES[1], SERIES[0], SERIES[2]), strict=True):
        print(f'{name:16}{np.sqrt(np.mean(speed**2)):28.3f}')
        axes.plot((time - time[0])[time < time[0] + 60.0], speed[time < time[0] + 60.0], color=colour, label=name)
    axes.set(xlabel='time, s', ylabel='vertical speed, m/s')
    axes.legend(frameon=False, ncols=4)
    return axes.figure


if __name__ == '__main__':
    sys.exit(carry_out('A winch that plans over the horizon.', demonstrate))
