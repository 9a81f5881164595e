"""Every licensed measured record, forecast by every row, every forecast counted: one table, the same to the digit.

    OMP_NUM_THREADS=1 python benchmark/records.py                                # all of it, printed
    OMP_NUM_THREADS=1 python benchmark/records.py --write docs/records_benchmark.md
    OMP_NUM_THREADS=1 python benchmark/records.py ship --row my_module:my_forecaster

A row is any function ``forecaster(trial, axes, stamps, leads)`` that returns, by axis, the angles that it forecasts
for ``stamps[:, None] + leads``, rad, from the samples up to and with each stamp; NaN where it has none, and persistence
stands in. A row that looks ahead is refused. Records are read from the folder that SWATH_SYSID_DATA names.
All of it takes some six minutes of one core.
"""

import argparse
import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from record_forecasts import DATA, only, without_samples

from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import decays_or_waves, prepare
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.common.conventions import REJECTED
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation.baselines import Record, running_regression, simple_forecasts
from swath_sysid.evaluation.scoring import FORECAST, score_forecasts, score_valid_leads
from swath_sysid.formats.identify_records import identify_at_sea
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

WINDOW = ForecasterSettings().window
"""Periods of past that our rows may learn from."""

PAST = WINDOW * USUAL_PERIOD
"""s of past that all others may."""

WARMUPS = (60.0, 300.0, 600.0)
WAVE_LEADS, SHIP_LEADS, DECAY_LEADS = (0.5, 1.0, 2.0, 3.0, 5.0), (1.0, 2.0, 3.0, 5.0, 10.0), (0.5, 1.0, 2.0)
LOST = 5
"""Samples taken out every 20 s, where losses are tried."""

CHECKED = 120.0
"""s of a record on which rows must not look ahead."""

CUTS = (0.4, 0.8)
AGREEMENT = 1e-9
"""Of the standard deviation: what is left of a sum in another order."""


# -- rows


def persistence(trial, axes, stamps, leads):
    """The last angle."""
    return {axis: simple_forecasts(Record.of(trial), axis, stamps, leads, PAST)['persistence'] for axis in axes}


def constant_rate(trial, axes, stamps, leads):
    """The last angle and rate."""
    return {axis: simple_forecasts(Record.of(trial), axis, stamps, leads, PAST)['constant_rate'] for axis in axes}


def autoregression(trial, axes, stamps, leads):
    """AR(40) of each angle."""
    record = Record.of(trial)
    places = {axis: [record.names.index(axis)] for axis in axes}
    return {
        axis: running_regression(record, place, place, 40, stamps, leads, PAST)[..., 0]
        for axis, place in places.items()
    }


def vector_autoregression(trial, axes, stamps, leads):
    """VAR(40) of every channel."""
    record = Record.of(trial)
    targets = [record.names.index(axis) for axis in axes]
    found = running_regression(record, range(len(record.names)), targets, 40, stamps, leads, PAST)
    return {axis: found[..., k] for k, axis in enumerate(axes)}


def swath_sysid(trial, axes, stamps, leads):
    """The package's own forecasts."""
    return issued(steps_of(trial, leads), axes, stamps, leads, 'mean')


def steps_of(trial, leads, models=None):
    """What the package issued, by stamp."""
    base = ForecasterSettings()
    settings = replace(base, leads=tuple(leads), window=WINDOW, horizon=max(base.horizon, max(leads)))
    return {step.stamp: step for step in run_through(trial, settings, models or {}).steps}


def issued(steps, axes, stamps, leads, what):
    """By axis, one of the quantities that were issued at the stamps; NaN where none was."""
    found = {axis: np.full((stamps.size, len(leads)), np.nan) for axis in axes}
    for place, stamp in enumerate(stamps):
        for axis in axes if stamp in steps else ():
            found[axis][place] = getattr(steps[stamp].forecast, what)[:, ATTITUDE.index(axis)]
    return found


OURS = 'swath_sysid'
ROWS: dict[str, Callable] = {
    'persistence': persistence,
    'constant rate': constant_rate,
    'AR(40)': autoregression,
    'VAR(40)': vector_autoregression,
    OURS: swath_sysid,
}
GAUSSIAN_PROCESS = 'gaussian_process:forecasts'
WITH_HULL = 'swath_sysid, hull'


def row_named(name):
    """The function that ``MODULE:FUNCTION`` names."""
    module, _, function = name.partition(':')
    sys.path.insert(0, str(Path.cwd()))
    try:
        return getattr(importlib.import_module(module), function)
    finally:
        sys.path.pop(0)


class LooksAheadError(Exception):
    """A row's forecasts change with what had not happened yet."""


