"""What identification of a simulated WAM-V finds, seed by seed, and how long it takes.

    python benchmark/manoeuvring.py              10 seeds of each case, about 3 minutes
    python benchmark/manoeuvring.py --seeds 2    fewer
    python benchmark/manoeuvring.py --vices catamaran --seeds 3      craft with the vices of real ones: catamaran,
                                                                     otter-force, otter-command, unstable
    python benchmark/manoeuvring.py --measured FOLDER                a measured craft: even runs identify (all, and
                                                                     without two neighbours), 01 03 05 07 validate

The WAM-V is VRX's old one, driven through a programme of 15 min at 10 Hz; speeds are noisy by 0.05 m/s, yaw rates by
0.005 rad/s; its mass is known. Cases: thrust as force; commands with a dead band and a lag of 0.3 s; a current of
0.3 m/s; a current of 0.3 m/s that differs between the runs.
"""

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import simulated_craft

from swath_sysid.manoeuvring.formats.csv import read_manoeuvring_csv
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, run_test, trial_programme, with_noise
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.intake import prepare_runs
from swath_sysid.manoeuvring.motion.trial import COMMAND, ManoeuvringTrial
from swath_sysid.manoeuvring.prediction.skill import calibrated, score_forecasts

WAMV = preset('wamv-vrx-old')
COMMANDED = replace(
    WAMV.with_values(gain=150.0, dead_band=0.08, lag=0.3, reverse_ratio=0.7), thrust_input=COMMAND, largest_input=1.0
)
CURRENT = (0.25, -0.166)
NAMES = ('Xu', 'Xuu', 'Nr')
UNSTABLE_RUN = 60.0
"""s; of twenty hulls longer runs would take long."""


def drifting(manoeuvre, current):
    """The manoeuvre over ground in a current."""
    east, north = current
    cosine, sine = np.cos(manoeuvre.heading), np.sin(manoeuvre.heading)
    return replace(
        manoeuvre,
        surge=manoeuvre.surge + east * cosine + north * sine,
        sway=manoeuvre.sway - east * sine + north * cosine,
        x=manoeuvre.x + east * manoeuvre.time,
        y=manoeuvre.y + north * manoeuvre.time,
    )


def runs_of(model, seed, currents=None):
    """The programme as sensors would have recorded it; current of each run, by its place."""
    trials = []
    for k, (name, manoeuvre) in enumerate(trial_programme(model).items()):
        if currents is not None:
            manoeuvre = drifting(manoeuvre, currents[k])
        m = with_noise(manoeuvre, RunNoise(), 100 * seed + k)
        trials.append(
            ManoeuvringTrial(
                m.time,
                m.port,
                m.starboard,
                model.thrust_input,
                m.surge,
                m.sway,
                m.yaw_rate,
                m.heading,
                m.x,
                m.y,
                'enu',
                source=name,
            )
        )
    return prepare_runs(trials)


def diameters(model):
    """Steady and tactical diameter of the turning circle, m."""
    numbers = run_test(
        'turning-circle',
        replace(model, largest_input=WAMV.largest_input, current=(0.0, 0.0), thrust_input='force')
        if model.thrust_input != COMMAND
        else replace(model, largest_input=1.0, current=(0.0, 0.0)),
    ).numbers
    return np.array([numbers['steady_diameter_m'], numbers['tactical_diameter_m']])


