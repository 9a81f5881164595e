"""From commands to the thrust that acts: curve, transport delay, first-order lag."""

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from swath_sysid.manoeuvring.hull import terms
from swath_sysid.manoeuvring.hull.terms import Numbers

_NAMES = 'gain reverse_ratio dead_band exponent full_input reverse_exponent_ratio'
CURVE = tuple(terms.INDEX[name] for name in _NAMES.split())
MOST_COMMANDS = 10_000  #: Kept while no odometry comes; of more, the oldest are lost.


def thrust_curve(inputs: Numbers | Sequence[float], p: np.ndarray) -> np.ndarray:
    """Thrust of one thruster, N, under held commands (-1 to 1) or forces (N); parameters ``p`` are (n,). ``gain full
    ((|c| / full - dead_band) / (1 - dead_band))^exponent`` beyond the dead band; ``full`` is 1 for commands, the
    largest force for forces. Astern ``reverse_ratio`` multiplies it, ``reverse_exponent_ratio`` its exponent.
    """
    inputs = np.asarray(inputs)
    astern = inputs < 0.0
    beyond = np.maximum(np.abs(inputs) / p[terms.FULL_INPUT] - p[terms.DEAD_BAND], 0.0) / (1.0 - p[terms.DEAD_BAND])
    if p[terms.EXPONENT] != 1.0 or p[terms.REVERSE_EXPONENT_RATIO] != 1.0:
        beyond = beyond ** (p[terms.EXPONENT] * np.where(astern, p[terms.REVERSE_EXPONENT_RATIO], 1.0))
    return p[terms.GAIN] * p[terms.FULL_INPUT] * np.where(astern, -p[terms.REVERSE_RATIO], 1.0) * beyond


def delayed(values: np.ndarray, delay: float, step: float) -> np.ndarray:
    """Mean over each step of a held signal delayed by ``delay`` s, exact; the first sample holds before the start."""
    whole = int(delay / step)
    fraction = delay / step - whole
    padded = np.concatenate([np.repeat(values[:1], whole + 1), values])
    return (1.0 - fraction) * padded[1 : values.size + 1] + fraction * padded[: values.size]


def lag_factors(lag: float, step: float) -> tuple[float, float]:
    """Exact first-order lag: remaining share of the distance to the input after a step, and its mean over the step."""
    if lag <= 0.0:
        return 0.0, 0.0
    decay = math.exp(-step / lag)
    return decay, lag / step * (1.0 - decay)


def lagged(values: np.ndarray, lag: float, step: float) -> np.ndarray:
    """Mean over each step of a held signal behind a first-order lag, steady at the start."""
    # loaded where it is needed: a second and 45 MB for everybody else
    from scipy.signal import lfilter

    decay, share = lag_factors(lag, step)
    state = lfilter([0.0, 1.0 - decay], [1.0, -decay], values, zi=[values[0]])[0]
    return values + (state - values) * share


def acting_thrust(port: np.ndarray, starboard: np.ndarray, p: np.ndarray, step: float) -> np.ndarray:
    """Thrust of both thrusters, N, (2, N), mean over each step, s, of inputs (N,) that are held over each step."""
    sides = (port, 1.0 - p[terms.BALANCE]), (starboard, 1.0 + p[terms.BALANCE])
    held = (side * thrust_curve(inputs, p) for inputs, side in sides)
    return np.array([lagged(delayed(thrust, p[terms.DELAY], step), p[terms.LAG], step) for thrust in held])


class ThrustMemory:
    """`acting_thrust` for inputs that arrive at any time; ``first`` is the input of both thrusters before the first."""

    def __init__(self, p: np.ndarray, first: float = 0.0):
        self._p = p
        self._sides = np.array([1.0 - p[terms.BALANCE], 1.0 + p[terms.BALANCE]])
        self._history = deque([(-math.inf, first, first)], MOST_COMMANDS)
        self._state: np.ndarray | None = None

    def command(self, stamp: float, port: float, starboard: float) -> bool:
        """Accept inputs that hold from a stamp on; rejects NaN and stamps older than the last."""
        if not (math.isfinite(port) and math.isfinite(starboard)) or stamp < self._history[-1][0]:
            return False
        self._history.append((stamp, port, starboard))
        return True

    @property
    def last(self) -> tuple[float, float, float]:
        """Stamp and inputs of the last command."""
        return self._history[-1]

    @property
    def held(self) -> np.ndarray:
        """Thrust of port and starboard if the last inputs hold, N, shape (2,)."""
        return self._sides * thrust_curve(self.last[1:], self._p)

    def forget(self) -> None:
        """Restart, keeping the last inputs, after time went backward."""
        _, port, starboard = self._history[-1]
        self._history = deque([(-math.inf, port, starboard)], MOST_COMMANDS)
        self._state = None

    def advance(self, start: float, duration: float) -> np.ndarray:
        """Mean thrust of port and starboard over a step, N, shape (2,)."""
        begin = start - self._p[terms.DELAY]
        end = begin + duration
        while len(self._history) > 1 and self._history[1][0] <= begin:
            self._history.popleft()
        target, until = np.zeros(2), end
        for stamp, *inputs in reversed(self._history):
            since = max(stamp, begin)
            if since < until:
                target += (until - since) / duration * self._sides * thrust_curve(inputs, self._p)
                until = since
            if until <= begin:
                break
        decay, share = lag_factors(self._p[terms.LAG], duration)
        before = target if self._state is None else self._state
        self._state = target + (before - target) * decay
        return target + (before - target) * share
