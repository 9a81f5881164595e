"""Manoeuvring trials of a twin-thruster craft, as recorded and as prepared runs."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.common.advice import Advice

FORCE, COMMAND = 'force', 'command'
INPUTS = (FORCE, COMMAND)
STEP = 0.1  #: s; usual step of runs, simulations and filters.
CHANNELS = ('surge', 'sway', 'yaw_rate')
POSE = ('heading', 'x', 'y')
MEASURED = CHANNELS + POSE


@dataclass(frozen=True)
class ManoeuvringTrial:
    """A record as it was read; arrays of shape (N,), None where not measured, NaN where missing."""

    time: np.ndarray  #: s.
    port: np.ndarray  #: Thrust, N, or normalised commands, positive ahead.
    starboard: np.ndarray  #: Thrust, N, or normalised commands, positive ahead.
    thrust_input: str = FORCE  #: ``force`` or ``command``.
    surge: np.ndarray | None = None  #: Over ground in body axes, m/s.
    sway: np.ndarray | None = None  #: Over ground in body axes, m/s.
    yaw_rate: np.ndarray | None = None  #: rad/s.
    heading: np.ndarray | None = None  #: rad.
    x: np.ndarray | None = None  #: m; east in ENU, north in NED.
    y: np.ndarray | None = None  #: m; north in ENU, east in NED.
    frame: str | None = None  #: ``enu`` (y, sway and yaw positive to port), ``ned`` (to starboard), None: not stated.
    lever: float | None = None  #: Half the distance between the thrusters, m, where stated.
    length: float | None = None  #: Of the hulls, m, where stated.
    source: str = ''
    advice: tuple[Advice, ...] = ()

    def measured(self) -> dict[str, np.ndarray]:
        """The measured channels by name."""
        return {name: getattr(self, name) for name in MEASURED if getattr(self, name) is not None}


@dataclass(frozen=True)
class Run:
    """A record in even steps, ready for identification; arrays of shape (N,)."""

    step: float  #: s.
    time: np.ndarray  #: s, as recorded.
    port: np.ndarray  #: Held over the step that follows; zero where unknown.
    starboard: np.ndarray  #: Held over the step that follows; zero where unknown.
    driven: np.ndarray  #: Where the thrust is known.
    surge: np.ndarray  #: Over ground, m/s, NaN where not measured.
    sway: np.ndarray  #: Over ground, m/s, NaN where not measured.
    yaw_rate: np.ndarray  #: rad/s, NaN where not measured.
    heading: np.ndarray | None  #: rad, not wrapped, without gaps; None where not measured.
    x: np.ndarray | None  #: m, without gaps; None where not measured.
    y: np.ndarray | None  #: m, without gaps; None where not measured.
    smooth: np.ndarray  #: (3, N); Smoothed surge, sway, yaw rate, NaN where not measured.
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


def turned(
    ahead: float | np.ndarray, aside: float | np.ndarray, angle: float | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Components of a vector in axes turned to port by an angle, rad."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return ahead * cosine + aside * sine, aside * cosine - ahead * sine
