"""Draws the figure of explanation/model.md: `python docs/draw_model.py`."""

from pathlib import Path

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, amplitude_curves
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.report.figures import SERIES, new_figure, quiet, save_figure

RELEASE = np.radians(15.0)
LINEAR = {'b1': 0.25, 'r1': 6.25}
# as much damping as the linear term at 10 deg
DAMPINGS = {
    'linear, b1': LINEAR,
    'quadratic, b2': {'b2': 0.675, 'r1': 6.25},
    'cubic, b3': {'b3': 1.75, 'r1': 6.25},
    'dry friction, b0': {'b0': 0.0857, 'r1': 6.25},
}
RESTORINGS = {
    'linear, r1': LINEAR,
    'stiffening, r3 > 0': {**LINEAR, 'r3': 30.0},
    'softening, r3 < 0': {**LINEAR, 'r3': -30.0},
}


def draw(panels, terms_of, period_of_curves):
    """The moment of each model, its decay, and what its oscillation is like at each amplitude."""
    moment, decay, curve = (quiet(panel) for panel in panels)
    time, amplitude = np.linspace(0.0, 12.0, 400), np.radians(np.linspace(1.0, 15.0, 60))
    for (label, terms), colour in zip(terms_of.items(), SERIES, strict=False):
        model = DecayModel.of(**terms, axis='roll')
        given = np.linspace(-0.7, 0.7, 200) if not period_of_curves else np.linspace(-RELEASE, RELEASE, 200)
        restored = -model.acceleration(given, np.zeros_like(given))
        damped = -model.acceleration(np.zeros_like(given), given)
        across = np.degrees(given)
        moment.plot(across, restored if period_of_curves else damped, color=colour, label=label)
        decay.plot(time, np.degrees(simulate(model, RELEASE, 0.0, time)[0]), color=colour, linewidth=1.1)
        curves = amplitude_curves(model.ratios, amplitude, model.friction_rate)
        shown = 2.0 * np.pi / curves.frequency if period_of_curves else curves.damping_ratio
        curve.plot(np.degrees(amplitude), shown, color=colour)
    moment.legend(frameon=False, fontsize='small')
    kind = 'restoring' if period_of_curves else 'damping'
    moment.set(xlabel='angle [deg]' if period_of_curves else 'rate [deg/s]', ylabel=f'{kind} moment / inertia [rad/s²]')
    decay.set(xlabel='time after the release [s]', ylabel='angle [deg]')
    label = 'natural period [s]' if period_of_curves else 'equivalent damping ratio [-]'
    curve.set(xlabel='amplitude [deg]', ylabel=label)


figure = new_figure(12.0, 6.4)
above, below = figure.subplots(2, 3)
draw(above, DAMPINGS, False)
draw(below, RESTORINGS, True)
above[2].set_ylim(0.0, 0.15)
for panel, title in zip(above, ('damping', 'free decay from 15 deg', 'at each amplitude'), strict=True):
    panel.set_title(title)
below[0].set_title('restoring')
save_figure(figure, Path(__file__).parent / 'explanation' / 'model.svg')
