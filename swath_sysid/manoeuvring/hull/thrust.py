"""From commands to the thrust that acts: curve, transport delay, first-order lag."""
import numpy as np
from scipy.signal import lfilter

from swath_sysid.manoeuvring.hull.terms import BALANCE, DEAD_BAND, DELAY, EXPONENT, GAIN, LAG, REVERSE_RATIO

SHORTEST_LAG = 1e-6
"""s; a thruster below this answers at once."""


def thrust_curve(command, gain, reverse_ratio, dead_band, exponent):
    """Thrust of a normalised command, N.

    ``gain ((|c| - dead_band) / (1 - dead_band))^exponent`` beyond the dead band, times
    ``reverse_ratio`` in reverse. With gain 1, no dead band and exponent 1 it passes forces on.

    Parameters
    ----------
    command : ndarray
        -1 to 1; or N.
    gain : float
        Thrust at full command ahead, N.
    reverse_ratio, dead_band, exponent : float
    """
    beyond = np.maximum(np.abs(command) - dead_band, 0.0) / (1.0 - dead_band)
    if exponent != 1.0:
        beyond = beyond**exponent
    return gain * np.where(command < 0.0, -reverse_ratio, 1.0) * beyond


def command_of_thrust(thrust, gain, reverse_ratio, dead_band, exponent):
    """The inverse of `thrust_curve`; zero thrust needs no command."""
    share = np.abs(thrust) / (gain * np.where(np.asarray(thrust) < 0.0, reverse_ratio, 1.0))
    command = dead_band + (1.0 - dead_band) * share ** (1.0 / exponent)
    return np.where(share > 0.0, np.sign(thrust) * command, 0.0)


def delayed(values, delay, step):
    """Mean over each step of a held signal that arrives ``delay`` seconds late.

    Exact for a signal that is constant over each step; before the first sample the first holds.
    """
    whole = int(delay / step)
    fraction = delay / step - whole
    padded = np.concatenate([np.repeat(values[:1], whole + 1), values])
    return (1.0 - fraction) * padded[1 : values.size + 1] + fraction * padded[: values.size]


def lagged(values, lag, step):
    """Mean over each step of a held signal behind a first-order lag (exact), steady at the start."""
    if lag < SHORTEST_LAG:
        return values
    decay = np.exp(-step / lag)
    share = lag / step * (1.0 - decay)
    state = lfilter([0.0, 1.0 - decay], [1.0, -decay], values, zi=[values[0]])[0]
    return values + (state - values) * share


def acting_thrust(port, starboard, p, step):
    """Thrust of both thrusters, N, mean over each step.

    Parameters
    ----------
    port, starboard : ndarray, shape (N,)
        Commands, or forces in N, held over each step.
    p : ndarray, shape (39,)
    step : float
        s.

    Returns
    -------
    port, starboard : ndarray, shape (N,)
    """
    acting = []
    for command, side in ((port, 1.0 - p[BALANCE]), (starboard, 1.0 + p[BALANCE])):
        thrust = side * thrust_curve(command, p[GAIN], p[REVERSE_RATIO], p[DEAD_BAND], p[EXPONENT])
        acting.append(lagged(delayed(thrust, p[DELAY], step), p[LAG], step))
    return tuple(acting)
