"""Manoeuvring trials: what the sensors and thrusters of a twin-thruster craft recorded, as read and made ready."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.common.advice import Advice

FORCE, COMMAND = 'force', 'command'
CHANNELS = ('surge', 'sway', 'yaw_rate')
POSE = ('heading', 'x', 'y')
MEASURED = CHANNELS + POSE


@dataclass(frozen=True)
class ManoeuvringTrial:
    """A record as it was read; arrays of shape (N,), None where not measured, NaN where missing.

    Attributes
    ----------
    time : ndarray
        s.
    port, starboard : ndarray
        Thrust, N, or normalised commands, positive ahead.
    thrust_input : str
        ``force`` or ``command``.
    surge, sway : ndarray or None
        Over ground in body axes, m/s.
    yaw_rate, heading : ndarray or None
        rad/s, rad.
    x, y : ndarray or None
        m; in NED x is north and y east, in ENU x is east and y north.
    frame : str or None
        ``enu`` (y and sway to port, yaw to port positive), ``ned`` (to starboard), None: not stated.
    lever : float or None
        Half the distance between the thrusters, m, where stated.
    length : float or None
        Of the hulls, m, where stated.
    """

    time: np.ndarray
    port: np.ndarray
    starboard: np.ndarray
    thrust_input: str = FORCE
    surge: np.ndarray | None = None
    sway: np.ndarray | None = None
    yaw_rate: np.ndarray | None = None
    heading: np.ndarray | None = None
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    frame: str | None = None
    lever: float | None = None
    length: float | None = None
    source: str = ''
    advice: tuple[Advice, ...] = ()

    def measured(self) -> dict[str, np.ndarray]:
        """The channels that it holds, by name."""
        return {name: getattr(self, name) for name in MEASURED if getattr(self, name) is not None}


@dataclass(frozen=True)
class Run:
    """A record in even steps, ready for identification; arrays of shape (N,).

    Attributes
    ----------
    step : float
        s.
    time : ndarray
        s, as recorded.
    port, starboard : ndarray
        Held over the step that follows; zero where unknown.
    driven : ndarray of bool
        Where the thrust is known.
    surge, sway, yaw_rate : ndarray
        Over ground, m/s and rad/s, NaN where not measured.
    heading, x, y : ndarray or None
        rad (not wrapped) and m, without gaps; None where not measured.
    smooth : ndarray, shape (3, N)
        Smoothed surge, sway, yaw rate, NaN where none was measured.
    """

    step: float
    time: np.ndarray
    port: np.ndarray
    starboard: np.ndarray
    driven: np.ndarray
    surge: np.ndarray
    sway: np.ndarray
    yaw_rate: np.ndarray
    heading: np.ndarray | None
    x: np.ndarray | None
    y: np.ndarray | None
    smooth: np.ndarray
    thrust_input: str = FORCE
    source: str = ''
    lever: float | None = None
    length: float | None = None
    advice: tuple[Advice, ...] = ()

    @property
    def channels(self) -> np.ndarray:
        """Surge, sway and yaw rate, shape (3, N)."""
        return np.stack([self.surge, self.sway, self.yaw_rate])

    @property
    def duration(self) -> float:
        """s."""
        return float(self.time[-1] - self.time[0])