def refuse_look_ahead(name, row, trial, leads):
    """Try a row on the beginning of a record, and on the same with another future.

    Raises
    ------
    LooksAheadError
        A forecast issued before the futures part is not the same in both.
    """
    start = float(trial.time[0])
    seen = trial.between(None, start + CHECKED)
    axes, leads = axes_of(seen), np.asarray(leads)
    expected = row(seen, axes, seen.time, leads)
    for share in CUTS:
        known = int(share * seen.time.size)
        other = replace(
            seen,
            **{
                channel: np.concatenate([values[:known], 1.5 * values[known:][::-1]])
                for channel, values in seen.channels.items()
            },
        )
        found = row(other, axes, seen.time, leads)
        for axis in axes:
            tolerance = AGREEMENT * np.nanstd(seen.channels[axis])
            if not np.allclose(found[axis][:known], expected[axis][:known], 0.0, tolerance, equal_nan=True):
                raise LooksAheadError(
                    f'{name} looks ahead: its forecasts of {axis} before {seen.time[known]:.1f} s change with the '
                    'samples from then on; use only those up to and with each stamp'
                )


# -- records


@dataclass(frozen=True)
class Case:
    """A record, what is asked of its forecasts, and from which records its hull is known; None: from its own past."""

    title: str
    trial: Callable[[], Any]
    leads: tuple[float, ...]
    warmups: tuple[float, ...] = WARMUPS
    hull_records: tuple[str, ...] | None = None


def thinned(path, every=1, end=None, **how):
    """Every so many samples of a record, up to a time of it, s."""
    trial = read_trial(DATA / path, **how)
    return only(trial.between(None, end), slice(None, None, every))


def wave_case(title, path, leads, lost=0, **how):
    """A record in waves, with or without losses."""

    def trial():
        whole = thinned(path, **how)
        return without_samples(whole, lost) if lost else whole

    return Case(f'{title}, {lost} samples lost every 20 s' if lost else title, trial, leads)


MORRO = 'Moored buoy off Morro Bay', 'waves/morro_buoy.csv', WAVE_LEADS
SHIP = 'N. B. Palmer under way', 'waves/nbp1406_ship.csv', SHIP_LEADS
FOSWEC = 'decay/foswec/pitch_{}deg_repeat{}.csv'
CASES = {
    'ship': wave_case(*SHIP),
    'ship-lost': wave_case(*SHIP, lost=LOST),
    'morro': wave_case(*MORRO, frame='frd'),
    'morro-lost': wave_case(*MORRO, lost=LOST, frame='frd'),
    'oahu': wave_case(
        'The same instrument still on land, Oahu', 'faults/oahu_static_bad_packets.csv', WAVE_LEADS, frame='frd'
    ),
    'kvlcc2-0kn': Case(
        'KVLCC2 model, roll decay at rest, at 10 Hz',
        partial(thinned, 'decay/kvlcc2/run2_0kn.csv', 10),
        DECAY_LEADS,
        (60.0,),
    ),
    'kvlcc2-15kn': Case(
        'KVLCC2 model, roll decay at 15.5 kn, at 10 Hz',
        partial(thinned, 'decay/kvlcc2/run3_15kn.csv', 10, 77.0),
        DECAY_LEADS,
        (60.0,),
    ),
    'foswec': Case(
        'FOSWEC platform, third pitch decay from 8.4 deg, at 10 Hz; hull from the first and second of each',
        partial(thinned, FOSWEC.format('8.4', 3), 5),
        (0.2, 0.5, 1.0),
        (1.0,),
        tuple(FOSWEC.format(angle, repeat) for angle in ('3', '5', '8.4') for repeat in (1, 2)),
    ),
}


def axes_of(trial):
    """Those whose angle was measured."""
    return [axis for axis in AXES if axis in trial.channels]


def hulls_before(trial, end, others=None):
    """Models by axis from a record's samples before a time, or from other records; axes that show none are absent."""
    models = {}
    trials = [trial.between(None, end)] if others is None else [read_trial(DATA / path) for path in others]
    for axis in axes_of(trials[0]):
        motions = [seen.axis(axis) for seen in trials]
        try:
            problem = decays_or_waves(motions) if others is None else prepare(motions)
            if problem is None:
                found = identify_at_sea(trials[0], axis=axis)
                usable = found.is_usable
            else:
                found = identify_problem(problem, IdentificationSettings())
                usable = found.verdict.level != REJECTED
        except InputError:
            continue  # too short, or no decay: there is no hull to forecast with yet
        if usable:
            models[axis] = found.identified_model({})
    return models


# -- table


