"""Draws the figure of howto/frames.md: `python docs/draw_mounting.py`."""

from pathlib import Path

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.report.figures import MEASURED, SERIES, new_figure, save_figure

ROLL, PITCH, YAW = 35.0, 25.0, 50.0
STEPS = (
    ('along the craft', (0.0, 0.0, 0.0)),
    (f'1. yaw {YAW:g}: about z, x goes to port', (0.0, 0.0, YAW)),
    (f'2. pitch {PITCH:g}: about the new y, x goes down', (0.0, PITCH, YAW)),
    (f'3. roll {ROLL:g}: about the new x, y goes up', (ROLL, PITCH, YAW)),
)
# waterline of a boat
HULL = 0.75 * np.array([(1.6, 0.0), (0.9, 0.45), (-1.2, 0.5), (-1.2, -0.5), (0.9, -0.45), (1.6, 0.0)]).T


def axes_of(angles):
    """The sensor's axes in the craft's, as rows."""
    return np.array(Installation('flu', tuple(np.radians(angles))).vector(*np.eye(3))).T


figure = new_figure(12.0, 3.4)
for place, (title, angles) in enumerate(STEPS, 1):
    panel = figure.add_subplot(1, 4, place, projection='3d')
    panel.plot(*HULL, np.full(HULL.shape[1], -0.4), color=MEASURED, linewidth=0.8)
    panel.text(1.2, 0.0, -0.3, 'bow', fontsize='x-small', ha='center')
    panel.text(-1.0, 0.65, -0.4, 'port', fontsize='x-small', ha='center')
    before = axes_of(STEPS[max(place - 2, 0)][1])
    for name, colour, was, axis in zip('xyz', SERIES, before, axes_of(angles), strict=False):
        panel.plot(*np.array([np.zeros(3), was]).T, color=colour, linewidth=0.8, linestyle=':')
        panel.quiver(0.0, 0.0, 0.0, *axis, color=colour, linewidth=1.6, arrow_length_ratio=0.18)
        panel.text(*(1.15 * axis), name, color=colour)
    panel.set_title(title, fontsize='small')
    panel.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), zlim=(-1.0, 1.2))
    panel.set_box_aspect((1.0, 1.0, 0.8), zoom=1.5)
    panel.view_init(elev=28.0, azim=-60.0)
    panel.set_axis_off()
save_figure(figure, Path(__file__).parent / 'howto' / 'mounting.png')
