"""Odometry and thrust of the last manoeuvres of a live craft, in fixed memory."""

import math

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, ManoeuvringTrial

COLUMNS = ('time', 'port', 'starboard', 'surge', 'sway', 'yaw_rate', 'heading', 'x', 'y')
LARGEST_COMMAND = 1.0 + 1e-6  #: Larger inputs are thrusts, N.
FASTEST = 20.0  #: Hz; faster odometry is thinned to this rate.
AUTO = 'auto'
THRUST_INPUTS = (AUTO, FORCE, COMMAND)

NOT_FINITE, LATE, JUMPED_BACK, NO_THRUST = 'not-finite', 'late', 'jumped-back', 'no-thrust'


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
        self.counts = dict.fromkeys((NOT_FINITE, LATE, JUMPED_BACK, NO_THRUST), 0)

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
        if not math.isfinite(value):
            self.counts[NOT_FINITE] += 1
            return
        self._thrust[side] = float(value)
        self._thrust_at = self._latest

    def add_motion(
        self, stamp: float, surge: float, sway: float, yaw_rate: float, heading: float, x: float, y: float
    ) -> None:
        """Add an odometry message: pose in ENU, speeds in body axes x forward, y to port."""
        row = (surge, sway, yaw_rate, heading, x, y)
        if not all(map(math.isfinite, (stamp, *row))):
            self.counts[NOT_FINITE] += 1
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
