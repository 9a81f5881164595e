"""From trials to runs ready for identification; diagnoses use all trials together."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.motion import resampling
from swath_sysid.manoeuvring.motion.polarity import aligned, set_right
from swath_sysid.manoeuvring.motion.trial import (
    CHANNELS,
    POSE,
    STEP,
    CraftRun,
    ManoeuvringTrial,
    cleaned,
    turned,
    without_constant,
)


def prepare(trial: ManoeuvringTrial, gap_means_zero: bool = False, step: float | None = None) -> CraftRun:
    """Make one trial ready for identification; see `prepare_runs`."""
    return prepare_runs([trial], gap_means_zero, step)[0]


def prepare_runs(
    trials: Sequence[ManoeuvringTrial], gap_means_zero: bool = False, step: float | None = None
) -> list[CraftRun]:
    """Make trials of one craft ready for identification, in steps of the records, or of ``STEP``, s.

    Reversed and swapped channels, constant ones and a compass askew are found over all trials together.

    Args:
        trials: As read, of forces or of normalised commands.
        gap_means_zero: Commands are published only while driving: where there are none the thrust is zero.
        step: s, of all runs; by default that of the records, if it is near ``STEP``.

    Returns:
        One run for each trial, in even steps, with advice on what was set right.

    Raises:
        InputError: No trial, too few samples, no thrust, or neither speed nor yaw rate in one of them.

    Example:
        >>> runs = prepare_runs([read_manoeuvring_csv('runs/zigzag_20.csv'), read_manoeuvring_csv('runs/mixed.csv')])
        >>> [run.step for run in runs]
        [0.1, 0.1]
    """
    if not trials:
        raise InputError('there is no trial to prepare: give at least one')
    advice = [list(trial.advice) for trial in trials]
    trials = without_constant([cleaned(t, a) for t, a in zip(trials, advice, strict=True)], advice)
    trials = aligned(set_right(trials, advice), advice)
    if step is None:
        interval = float(np.median([np.median(np.diff(trial.time)) for trial in trials]))
        step = round(interval if 0.04 <= interval <= 0.25 else STEP, 3)
    return [_run(t, gap_means_zero, step, a) for t, a in zip(trials, advice, strict=True)]


def _run(trial: ManoeuvringTrial, gap_means_zero: bool, step: float, advice: list[Advice]):
    """The run of a corrected trial."""
    count = int((trial.time[-1] - trial.time[0]) / step) + 1
    if count < 20:
        raise InputError(f'{trial.source}: {trial.time[-1] - trial.time[0]:.1f} s are too short: record 30 s or more')
    grid = trial.time[0] + step * np.arange(count)
    port, starboard, driven = resampling.thrust_on(grid, trial, gap_means_zero, advice)
    measured = {}
    for name, values in trial.measured().items():
        if np.isfinite(values).sum() >= 4:
            if name == 'heading':
                values = resampling.unwrapped(values)
            fresh = resampling.without_held(name, values, advice, trial.source)
            measured[name] = resampling.on_grid(grid, step, trial.time, fresh)
    pose: dict[str, Any] = {name: resampling.bridged(measured[name]) if name in measured else None for name in POSE}
    if pose['heading'] is not None:
        pose['heading'] = np.unwrap(pose['heading'])
    _derive_channels(measured, pose, step, advice, trial.source)
    if not any(name in measured for name in ('surge', 'yaw_rate')):
        raise InputError(
            f'{trial.source} holds neither speed nor yaw rate, nor heading and position to derive them '
            f'from: add surge_m_s or yaw_rate_rad_s'
        )
    nothing = np.full(count, np.nan)
    surge, sway, yaw_rate = (measured.get(name, nothing) for name in CHANNELS)
    smooth = np.stack([resampling.smoothed(c, step) for c in (surge, sway, yaw_rate)])
    same: dict[str, Any] = {name: getattr(trial, name) for name in ('thrust_input', 'source', 'lever', 'length')}
    same |= pose
    return CraftRun(
        step, grid, port, starboard, driven, surge, sway, yaw_rate, smooth=smooth, advice=tuple(advice), **same
    )


def _derive_channels(measured: dict, pose: dict, step: float, advice: list[Advice], source: str):
    """Yaw rate from heading, speeds from position and heading, where they were not measured."""
    heading, x, y = (pose[name] for name in POSE)
    if 'yaw_rate' not in measured and heading is not None:
        measured['yaw_rate'] = resampling.slope(heading, step, 1.1)
        advice.append(Advice.of('yaw-rate-derived', source=source))
    if heading is None or x is None or y is None or ('surge' in measured and 'sway' in measured):
        return
    east, north = (resampling.slope(each, step, 2.1) for each in (x, y))
    derived = dict(zip(CHANNELS, turned(east, north, heading), strict=False))
    missing = [name for name in derived if name not in measured]
    measured.update({name: derived[name] for name in missing})
    advice.append(Advice.of('speed-derived', source=source, missing=' and no '.join(missing)))