def row(truth, seed, currents=None):
    """What one identification found."""
    runs = runs_of(truth, seed, currents)
    begun = time.perf_counter()
    found = identify_manoeuvring(runs, ManoeuvringSettings(mass=180.0, lever=WAMV['lever'], length=WAMV.length))
    took = time.perf_counter() - begun
    plain = {name: d for name, d in found.derivatives.items() if not d.flags}
    outside = [name for name, d in plain.items() if abs(d.value - truth[name]) > 3.0 * d.std]
    worst = max(abs(found.model[name] / truth[name] - 1.0) for name in NAMES)
    circle = np.max(np.abs(diameters(found.model) / diameters(truth) - 1.0))
    if currents is None:
        drift = math.hypot(*np.subtract(found.model.current, truth.current))
    else:
        place = {run.source: k for k, run in enumerate(runs)}
        drift = max(
            math.hypot(*(found_current - np.array(currents[place[run.source]])))
            for run, found_current in zip(found.identified_on, found.currents, strict=True)
        )
    lag = abs(found.model['lag'] + found.model['delay'] - truth['lag'] - truth['delay'])
    band = abs(found.model['dead_band'] - truth['dead_band'])
    return (
        len(plain),
        len(outside),
        worst,
        circle,
        drift,
        lag,
        band,
        found.validation.r2['surge'],
        found.validation.r2['yaw_rate'],
        took,
    ), outside


def records_of(craft, kind, seed):
    """Runs of a craft of `simulated_craft`, and the same runs without the sensors' noise."""
    inputs = simulated_craft.drives(seed, kind == 'catamaran', simulated_craft.EVERY)
    if kind == 'unstable':
        inputs = [rows[: round(UNSTABLE_RUN / simulated_craft.STEP)] for rows in inputs]

    def of(version):
        return prepare_runs(
            [
                ManoeuvringTrial(
                    thrust_input=craft.logs,
                    frame='enu',
                    source=f'run {k}',
                    lever=craft.lever,
                    length=craft.length,
                    **record,
                )
                for k, record in enumerate(simulated_craft.simulate(version, inputs, seed))
            ]
        )

    return of(craft), of(replace(craft, noise=(0.0, 0.0, 0.0, 0.0)))


def vicious(kind, seed, forecasts):
    """Print what identification and forecasts make of a craft of `simulated_craft`; R2 by channel."""
    craft = {
        'catamaran': simulated_craft.catamaran,
        'otter-force': simulated_craft.otter,
        'otter-command': lambda: simulated_craft.otter(logs='command'),
        'otter-munk': lambda: simulated_craft.otter(munk=1.0),
        'unstable': lambda: simulated_craft.unstable_hull(np.random.default_rng(seed)),
    }[kind]()
    runs, truth = records_of(craft, kind, seed)
    reversed_runs = sum('reversed' in a.code or 'swapped' in a.code for run in runs for a in run.advice)
    found = identify_manoeuvring(runs[:8], ManoeuvringSettings(mass=craft.mass), runs[8:])
    r2 = ' '.join(f'{value:6.3f}' for value in found.validation.r2.values())
    flagged = {a.code for a in found.advice} & {'unstable', 'course-unstable', 'diverged'}
    print(
        f'{kind} {seed}: validation R2 of surge, sway, yaw rate {r2}; {reversed_runs} runs reversed; '
        f'{found.validation.diverged} windows diverged {flagged or ""}'
    )
    print('    ' + ' '.join(f'{n} {d.value:.4g}+-{d.std:.2g}' for n, d in found.derivatives.items()), flush=True)
    if forecasts:
        print_forecasts(found, runs, truth)
    return list(found.validation.r2.values())


def print_forecasts(found, runs, truth):
    """Print errors of position against the GPS and against the truth, and what the intervals hold."""
    identified = calibrated(found.identified(), runs[:8])
    cases = {
        'against GPS': {},
        'against truth': {'truth': truth[8:]},
        'against truth, where thrust did hold': {'truth': truth[8:], 'held': True},
    }
    for case, options in cases.items():
        scores = score_forecasts(identified, runs[8:], training=runs[:8], leads=(1.0, 5.0, 10.0), **options)
        position = {method: table['position_m'] for method, table in scores.rmse.items()}
        for other in ('constant-velocity', 'constant-turn-rate', 'arx'):
            print(
                f'    position at 1, 5, 10 s {case}, over that of {other}: '
                f'{np.round(position["model"] / position[other], 3)}'
            )
        for quantity, shares in scores.spread.items() if not options else ():
            print(f'    90 % interval of {quantity} holds {np.round(shares, 3)}', flush=True)


