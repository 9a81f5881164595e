"""Manoeuvring trials of a twin-thruster craft as recorded, as cleaned, and as prepared runs."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import spikes

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
class CraftRun:
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


ABSURD = {'surge': 50.0, 'sway': 50.0, 'yaw_rate': 10.0, 'x': 1e8, 'y': 1e8, 'heading': 1e6}


def cleaned(trial: ManoeuvringTrial, advice: list[Advice]) -> ManoeuvringTrial:
    """The trial in order of time, absurd values and spikes set to NaN; appends to ``advice``."""
    return _without_spikes(_without_absurd(_in_order(trial, advice), advice), advice)


def without_constant(trials: list[ManoeuvringTrial], advice: list[list[Advice]]) -> list[ManoeuvringTrial]:
    """Trials without speeds and yaw rates that are constant in all of them, which nothing measured."""
    for name in CHANNELS:
        holding = [k for k, trial in enumerate(trials) if getattr(trial, name) is not None]
        values = [getattr(trials[k], name) for k in holding]
        if not holding or any(np.nanmin(v) != np.nanmax(v) for v in values):
            continue
        for k in holding:
            trials[k] = _with(trials[k], name, None)
            advice[k].append(Advice.of('constant-channel', source=trials[k].source, name=name))
    return trials


def _with(trial: ManoeuvringTrial, name: str, values: np.ndarray | None) -> ManoeuvringTrial:
    channel: dict[str, Any] = {name: values}
    return replace(trial, **channel)


def _in_order(trial: ManoeuvringTrial, advice: list[Advice]):
    """Samples in order of time, without repeated or unreadable stamps."""
    time = np.asarray(trial.time, dtype=float)
    good = np.isfinite(time)
    latest = np.maximum.accumulate(np.where(good, time, -np.inf))
    good &= np.concatenate([[True], time[1:] > latest[:-1]])
    if good.sum() < 20:
        raise InputError(f'{trial.source} holds {int(good.sum())} samples in order of time: record 30 s or more')
    if not good.all():
        advice.append(Advice.of('time-disorder', source=trial.source, number=int((~good).sum())))
    for name in ('port', 'starboard', *MEASURED):
        values = getattr(trial, name)
        if values is not None:
            trial = _with(trial, name, np.asarray(values, dtype=float)[good])
    return replace(trial, time=time[good])


def _without_absurd(trial: ManoeuvringTrial, advice: list[Advice]):
    for name, values in trial.measured().items():
        with np.errstate(invalid='ignore'):
            bad = ~(np.abs(values) <= ABSURD[name])
        if bad.all():
            trial = _with(trial, name, None)
            advice.append(Advice.of('empty-channel: run', source=trial.source, name=name))
            continue
        wild = int(np.sum(bad & np.isfinite(values)))
        if wild:
            limit = ABSURD[name]
            advice.append(Advice.of('absurd-values: run', source=trial.source, number=wild, name=name, limit=limit))
        trial = _with(trial, name, np.where(bad, np.nan, values))
    rows = int(np.sum(np.all([~np.isfinite(values) for values in trial.measured().values()], axis=0)))
    if rows:
        advice.append(Advice.of('missing-rows', source=trial.source, number=rows))
    return trial


def _without_spikes(trial: ManoeuvringTrial, advice: list[Advice]):
    """Sets samples far outside their neighbourhood to NaN."""
    for name, values in trial.measured().items():
        known = np.flatnonzero(np.isfinite(values))
        struck = known[spikes(np.unwrap(values[known]) if name == 'heading' else values[known])]
        if struck.size:
            advice.append(Advice.of('spikes: run', source=trial.source, number=struck.size, name=name))
            values = values.copy()
            values[struck] = np.nan
            trial = _with(trial, name, values)
    return trial
