"""What campaigns cost, and that killing them costs nothing.

    python benchmark/campaign.py                    the measured platform, workers, and ten kills
    python benchmark/campaign.py published          the SWATH-pitch campaign with the papers' full budget: minutes
    python benchmark/campaign.py measured kills     what is named of: measured, workers, kills, published

Wall times depend on what else the machine does; processor times hardly.
"""

import csv
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get('SWATH_SYSID_DATA', ROOT.parent / 'shared' / 'data'))
EXAMPLE = ROOT / 'examples' / 'swath-pitch'
KILLS = 10
TWO_SIDED_95 = 1.96


def command(manifest, output, *more):
    """The command line of one campaign."""
    return [sys.executable, '-m', 'swath_sysid.cli.main', 'campaign', str(manifest), '--output', str(output), *more]


def run(manifest, output, *more):
    """Work a campaign off; returns its wall time, s, and its last words."""
    began = time.perf_counter()
    environment = os.environ | {'PYTHONPATH': str(ROOT)}
    done = subprocess.run(command(manifest, output, *more), env=environment, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f'{manifest}: {done.stderr}')
    return time.perf_counter() - began, done.stdout.strip()


def processor_time(output):
    """Processor time of all tasks that a campaign kept, s."""
    return sum(json.loads(p.read_text())['cpu_s'] for p in (Path(output) / 'results').glob('*/*.json'))


def tables(output):
    """Name to text of the tables."""
    return {p.name: p.read_text() for p in (Path(output) / 'tables').glob('*.csv')}


def measured(folder):
    """The measured platform: nine trials, default settings."""
    if not DATA.is_dir():
        print(f'measured: skipped, no records at {DATA}')
        return
    manifest = folder / 'foswec.yaml'
    manifest.write_text(
        'craft: {name: FOSWEC}\naxis: pitch\ntrials:\n'
        f"  - pattern: '{DATA}/decay/foswec/pitch_{{angle}}deg_repeat{{repeat}}.csv'\n"
    )
    wall, words = run(manifest, folder / 'foswec', '--jobs', '2')
    print(
        f'measured platform, 2 jobs: report in {wall:.1f} s, {processor_time(folder / "foswec"):.1f} s of '
        f'tasks\n{words}'
    )


def simulated_trials():
    """Make the example's trials where they are not there."""
    if not (EXAMPLE / 'trials').is_dir():
        script = EXAMPLE.parent / 'simulate_trials.py'
        subprocess.run(
            [sys.executable, str(script), EXAMPLE.name],
            env=os.environ | {'PYTHONPATH': str(ROOT)},
            check=True,
            stdout=subprocess.DEVNULL,
        )


def few_equations(folder):
    """A manifest of the example with three equations and one objective."""
    manifest = folder / 'few.yaml'
    manifest.write_text(
        'craft: {name: SWATH model}\naxis: pitch\nequations: [linear, swath-pitch-2, swath-pitch-6]\n'
        f"trials: [{{pattern: '{EXAMPLE}/trials/pitch_{{angle}}deg_{{draft_factor}}T_repeat{{repeat}}.csv'}}]\n"
    )
    return manifest


def workers(folder):
    """Two workers against one, on fits long enough to outweigh starting them; the others' load falls on both alike."""
    simulated_trials()
    manifest = folder / 'workers.yaml'
    text = few_equations(folder).read_text()
    manifest.write_text(text + 'search: {preset: swath-pitch}\n')
    one, _ = run(manifest, folder / 'one', '--jobs', '1')
    two, _ = run(manifest, folder / 'two', '--jobs', '2')
    same = tables(folder / 'one') == tables(folder / 'two')
    print(f'81 fits: one worker {one:.1f} s, two {two:.1f} s: {one / two:.2f} times faster; tables identical: {same}')


def _results(output):
    return len(list(output.glob('results/??/*.json')))


def kills(folder):
    """Kill at random moments, ten times in a row, then finish; compare with an uninterrupted run."""
    simulated_trials()
    manifest = few_equations(folder)
    run(manifest, folder / 'whole', '--jobs', '2')
    every = _results(folder / 'whole')
    chance = random.Random(1)
    environment = os.environ | {'PYTHONPATH': str(ROOT)}
    kept = [0]
    for _ in range(KILLS):
        running = subprocess.Popen(
            command(manifest, folder / 'killed', '--jobs', '2'),
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        enough = kept[-1] + chance.randint(0, 2 * every // (KILLS + 2))
        while running.poll() is None and _results(folder / 'killed') < enough:
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 0.3))
        running.send_signal(signal.SIGKILL)
        running.wait()
        kept.append(_results(folder / 'killed'))
    run(manifest, folder / 'killed', '--jobs', '2')
    same = tables(folder / 'whole') == tables(folder / 'killed')
    same_model = (folder / 'whole' / 'model.yaml').read_text() == (folder / 'killed' / 'model.yaml').read_text()
    print(
        f'{KILLS} kills, of {every} results kept after each: {kept[1:]}; tables identical: {same}, model '
        f'identical: {same_model}'
    )


def published(folder):
    """The SWATH-pitch campaign: 243 identifications by each objective with 2000 generations of 200."""
    simulated_trials()
    manifest = folder / 'published.yaml'
    text = (EXAMPLE / 'campaign.yaml').read_text().replace("'trials/", f"'{EXAMPLE}/trials/")
    manifest.write_text(text + 'search: {preset: swath-pitch}\n')
    output = folder / 'published'
    wall, words = run(manifest, output, '--jobs', '2')
    print(f'SWATH pitch, published budget, 2 jobs: {wall:.0f} s, {processor_time(output):.0f} s of tasks\n{words}')
    page = (output / 'report.html').read_text()
    print(re.search(r'No equation fits worse[^<]*|In \d+ cases[^<]*', page).group())
    coverage(output)


def coverage(output):
    """How often the truth lies within two-sided 95 % of single fits of the true equation."""
    sys.path.insert(0, str(EXAMPLE.parent))
    from simulate_trials import WITH_DRAFT

    from swath_sysid.attitude.hull.catalogue import hull_named

    truth = hull_named('swath-pitch').model.terms
    hits, cases = Counter(), Counter()
    for row in csv.DictReader((output / 'tables' / 'coefficients.csv').open()):
        if row['level'] == 'record' and row['equation'] == 'swath-pitch-2':
            true = truth[row['ratio']] * float(row['draft factor']) ** WITH_DRAFT[row['ratio']]
            cases[row['ratio']] += 1
            hits[row['ratio']] += abs(float(row['value']) - true) <= TWO_SIDED_95 * float(row['standard deviation'])
    share = math.fsum(hits.values()) / math.fsum(cases.values())
    print(
        f'truth within 95 %: {share:.1%} of {sum(cases.values())} cases; '
        + ', '.join(f'{k} {hits[k]}/{cases[k]}' for k in cases)
    )


PARTS = {'measured': measured, 'workers': workers, 'kills': kills, 'published': published}

if __name__ == '__main__':
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    names = sys.argv[1:] or ['measured', 'workers', 'kills']
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        raise SystemExit(f"there is no part '{unknown[0]}': choose from {', '.join(PARTS)}")
    with tempfile.TemporaryDirectory() as temporary:
        for name in names:
            PARTS[name](Path(temporary))
