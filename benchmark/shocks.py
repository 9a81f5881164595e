"""Forecasts while the motion changes at once: waves that begin, a turn, a motion that doubles, halves or ends.

    OMP_NUM_THREADS=1 python benchmark/shocks.py
    OMP_NUM_THREADS=1 python benchmark/shocks.py onset halved --change 300
    OMP_NUM_THREADS=1 python benchmark/shocks.py --craft stiff

The motion is the moored buoy's, angles and rates, or that of simulated craft in waves, whose hull is not known, known,
or taken to be twice as stiff. For each change, axis and span of periods after it: root mean square error over that of
the mean, coverage of the 90 % intervals, and the standard deviation issued over that of the motion after the change;
the steady motion in the last lines. Records are read from the folder that SWATH_SYSID_DATA names.
"""

from typing import Annotated

import numpy as np
from record_forecasts import buoy
from restarts import NOISE, Waves, hulls

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.evaluation.cli.benchmark import Benchmark, LeadErrors, Line
from swath_sysid.pipeline.record_run import run_through

LEADS = 0.5, 1.0, 2.0, 5.0
PERIOD = 3.3  #: s; of the buoy, and about that of the craft.
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


#: The hulls that are known, by craft; the buoy has none.
CRAFTS = {'buoy': {}, 'unknown': {}, 'known': hulls(), 'stiff': hulls(2.0)}


def stretches_of_buoy(count, length):
    """Its angles and rates about their means (N, 4), ten a second, from several times on."""
    trial = buoy()
    motion = np.stack([trial.channels[name] for name in ATTITUDE], axis=1)
    motion = np.nan_to_num(motion - np.nanmean(motion, axis=0))
    return [motion[start : start + length] for start in np.linspace(0, len(motion) - length, count).astype(int)]


def motion_of_craft(seed, length):
    """Angles and rates (N, 4) of a linear craft in waves, as they are measured ten times a second."""
    waves, time = Waves(seed), 0.1 * np.arange(length)
    noise = np.random.default_rng(seed).normal(size=(length, 4)) * np.repeat([NOISE['angle'], NOISE['rate']], 2)
    return np.stack([waves.motion(axis, time, order) for order in (0, 1) for axis in AXES], axis=1) + noise


def changed(motion, kind, row, seed=0):
    """The motion with a change at a row."""
    still = np.random.default_rng(seed).normal(size=motion.shape) * STILL * np.array([1.0, 1.0, 3.0, 3.0])
    before = still if kind == 'onset' else motion
    return np.vstack([before[:row], CHANGES[kind](motion[row:], still[row:])])


def scores(motion, start, models):
    """Periods after the change (N,), errors, those of the mean and standard deviations (N, 2, L) over the motion's."""
    time = 0.1 * np.arange(len(motion))
    trial = Trial(time, **dict(zip(ATTITUDE, motion.T, strict=True)))
    issued = [step for step in run_through(trial, ForecasterSettings(LEADS), models).steps if step.forecast is not None]
    size = np.maximum(motion[start:, : len(AXES)].std(axis=0), STILL)[:, None]
    stamps = np.array([step.stamp for step in issued])
    errors, of_mean, deviations = [], [], []
    for step in issued:
        truth = [np.interp(step.stamp + np.array(LEADS), time, trial.channels[axis], right=np.nan) for axis in AXES]
        errors.append((np.array([step.forecast.angle(axis) for axis in AXES]) - truth) / size)
        of_mean.append(truth / size)
        deviations.append(step.forecast.deviation[:, : len(AXES)].T / size)
    return (stamps - time[start]) / PERIOD, np.array(errors), np.array(of_mean), np.array(deviations)


def lines(
    *changes: Annotated[str, CHANGES, f'of {", ".join(CHANGES)} (default: all)'],
    change: Annotated[float, 's after the first sample'] = 100.0,
    starts: Annotated[int, 'at different times of the record'] = 6,
    craft: Annotated[str, CRAFTS] = 'buoy',
):
    """A line for each change, axis and span."""
    row, length = round(10.0 * change), round(10.0 * (change + SPANS[-1][1] * PERIOD))
    if craft == 'buoy':
        motions = stretches_of_buoy(starts, length)
    else:
        motions = [motion_of_craft(seed, length) for seed in range(starts)]
    yield f'leads {LEADS} s; error over that of the mean | held | stated, over the motion'
    for kind in changes or CHANGES:
        runs = (scores(changed(motion, kind, row), row, CRAFTS[craft]) for motion in motions)
        at, errors, of_mean, deviations = (np.concatenate(parts) for parts in zip(*runs, strict=True))
        for place, name in enumerate(AXES):
            for begin, end in SPANS:
                found, mean = (
                    LeadErrors(at, each[:, place], deviations[:, place]).within(begin, end)
                    for each in (errors, of_mean)
                )
                rms = np.sqrt(np.nanmean(found.error**2, axis=0) / np.nanmean(mean.error**2, axis=0))
                figures = {'error': rms, 'held': found.held, 'stated': found.deviation.mean(axis=0)}
                yield Line(f'{kind:8} {name:5} {begin:5.2f} to {end:5.2f}', figures)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
