"""Forecasts of measured records, every one counted: whole, with losses, from the first second, after a change of sea.

    OMP_NUM_THREADS=1 python benchmark/record_forecasts.py
    OMP_NUM_THREADS=1 python benchmark/record_forecasts.py morro lost-5 ship

For each axis: root mean square error over the standard deviation of the motion; the best baseline, by name, and the
error over it with a 95 % interval; the best of persistence, constant rate and mean; how often the 90 % intervals held.
Records are read from the folder that SWATH_SYSID_DATA names.
"""

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from sea_forecasts import make_sea

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.evaluation.scoring import FORECAST, score
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

DATA = Path(os.environ.get('SWATH_SYSID_DATA', Path(__file__).resolve().parents[2] / 'shared' / 'data'))
BUOY, SHIP = 'waves/morro_buoy.csv', 'waves/nbp1406_ship.csv'
BUOY_LEADS, SHIP_LEADS = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0), (1.0, 2.0, 3.0, 5.0, 8.0, 10.0, 15.0)
SIMPLE = ('persistence', 'constant_rate', 'mean')
WARMUP, WINDOW = 600.0, 190.0
FIRST = ((0.0, 60.0), (0.0, 20.0), (20.0, 40.0), (40.0, 60.0))
SPLICE = 900.0
"""s of the buoy before its sea changes."""

AFTER_SPLICE = ((0.0, 60.0), (0.0, 20.0), (20.0, 40.0), (40.0, 60.0), (60.0, 120.0), (300.0, math.inf))
SEAS = 1, 2
SEA_DURATION = 600.0


def run_of(trial, leads):
    """The forecaster run through a record, as `swath-sysid forecast` does without a hull."""
    settings = ForecasterSettings()
    settings = replace(settings, leads=leads, window=WINDOW, horizon=max(settings.horizon, leads[-1]))
    return run_through(trial, settings, {})


def buoy(mounting=(0.0, 0.0, 0.0)):
    """The moored buoy, its axes turned if asked."""
    return read_trial(DATA / BUOY, frame='frd', mounting=mounting)


def only(trial, kept):
    """The samples of a trial that a mask keeps."""
    return replace(trial, time=trial.time[kept], **{name: values[kept] for name, values in trial.channels.items()})


def without_samples(trial, count, every=20.0):
    """A trial that lost this many samples each `every` seconds."""
    interval = np.median(np.diff(trial.time))
    return only(trial, np.remainder(trial.time - trial.time[0], every) > (count - 0.5) * interval)


def spliced(first, second):
    """One trial and then another, at the same interval, in the channels that both hold."""
    names = [name for name in first.channels if name in second.channels]
    later = second.time - second.time[0] + first.time[-1] + np.median(np.diff(first.time))
    joined = {name: np.concatenate([first.channels[name], second.channels[name]]) for name in names}
    return Trial(np.concatenate([first.time, later]), **joined, source=f'{first.source}, then {second.source}')


def buoy_that_turned(back=False):
    """The buoy with the sea from ahead and then, turned by a quarter, from the side; or the other way round."""
    quarter = (0.0, 0.0, math.pi / 2)
    first, second = (buoy(quarter), buoy()) if back else (buoy(), buoy(quarter))
    return spliced(only(first, first.time < SPLICE), only(second, second.time >= SPLICE))


def two_seas():
    """The published roll hull in one simulated sea and then in another, at 10 Hz."""
    seas = [make_sea(seed, SEA_DURATION) for seed in SEAS]
    time = 0.1 * np.arange(round(10.0 * SEA_DURATION))
    readings = [sea.readings(10.0) for sea in seas]
    return spliced(*(Trial(time, roll=seen[:, 0], roll_rate=seen[:, 1], source='simulation') for seen in readings))


def whole_buoy():
    """The buoy as it is."""
    yield from scored('buoy', buoy(), BUOY_LEADS, [(WARMUP, math.inf)])


