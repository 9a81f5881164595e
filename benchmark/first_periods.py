"""Forecasts in the first periods of motion, by the periods since the first sample, from many starts of records.

    OMP_NUM_THREADS=1 python benchmark/first_periods.py
    OMP_NUM_THREADS=1 python benchmark/first_periods.py morro minute --time 0.1

For each axis and span: root mean square error over the standard deviation of the motion, the same of the running mean,
and how often the 90 % intervals held. Leads are multiples of a fourteenth of a period, in whole samples. `minute`
scores 20 to 90 s of ships at 1 Hz against regressions, `flume` a model in regular waves that grow out of calm water.
Records are read from the folder that SWATH_SYSID_DATA names and from `field` beside it.
"""

from dataclasses import replace
from itertools import chain
from typing import Annotated

import numpy as np
from record_forecasts import BUOY, DATA, SHIP, only
from scipy.signal import welch

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.evaluation.baselines import Record, baseline_forecasts, running_regression
from swath_sysid.evaluation.cli.benchmark import HALF_90, Benchmark
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

LEADS = 1, 2, 4, 7, 10, 14, 21, 28
PERIODS = (0.25, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 9.0)
STARTS, PERIODS_BETWEEN = 12, 6
MINUTE = (20.0, 90.0)
FLUME = {'growing': (28.0, 33.0), 'regular': (33.0, 46.0)}
ATTITUDE = ('roll', 'pitch', 'roll_rate', 'pitch_rate')


def buoy():
    """The moored buoy, angles and rates."""
    trial = read_trial(DATA / BUOY, frame='frd')
    return Trial(trial.time, **{name: trial.channels[name] for name in ATTITUDE})


def ship():
    """A ship at 1 Hz, angles alone."""
    trial = read_trial(DATA / SHIP, frame='frd')
    return Trial(trial.time, **{name: trial.channels[name] for name in AXES})


def other_ship():
    """Another ship at 1 Hz, angles alone."""
    angles = np.radians(0.01 * np.loadtxt(DATA.parent / 'field' / 'hakusan_hundredths.txt', skiprows=2, usecols=(1, 2)))
    return Trial(np.arange(float(len(angles))), roll=angles[:, 0], pitch=angles[:, 1])


def slower(trial, factor):
    """The same motion, so many times as slow."""
    slowed = {name: values / factor if name.endswith('_rate') else values for name, values in trial.channels.items()}
    return replace(trial, time=factor * trial.time, **slowed)


def forecasts(trial, axis, leads):
    """Stamps (N,), s, and angle and its standard deviation (N, L), rad, as forecast from a trial's first sample on."""
    rate = 1.0 / np.median(np.diff(trial.time))
    settings = ForecasterSettings(tuple(leads), horizon=leads[-1], horizon_step=leads[-1], forecast_rate=rate)
    issued = [(step.stamp, step.forecast) for step in run_through(trial, settings).steps]
    place = AXES.index(axis)
    return (
        np.array([stamp for stamp, _ in issued]),
        np.array([forecast.angle(axis) for _, forecast in issued]),
        np.array([forecast.deviation[:, place] for _, forecast in issued]),
    )


def between(trial, begin, end):
    """The samples of a trial between two times, s."""
    return only(trial, (trial.time >= begin - 1e-6) & (trial.time <= end + 1e-6))


def truth_at(trial, axis, times):
    """The angle at times, s; NaN beyond the record."""
    known = np.isfinite(trial.channels[axis])
    return np.interp(times, trial.time[known], trial.channels[axis][known], left=np.nan, right=np.nan)


def line_of(name, cells):
    """One line of the table."""
    return f'{name:28} ' + ' '.join(f'{cell:8.3f}' for cell in cells)


def report(name, size, **errors):
    """Root mean squares of errors (N, L) over the size; how often ``held`` (N, L)."""
    for method, values in errors.items():
        mean = np.nanmean(values, axis=0) if method == 'held' else np.sqrt(np.nanmean(values**2, axis=0)) / size
        yield line_of(f'{name} {method}', mean)