def measured(folder, lever=0.285):
    """Print what is identified from the even runs of a measured craft, and from them without two neighbours."""

    def runs_of_files(numbers):
        return prepare_runs([read_manoeuvring_csv(folder / f'run_{k:02}.csv') for k in numbers])

    even, odd = [k for k in range(0, 16, 2) if (folder / f'run_{k:02}.csv').is_file()], runs_of_files((1, 3, 5, 7))
    pairs = zip(even, [*even[1:], even[0]], strict=True)
    for left_out in ((), *pairs):
        kept = runs_of_files([k for k in even if k not in left_out])
        found = identify_manoeuvring(kept, ManoeuvringSettings(lever=lever), odd)
        r2 = ' '.join(f'{value:6.3f}' for value in found.validation.r2.values())
        stable = 'stable' if found.stability.stable else 'UNSTABLE'
        print(f'without {left_out}: validation R2 of surge, sway, yaw rate {r2}; {stable}; {found.verdict}', flush=True)


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--seeds', type=int, default=10)
    parser.add_argument('--first-seed', type=int, default=1)
    parser.add_argument('--forecasts', action='store_true', help='of craft with vices: score forecasts, too')
    parser.add_argument('--vices', choices=('catamaran', 'otter-force', 'otter-command', 'otter-munk', 'unstable'))
    parser.add_argument('--measured', type=Path, metavar='FOLDER', help='runs of a measured craft')
    arguments = parser.parse_args()
    if arguments.measured:
        measured(arguments.measured)
        return
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    if arguments.vices:
        table = np.array([vicious(arguments.vices, seed, arguments.forecasts) for seed in seeds])
        print(
            f'{arguments.vices}: least R2 of {len(table)} seeds {np.round(table.min(axis=0), 3)}, second least '
            f'{np.round(np.sort(table, axis=0)[min(1, len(table) - 1)], 3)}'
        )
        return
    days = [CURRENT, tuple(-0.8 * c for c in CURRENT)]
    cases = {
        'force': (WAMV, None),
        'commands, dead band, lag': (COMMANDED, None),
        'current': (replace(WAMV, current=CURRENT), None),
        'currents that differ': (WAMV, [days[k % 2] for k in range(len(trial_programme(WAMV)))]),
    }
    print(
        f'{"case":<26}{"seed":>5}{"plain":>6}{"out":>4}{"Xu Xuu Nr":>10}{"diam.":>7}{"drift":>7}{"lag":>7}{"band":>7}'
        f'{"R2 u":>7}{"R2 r":>7}{"s":>6}'
    )
    for name, (truth, currents) in cases.items():
        rows = []
        for seed in seeds:
            found, outside = row(truth, seed, currents)
            rows.append(found)
            n, out, worst, circle, drift, lag, band, surge, yaw, took = found
            print(
                f'{name:<26}{seed:>5}{n:>6}{out:>4}{worst:>10.1%}{circle:>7.1%}{drift:>7.3f}{lag:>7.3f}{band:>7.3f}'
                f'{surge:>7.3f}{yaw:>7.3f}{took:>6.1f}  {" ".join(outside)}',
                flush=True,
            )
        table = np.array(rows)
        print(
            f'{name + ", worst":<31}{"":>6}{table[:, 1].max():>4.0f}{table[:, 2].max():>10.1%}'
            f'{table[:, 3].max():>7.1%}{table[:, 4].max():>7.3f}{table[:, 5].max():>7.3f}{table[:, 6].max():>7.3f}'
            f'{table[:, 7].min():>7.3f}{table[:, 8].min():>7.3f}{table[:, 9].max():>6.1f}\n'
        )
    print(
        'plain: derivatives without a flag; out: of these, beyond 3 std; Xu Xuu Nr: largest error of the three; '
        'diam.: of the turning circle;\ndrift: of the current, m/s; lag: of lag and delay together, s; band: of the '
        'dead band; R2: validation; s: time of the identification'
    )


if __name__ == '__main__':
    main()