def buoy_with_losses(count):
    """The buoy with samples lost, beside the buoy as it is."""
    trial = buoy()
    whole = score(trial, run_of(trial, BUOY_LEADS), BUOY_LEADS, WARMUP, WINDOW)
    name = f'buoy, {count} samples lost every 20 s'
    yield from scored(name, without_samples(trial, count), BUOY_LEADS, [(WARMUP, math.inf)], whole)


def ship():
    """The ship after short and long warm-ups."""
    spans = [(warmup, math.inf) for warmup in (60.0, 120.0, 300.0, 600.0)]
    yield from scored('ship', read_trial(DATA / SHIP), SHIP_LEADS, spans)


def first_minute():
    """The first minute of every record."""
    yield from scored('buoy', only(buoy(), buoy().time < 90.0), BUOY_LEADS, FIRST)
    trial = read_trial(DATA / SHIP)
    yield from scored('ship', only(trial, trial.time < 90.0), SHIP_LEADS, FIRST)


def change_of_sea():
    """The minutes after a change of sea, and the steady state long after."""
    for name, trial, splice in (
        ('buoy, then turned by 90 deg', buoy_that_turned(), SPLICE),
        ('buoy turned by 90 deg, then back', buoy_that_turned(back=True), SPLICE),
        ('simulated roll, then another sea', two_seas(), SEA_DURATION),
    ):
        yield from scored(name, trial, BUOY_LEADS, [(splice + begin, splice + end) for begin, end in AFTER_SPLICE])


CASES = {
    'morro': whole_buoy,
    'lost-5': lambda: buoy_with_losses(5),
    'lost-20': lambda: buoy_with_losses(20),
    'ship': ship,
    'first': first_minute,
    'splice': change_of_sea,
}


def scored(name, trial, leads, spans, whole=None):
    """The scores of spans of a record, s from its start, run through once."""
    run, duration = run_of(trial, leads), trial.time[-1] - trial.time[0]
    for begin, end in spans:
        skill = score(trial, run, leads, begin, WINDOW, min(end, duration))
        for axis, scores in skill.axes.items():
            yield f'\n{name}, {axis}, from {begin:g} to {skill.until:.0f} s, {scores.counted[0]} forecasts'
            yield _row('lead, s', [f'{lead:g}' for lead in leads])
            yield _row('forecast', scores.nrmse[FORECAST])
            yield _row('best baseline', list(scores.best))
            yield _row('  its error', [scores.nrmse[best][i] for i, best in enumerate(scores.best)])
            yield _row('over the best baseline', scores.ratio)
            if np.isfinite(scores.ratio_interval).all():
                yield _row('  95 % interval', [f'{low:.3f}-{high:.3f}' for low, high in scores.ratio_interval])
            yield _row(
                'over the best simple', scores.nrmse[FORECAST] / np.min([scores.nrmse[n] for n in SIMPLE], axis=0)
            )
            yield _row('90 % held', scores.coverage[:, 1])
            if np.nan_to_num(scores.gap_share).any():
                yield _row('issued 4 s after a gap', scores.gap_share)
                for method, values in scores.gap_nrmse.items():
                    yield _row(f'{method} there', values)
            if whole is not None:
                yield _row('over the whole record', scores.nrmse[FORECAST] / whole.axes[axis].nrmse[FORECAST])
                yield _row('after a gap over it', scores.gap_nrmse[FORECAST] / whole.axes[axis].nrmse[FORECAST])


def _row(name, cells):
    texts = (cell if isinstance(cell, str) else f'{cell:.4f}' for cell in cells)
    return f'{name:24} ' + ' '.join(f'{text:>13}' for text in texts)


def lines(*cases: Annotated[str, CASES, f'of {", ".join(CASES)}']):
    """The scores of the cases asked for."""
    for case in cases or CASES:
        yield from CASES[case]()


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
