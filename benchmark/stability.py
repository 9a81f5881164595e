"""The stability watch in simulated irregular seas: python benchmark/stability.py [--seeds 20] [--hours 6]

A published SWATH rolls in waves of its own for each seed; every ten minutes are identified.  After an hour a tenth of
its restoring moment is gone; in other runs, of --hours, nothing changes.  Printed: when the watch says so, by how much,
and how often it warned where nothing had changed.
"""
import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
from craft_at_sea import known_sea  # noqa: E402

from swath_sysid.attitude.hull.catalogue import hull_named  # noqa: E402
from swath_sysid.attitude.hull.terms import TERM_NAMES  # noqa: E402
from swath_sysid.attitude.identification.at_sea import identify_at_sea  # noqa: E402
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilityWatch  # noqa: E402
from swath_sysid.attitude.motion.trial import AxisMotion  # noqa: E402

WINDOW, HOUR, INTERVAL = 600.0, 3600.0, 0.1
HULL, PEAK_RATIO, STD = hull_named('swath-roll').model, 1.2, np.radians(2.0)
NOISE = 2e-4, 2e-3


def with_height(share):
    """The hull with so much of its metacentric height."""
    return replace(HULL, ratios=np.array([
        value * (share if name[0] in 'rs' else 1.0) for name, value in zip(TERM_NAMES, HULL.ratios, strict=True)
    ]))  # fmt: skip


def estimates(share, seed, duration, since=0.0):
    """The period of each window."""
    model = with_height(share)
    # the waves stay the same
    sea = known_sea(
        model, [seed], PEAK_RATIO * HULL.natural_period / model.natural_period, STD, duration, interval=INTERVAL
    )
    rng, found, rows = np.random.default_rng(seed), [], round(WINDOW / INTERVAL)
    angle = sea.angle[:, 0] + rng.normal(0.0, NOISE[0], sea.time.size)
    rate = sea.rate[:, 0] + rng.normal(0.0, NOISE[1], sea.time.size)
    for k in range(round(duration / WINDOW)):
        part = slice(k * rows, (k + 1) * rows)
        fit = identify_at_sea(AxisMotion('roll', INTERVAL * np.arange(angle[part].size), angle[part], rate[part]))
        begin = since + k * WINDOW
        found.append(
            PeriodEstimate(begin, begin + WINDOW, fit.natural_period, fit.natural_period_std, fit.amplitude)
        )
    return found


def watched(found):
    """What the watch said after each estimate."""
    watch, said = StabilityWatch(), []
    for estimate in found:
        watch.add(estimate)
        said.append(watch.newest)
    return said


def main():
    """Print a line a seed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seeds', type=int, default=20)
    parser.add_argument('--hours', type=float, default=6.0, help='without a change; 0: leave these runs out')
    arguments = parser.parse_args()
    for seed in range(arguments.seeds):
        said = watched(estimates(1.0, seed, HOUR) + estimates(0.9, 1000 + seed, 0.5 * HOUR, HOUR))
        warned = [(k, each) for k, each in enumerate(said) if each is not None and each.warning]
        after = f'{((warned[0][0] + 1) * WINDOW - HOUR) / 60.0:.0f} min after' if warned else 'not'
        last = said[-1]
        line = f'seed {seed}: found {after}; GM {last.relative:.3f} ({last.interval[0]:.3f} to {last.interval[1]:.3f})'
        if arguments.hours:
            same = watched(estimates(1.0, 2000 + seed, arguments.hours * HOUR))
            line += f'; alarms without a change: {sum(each is not None and bool(each.warning) for each in same)}'
        print(line, flush=True)


if __name__ == '__main__':
    main()
