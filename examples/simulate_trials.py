"""Simulates the trials of the four example campaigns, with the noise that the papers' trials had.

    python examples/simulate_trials.py [FOLDER ...]

makes FOLDER/trials/*.csv for the folders named (default: all four), each file by one call of ``swath-sysid simulate``.
What the papers do not give is assumed: how the ratios to inertia follow the draft.
"""

import itertools
import sys
from pathlib import Path

from swath_sysid.cli.main import main
from swath_sysid.tank.papers.decay_study import DECAY_STUDIES, decay_publication, hull_at

HERE = Path(__file__).resolve().parent


def commands(name):
    """The argument lists of ``swath-sysid`` that make a campaign's trials."""
    publication = decay_publication(name)
    folder = HERE / name / 'trials'
    places = itertools.product(publication.printed_objective, range(1, publication.repeats + 1))
    for seed, ((factor, angle), repeat) in enumerate(places, start=1):
        model = hull_at(name, factor)
        file = folder / f'{model.axis}_{angle}deg_{factor:.1f}T_repeat{repeat}.csv'
        yield [
            'simulate',
            '--equation',
            model.equation.name,
            '--axis',
            model.axis,
            *(word for term, value in model.terms.items() for word in ('--ratio', f'{term}={value!r}')),
            '--initial-angle-deg',
            str(angle),
            '--duration',
            str(publication.duration_s),
            '--hold',
            '1',
            '--seed',
            str(seed),
            '--output',
            str(file),
        ]


def run(names):
    """Simulate the trials of the named campaigns; returns the exit code."""
    unknown = [name for name in names if name not in DECAY_STUDIES]
    if unknown:
        print(f"there is no example '{unknown[0]}': choose from {', '.join(DECAY_STUDIES)}", file=sys.stderr)
        return 2
    for name in names or DECAY_STUDIES:
        (HERE / name / 'trials').mkdir(exist_ok=True)
        for command in commands(name):
            code = main(command)
            if code:
                return code
    return 0


if __name__ == '__main__':
    sys.exit(run(sys.argv[1:]))
