"""Odometry and thrust of the last manoeuvres of a live craft, in fixed memory."""

import math

import numpy as np

from swath_sysid.common.conventions import LATEST_STAMP_NS
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, ManoeuvringTrial

COLUMNS = ('time', 'port', 'starboard', 'surge', 'sway', 'yaw_rate', 'heading', 'x', 'y')
LARGEST_COMMAND = 1.0 + 1e-6  #: Larger inputs are thrusts, N.
FASTEST = 20.0  #: Hz; faster odometry is thinned to this rate.
AUTO = 'auto'
THRUST_INPUTS = (AUTO, FORCE, COMMAND)

NOT_FINITE, ABSURD, LATE, JUMPED_BACK, NO_THRUST = 'not-finite', 'absurd-value', 'late', 'jumped-back', 'no-thrust'

#: s, m/s, rad/s, m (a grid of the whole globe), N; beyond these a value is a broken message.
LARGEST_VALUES = {
    'stamp': LATEST_STAMP_NS * 1e-9,
    'surge': 100.0,
    'sway': 100.0,
    'yaw_rate': 35.0,
    'x': 1e8,
    'y': 1e8,
    'thrust': 1e8,
}


def why_left_out(**values: float) -> str:
    """Under which reason a message with these values is left out, if it is."""
    if not all(map(math.isfinite, values.values())):
        return NOT_FINITE
    return ABSURD if any(abs(values[name]) > LARGEST_VALUES.get(name, math.inf) for name in values) else ''


class ManoeuvringWindow:
    """Odometry of the last ``duration`` s with the thrust held at each message. The thrust counts as zero
    ``stop_after`` s after the last thruster message (0: it holds), and a stamp more than ``backward_jump`` s back
    restarts the window. ``counts`` holds rejected messages by reason.
    """

    def __init__(self, duration: float = 900.0, stop_after: float = 0.0, backward_jump: float = 1.0):
        self._rows = RowBuffer(max(2, round(duration * FASTEST)), len(COLUMNS))
        self._duration, self._stop_after, self._backward_jump = duration, stop_after, backward_jump
        self._thrust: dict[str, float] = {}
        self._latest = self._thrust_at = -math.inf
        self.counts = dict.fromkeys((NOT_FINITE, ABSURD, LATE, JUMPED_BACK, NO_THRUST), 0)

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self._rows)

    def clear(self) -> None:
        """Forget all motion; the thrust holds."""
        self._rows.clear()
        self._latest = -math.inf

    def add_thrust(self, side: str, value: float) -> None:
        """Add the input of one thruster, ``port`` or ``starboard``, N or command."""
        if reason := why_left_out(thrust=value):
            self.counts[reason] += 1
            return
        self._thrust[side] = float(value)
        self._thrust_at = self._latest

    def add_motion(
        self, stamp: float, surge: float, sway: float, yaw_rate: float, heading: float, x: float, y: float
    ) -> None:
        """Add an odometry message: pose in ENU, speeds in body axes x forward, y to port."""
        row = (surge, sway, yaw_rate, heading, x, y)
        if reason := why_left_out(stamp=stamp, **dict(zip(COLUMNS[3:], row, strict=True))):
            self.counts[reason] += 1
            return
        if stamp < self._latest - self._backward_jump:
            self.counts[JUMPED_BACK] += 1
            self.clear()
        elif stamp <= self._latest:
            self.counts[LATE] += 1
            return
        if stamp < self._latest + 0.9 / FASTEST:
            return
        if len(self._thrust) < 2:
            self.counts[NO_THRUST] += 1
            return
        self._latest = stamp
        if self._thrust_at == -math.inf:
            self._thrust_at = stamp
        stopped = 0.0 < self._stop_after < stamp - self._thrust_at
        inputs = (0.0, 0.0) if stopped else (self._thrust['port'], self._thrust['starboard'])
        self._rows.append((stamp, *inputs, *row))
        self._rows.drop_below(stamp - self._duration)

    def trial(self, thrust_input: str = AUTO, source: str = 'window') -> ManoeuvringTrial:
        """The window as a trial; with ``auto``, inputs within -1 and 1 are commands."""
        if not self.size:
            missing = ' and '.join(side for side in ('port', 'starboard') if side not in self._thrust)
            raise InputError(
                f'nothing has come from the {missing} thruster: check its topic'
                if missing
                else 'no odometry has come since the first thruster command: check its topic'
            )
        column = dict(zip(COLUMNS, self._rows.last().T.copy(), strict=True))
        if thrust_input == AUTO:
            most = max(np.max(np.abs(column['port'])), np.max(np.abs(column['starboard'])))
            thrust_input = FORCE if most > LARGEST_COMMAND else COMMAND
        return ManoeuvringTrial(thrust_input=thrust_input, frame='enu', source=source, **column)
