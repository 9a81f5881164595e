"""Forecasts while the motion changes at once: waves that begin, a turn, a motion that doubles, halves or ends.

    OMP_NUM_THREADS=1 python benchmark/shocks.py
    OMP_NUM_THREADS=1 python benchmark/shocks.py onset halved --change 300

The motion is the moored buoy's, angles and rates. For each change, axis and span of periods after it: root mean square
error over the standard deviation of the motion of then, how often the 90 % intervals held, and the standard deviation
issued over that of the motion; the warm buoy in its last line. Records are read from the folder that SWATH_SYSID_DATA
names.
"""

import argparse

import numpy as np
from record_forecasts import buoy

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.pipeline.record_run import run_through

LEADS = 0.5, 1.0, 2.0, 5.0
PERIOD = 3.3  #: s; of the buoy.
SPANS = (0.0, 0.25), (0.25, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 8.0), (8.0, 16.0), (16.0, 40.0)
STILL = np.radians(0.002)


#: What follows a change, of the motion (N, 4) that would have come without it and that of a still craft.
CHANGES = {
    'onset': lambda after, still: after,
    'turn': lambda after, still: after[:, [1, 0, 3, 2]],
    'doubled': lambda after, still: 2.0 * after,
    'halved': lambda after, still: 0.5 * after,
    'rest': lambda after, still: still,
    'none': lambda after, still: after,
}


def motion_of_buoy():
    """Its angles and rates about their means (N, 4), ten a second."""
    trial = buoy()
    motion = np.stack([trial.channels[name] for name in ATTITUDE], axis=1)
    return np.nan_to_num(motion - np.nanmean(motion, axis=0))


def changed(motion, kind, row, seed=0):
    """The motion with a change at a row."""
    still = np.random.default_rng(seed).normal(size=motion.shape) * STILL * np.array([1.0, 1.0, 3.0, 3.0])
    before = still if kind == 'onset' else motion
    return np.vstack([before[:row], CHANGES[kind](motion[row:], still[row:])])


def scores(motion, start):
    """Periods after the change (N,), errors (2, N, L) and standard deviations over the later motion's."""
    time = 0.1 * np.arange(len(motion))
    trial = Trial(time, **dict(zip(ATTITUDE, motion.T, strict=True)))
    issued = [step for step in run_through(trial, ForecasterSettings(LEADS)).steps if step.forecast is not None]
    size = np.maximum(motion[start:, : len(AXES)].std(axis=0), STILL)[:, None]
    stamps = np.array([step.stamp for step in issued])
    errors, deviations = [], []
    for step in issued:
        truth = [np.interp(step.stamp + np.array(LEADS), time, trial.channels[axis], right=np.nan) for axis in AXES]
        errors.append((np.array([step.forecast.angle(axis) for axis in AXES]) - truth) / size)
        deviations.append(step.forecast.deviation[:, : len(AXES)].T / size)
    return (stamps - time[start]) / PERIOD, np.array(errors), np.array(deviations)


def main() -> None:
    """Print a line for each change, axis and span."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('changes', nargs='*', default=[*CHANGES], help=f'of {", ".join(CHANGES)} (default: all)')
    parser.add_argument('--change', type=float, default=100.0, help='s after the first sample')
    parser.add_argument('--starts', type=int, default=6, help='at different times of the record')
    given = parser.parse_args()
    if unknown := set(given.changes) - set(CHANGES):
        parser.error(f'{", ".join(sorted(unknown))} is none of {", ".join(CHANGES)}')
    row, length = round(10.0 * given.change), round(10.0 * (given.change + SPANS[-1][1] * PERIOD))
    whole = motion_of_buoy()
    starts = np.linspace(0, len(whole) - length, given.starts).astype(int)
    print(f'leads {LEADS} s; error | held | stated, over the motion')
    for kind in given.changes:
        at, errors, deviations = (
            np.concatenate(parts)
            for parts in zip(
                *(scores(changed(whole[start : start + length], kind, row), row) for start in starts), strict=True
            )
        )
        for axis, name in enumerate(AXES):
            for begin, end in SPANS:
                of_span = (at >= begin) & (at < end)
                error, deviation = errors[of_span, axis], deviations[of_span, axis]
                known = np.isfinite(error)
                held = [
                    np.mean((np.abs(e) < 1.645 * d)[k]) for e, d, k in zip(error.T, deviation.T, known.T, strict=True)
                ]
                rms, wide = np.sqrt(np.nanmean(error**2, axis=0)), np.nanmean(deviation, axis=0)
                parts = (' '.join(f'{value:5.2f}' for value in values) for values in (rms, held, wide))
                print(f'{kind:8} {name:5} {begin:5.2f} to {end:5.2f} | ' + ' | '.join(parts), flush=True)


if __name__ == '__main__':
    main()
