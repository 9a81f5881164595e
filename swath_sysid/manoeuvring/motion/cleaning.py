"""Removes disorder in time, absurd values, spikes, and channels that never change from trials."""

from dataclasses import replace
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import spikes
from swath_sysid.manoeuvring.motion.trial import CHANNELS, MEASURED, ManoeuvringTrial

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
