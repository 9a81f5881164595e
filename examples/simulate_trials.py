"""Simulates the trials of the four example campaigns, with the noise that the papers' trials had.

    python examples/simulate_trials.py [FOLDER ...]

makes FOLDER/trials/*.csv for the folders named (default: all four), each file by one call of ``swath-sysid simulate``.
What the papers do not give is assumed: how the ratios to inertia follow the draft.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.cli.main import main

HERE = Path(__file__).resolve().parent
DRAFT_FACTORS = (0.9, 1.0, 1.1)
WITH_DRAFT = {'b1': 0.8, 'b2': 0.5, 'b3': 0.5, 'r1': -0.6, 'r2': -0.4, 'r3': 0.3, 's1': -0.6, 's2': -0.4}
"""Assumed: a ratio at draft factor f is that at design draft times f to this power."""


@dataclass(frozen=True)
class Campaign:
    """Which hull is released from which angles, and for how long it is recorded."""

    hull: str
    angles_deg: tuple
    repeats: int
    duration_s: float


CAMPAIGNS = {
    'swath-pitch': Campaign('swath-pitch', (3, 6, 9), 3, 15.0),
    'swath-roll': Campaign('swath-roll', (3, 5, 7, 15), 3, 15.0),
    'hydrofoil-pitch': Campaign('hydrofoil-pitch', (1, 2, 3, 4, 5), 1, 6.0),
    'swath-usv-pitch': Campaign('swath-usv-pitch', (3, 5, 7, 9), 1, 15.0),
}


def commands(name):
    """The argument lists of ``swath-sysid`` that make a campaign's trials."""
    campaign = CAMPAIGNS[name]
    model = hull_named(campaign.hull).model
    folder = HERE / name / 'trials'
    seed = 0
    for factor in DRAFT_FACTORS:
        ratios = {term: value * factor ** WITH_DRAFT[term] for term, value in model.terms.items()}
        for angle in campaign.angles_deg:
            for repeat in range(1, campaign.repeats + 1):
                seed += 1
                file = folder / f'{model.axis}_{angle}deg_{factor:.1f}T_repeat{repeat}.csv'
                yield [
                    'simulate', '--equation', model.equation.name, '--axis', model.axis,
                    *(word for term, value in ratios.items() for word in ('--ratio', f'{term}={value!r}')),
                    '--initial-angle-deg', str(angle), '--duration', str(campaign.duration_s), '--hold', '1',
                    '--seed', str(seed), '--output', str(file),
                ]  # fmt: skip


def run(names):
    """Simulate the trials of the named campaigns; returns the exit code."""
    unknown = [name for name in names if name not in CAMPAIGNS]
    if unknown:
        print(f"there is no example '{unknown[0]}': choose from {', '.join(CAMPAIGNS)}", file=sys.stderr)
        return 2
    for name in names or CAMPAIGNS:
        (HERE / name / 'trials').mkdir(exist_ok=True)
        for command in commands(name):
            code = main(command)
            if code:
                return code
    return 0


if __name__ == '__main__':
    sys.exit(run(sys.argv[1:]))