def first_periods(name, trial, factor):
    """From a dozen starts, by the periods since each."""
    trial = slower(trial, factor)
    interval = np.median(np.diff(trial.time))
    for axis in AXES:
        even = truth_at(trial, axis, np.arange(trial.time[0], trial.time[-1], interval))
        frequency, power = welch(even, 1.0 / interval, nperseg=min(1024, even.size // 2))
        period = power[1:].sum() / (power * frequency)[1:].sum()
        leads = interval * max(1, round(period / interval / 14.0)) * np.array(LEADS)
        length = PERIODS[-1][1] * period
        starts = trial.time[0] + PERIODS_BETWEEN * period * np.arange(STARTS)
        parts = [
            between(trial, start, start + length) for start in starts if start + length + leads[-1] < trial.time[-1]
        ]
        ages, found = [], {'forecast': [], 'mean': [], 'held': []}
        for part in parts:
            stamps, mean, deviation = forecasts(part, axis, leads)
            truth = truth_at(trial, axis, stamps[:, None] + leads)
            so_far = [np.nanmean(part.channels[axis][part.time <= stamp]) for stamp in stamps]
            ages.append((stamps - part.time[0]) / period)
            found['forecast'].append(mean - truth)
            found['mean'].append(np.array(so_far)[:, None] - truth)
            found['held'].append(np.abs(mean - truth) <= HALF_90 * deviation)
        age = np.concatenate(ages)
        yield f'\n{name}, {axis}, period {period:.3g} s, {len(parts)} starts'
        yield line_of('lead over period', leads / period)
        for begin, end in PERIODS:
            now = (age >= begin - 1e-9) & (age < end)
            chosen = {method: np.concatenate(values)[now] for method, values in found.items()}
            yield from report(f'{begin:g} to {end:g} periods', np.nanstd(even), **chosen)


def minute(name, trial):
    """From ten starts a minute apart, beside the best of mean and regressions of the same past."""
    leads = np.arange(1.0, 11.0)
    for axis in AXES:
        errors, held = {}, []
        for start in trial.time[0] + 60.0 * np.arange(10.0):
            part = between(trial, start, start + MINUTE[1])
            stamps, mean, deviation = forecasts(part, axis, leads)
            late = stamps >= start + MINUTE[0]
            stamps, mean, deviation = stamps[late], mean[late], deviation[late]
            truth = truth_at(trial, axis, stamps[:, None] + leads)
            record = Record.of(part)
            place = record.names.index(axis)
            others = baseline_forecasts(record, [axis], stamps, leads, MINUTE[1])[axis]
            others['ar_5'] = running_regression(record, [place], [place], 5, stamps, leads, MINUTE[1])[:, :, 0]
            for method in ('ar_5', 'ar_40', 'var_40', 'mean'):
                errors.setdefault(method, []).append(others[method] - truth)
            errors.setdefault('forecast', []).append(mean - truth)
            held.append(np.abs(mean - truth) <= HALF_90 * deviation)
        yield f'\n{name}, {axis}, {MINUTE[0]:g} to {MINUTE[1]:g} s after ten starts, leads of 1 to 10 s'
        square = {method: np.nanmean(np.concatenate(values) ** 2, axis=0) for method, values in errors.items()}
        forecast = np.sqrt(square.pop('forecast'))
        yield line_of('forecast', forecast / np.nanstd(trial.channels[axis]))
        yield line_of('over the best of the others', forecast / np.sqrt(np.min(list(square.values()), axis=0)))
        yield line_of('held', np.concatenate(held).mean(axis=0))


def flume():
    """Regular waves: at the sensor's rate, at a tenth of it, and eight times as slow."""
    whole = read_trial(DATA.parent / 'field' / 'flume_6041_1_200hz.csv')
    tenth = only(whole, np.arange(whole.time.size) % 10 == 0)
    for name, trial, factor in (('200 Hz', whole, 1.0), ('20 Hz', tenth, 1.0), ('eight times as slow', whole, 8.0)):
        trial = slower(trial, factor)
        leads = factor * np.array([0.25, 0.5, 1.0])
        stamps, mean, deviation = forecasts(trial, 'roll', leads)
        error = mean - truth_at(trial, 'roll', stamps[:, None] + leads)
        yield f'\nflume, {name}, leads {leads} s'
        for span, (begin, end) in FLUME.items():
            now = (stamps >= factor * begin) & (stamps <= factor * end)
            seen = (trial.time >= factor * begin) & (trial.time <= factor * end)
            yield from report(
                span, np.std(trial.roll[seen]), forecast=error[now], held=np.abs(error[now]) <= HALF_90 * deviation[now]
            )


CASES = {
    'morro': lambda factor: first_periods('buoy', buoy(), factor),
    'ship': lambda factor: first_periods('ship', ship(), factor),
    'hakusan': lambda factor: first_periods('other ship', other_ship(), factor),
    'minute': lambda factor: chain(minute('ship', ship()), minute('other ship', other_ship())),
    'flume': lambda factor: flume(),
}


def lines(
    *cases: Annotated[str, CASES, f'of {", ".join(CASES)}'],
    time: Annotated[float, 'the motion of morro, ship and hakusan as many times slower'] = 1.0,
):
    """The scores of the cases asked for."""
    for case in cases or CASES:
        yield from CASES[case](time)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