def scores_of(case, rows, with_hull=True):
    """Scores by (warm-up, axis, row); rows are forecast once, the one with a hull once a warm-up."""
    trial, leads = case.trial(), np.array(case.leads)
    axes, start, end = axes_of(trial), float(trial.time[0]), float(trial.time[-1])
    record, found = Record.of(trial), {}
    made = {name: row(trial, axes, trial.time, leads) for name, row in rows.items() if name != OURS}
    own = {OURS: steps_of(trial, case.leads)} if OURS in rows else {}
    for warmup in case.warmups:
        if warmup + leads[-1] >= end - start:
            continue
        models = hulls_before(trial, start + warmup, case.hull_records) if with_hull else {}
        ran = own | ({WITH_HULL: steps_of(trial, case.leads, models)} if models else {})
        scored = trial.time >= start + warmup
        stamps = trial.time[scored]
        now = {name: {axis: made[name][axis][scored] for axis in axes} for name in made}
        now |= {name: issued(steps, axes, stamps, leads, 'mean') for name, steps in ran.items()}
        for axis in axes:
            for name in sorted(now, key=[*rows, WITH_HULL].index):
                if name == WITH_HULL and axis not in models:
                    continue
                resting, expected, valid = now['persistence'][axis], None, None
                if name in ran:
                    expected = issued(ran[name], [axis], stamps, leads, 'own_deviation')[axis]
                    valid = score_valid_leads(record, axis, [ran[name][at] for at in stamps if at in ran[name]])
                score = score_forecasts(record, axis, stamps, leads, now[name][axis], resting, expected)
                found[warmup, axis, name] = replace(score, valid_lead=valid)
    return found


def table_of(case, scores):
    """Markdown: error over the standard deviation of the motion, with its 95 % interval, and as it was expected."""
    lines = [
        f'## {case.title}',
        '',
        f'| warm-up | axis | forecaster | {" | ".join(f"{lead:g} s" for lead in case.leads)} | counted | valid lead |',
        '|' + '---|' * (5 + len(case.leads)),
    ]
    for (warmup, axis, name), score in scores.items():
        cells = [
            f'{error:.3f}' + (f' ({low:.3f}-{high:.3f})' if np.isfinite(low) else '')
            for error, (low, high) in zip(score.nrmse[FORECAST], score.interval, strict=True)
        ]
        head = f'| {warmup:g} s | {axis} | {name}'
        lines.append(f'{head} | {" | ".join(cells)} | {score.counted[0]} | {valid_lead_of(score.valid_lead)} |')
        if np.isfinite(score.expected).any():
            lines.append(f'{head} expects | {" | ".join(f"{error:.3f}" for error in score.expected)} | | |')
    return '\n'.join([*lines, ''])


def valid_lead_of(found):
    """The median, and the error there over the limit; empty for forecasters that give none."""
    if found is None or not np.isfinite(found.lead[0]):
        return ''
    return f'{found.lead[0]:.2f} s' + (f', {found.error_over_expected:.2f}' if found.counted else '')


INTRODUCTION = """# Forecasts of measured records

<!-- written by `python benchmark/records.py --write docs/records_benchmark.md` -->

The tables give the root mean square error of the forecast angle divided by the standard deviation of the motion, with
its 95 % interval from a bootstrap of 30 s blocks where the record is long enough. A value of 1 is no better than
predicting the mean. Every forecaster starts with the record and uses no sample later than the one it forecasts from.
Every forecast issued after the warm-up is scored, unless nothing was measured at its time; a missing forecast is
replaced by persistence. Regressions learn from the last ten minutes. The hull of the last row is identified from the
samples before the end of the warm-up; without a hull in these samples there is no such row.

A row that `expects` gives the error that the learnt models of the row above expect of themselves, before calibration.
More data or a better fit can gain the difference; only another sensor can gain more. The column `valid lead` gives how
far ahead the forecasts said that they can be trusted (median; expected error below half of the motion, and at most a
tenth of the errors beyond it), and the measured error there divided by the expected one: 1 is calibrated.

The records and their licences are named in `records/NOTICE` or in the titles. Your own forecaster is a function:
`python benchmark/records.py --help`.
"""


def page_with(texts, page=''):
    """The page with these tables in the order of `CASES`, then the other sections as they were; texts by title."""
    before = {part.partition('\n')[0]: f'## {part.strip()}\n' for part in f'\n{page}'.split('\n## ')[1:]}
    sections, titles = before | texts, [case.title for case in CASES.values()]
    ordered = [*titles, *(title for title in sections if title not in titles)]
    return '\n'.join([INTRODUCTION, *(sections[title] for title in ordered if title in sections)])


def main():
    """Print or write the tables of the cases asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('cases', nargs='*', choices=[[], *CASES], metavar='CASE', help=f'of {", ".join(CASES)}')
    parser.add_argument('--row', action='append', default=[], metavar='MODULE:FUNCTION', help='your own forecaster')
    parser.add_argument('--write', metavar='FILE.md', help='write these tables into the page')
    arguments = parser.parse_args()
    rows = ROWS | {name: row_named(name) for name in arguments.row}
    if importlib.util.find_spec('sklearn'):
        rows['Gaussian process'] = row_named(GAUSSIAN_PROCESS)
    chosen = [CASES[name] for name in arguments.cases or CASES]
    page = Path(arguments.write) if arguments.write else None
    for case in chosen:
        trial = case.trial()
        for name, row in rows.items() if case is chosen[0] else ():
            refuse_look_ahead(name, row, trial, case.leads)
        table = table_of(case, scores_of(case, rows))
        print(table, flush=True)
        if page:
            written = page.read_text(encoding='utf-8') if page.exists() else ''
            page.write_text(page_with({case.title: table}, written), encoding='utf-8')


if __name__ == '__main__':
    main()
