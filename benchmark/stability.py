"""The stability watch in simulated irregular seas: python benchmark/stability.py [--seeds 20] [--hours 6]

A published SWATH rolls in waves of its own for each seed; every ten minutes are identified.  After some 65 min,
anywhere in a window, a tenth of its restoring moment is gone in the same sea; in other runs, of --hours, nothing
changes.  Printed: when the watch says so, by how much, and how often it warned where nothing had changed.
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
from craft_at_sea import driven, jonswap, scale_for  # noqa: E402

from swath_sysid.attitude.hull.catalogue import hull_named  # noqa: E402
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERM_NAMES  # noqa: E402
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilityWatch  # noqa: E402
from swath_sysid.attitude.motion.trial import AxisMotion  # noqa: E402
from swath_sysid.evaluation.cli.benchmark import Benchmark  # noqa: E402
from swath_sysid.formats.identify_records import identify_at_sea  # noqa: E402

WINDOW, INTERVAL, SETTLING = 600.0, 0.1, 60.0
BEFORE, AFTER = 4200.0, 1800.0
"""s around the change; the windows of a seed begin up to one window late."""

HULL, PEAK_RATIO, GAMMA, STD = hull_named('swath-roll').model, 1.2, 3.3, np.radians(1.4)
"""At -7.8 deg this hull capsizes, which a sea of 2 deg brings about within hours."""

NOISE = 2e-4, 2e-3


def with_height(share):
    """The hull with so much of its metacentric height."""
    return replace(HULL, ratios=HULL.ratios * [1.0 if name in DAMPING_NAMES else share for name in TERM_NAMES])


def sea_moments(seeds, duration):
    """Moments of Gaussian seas that do not repeat, at half steps, shape (2 N + 1, S)."""
    count = 2 * round(duration / INTERVAL) + 1
    frequency = 2.0 * np.pi * np.fft.rfftfreq(count, 0.5 * INTERVAL)
    peak = HULL.natural_frequency / PEAK_RATIO
    lines = np.zeros((frequency.size, len(seeds)), dtype=complex)
    inside = (frequency > 0.4 * peak) & (frequency < 5.0 * peak)
    amplitude = np.sqrt(jonswap(frequency[inside], peak, GAMMA))
    for column, seed in enumerate(seeds):
        lines[inside, column] = amplitude * (np.random.default_rng(seed).normal(size=(amplitude.size, 2)) @ (1.0, 1j))
    moments = np.fft.irfft(lines, count, axis=0)
    return moments / moments.std()


def measured(seeds, legs):
    """Angle and rate with noise, shapes (N, S), of hulls one after another in the same seas: legs of (hull, s)."""
    moments = sea_moments(seeds, SETTLING + sum(duration for _, duration in legs))
    moments *= scale_for(HULL, moments, STD, INTERVAL)
    angle, rate = driven(HULL, moments[: 2 * round(SETTLING / INTERVAL) + 3], INTERVAL)
    parts, begin = [], round(SETTLING / INTERVAL)
    for hull, duration in legs:
        steps = round(duration / INTERVAL)
        # one step more: the state from which the next leg begins
        angle, rate = driven(hull, moments[2 * begin : 2 * (begin + steps) + 3], INTERVAL, (angle[-1], rate[-1]))
        parts.append((angle[:steps], rate[:steps]))
        begin += steps
    assert np.isfinite(angle).all(), 'a hull capsized: choose a smaller STD'
    rng = np.random.default_rng([*seeds])
    return [
        np.concatenate(part) + rng.normal(0.0, noise, (begin - round(SETTLING / INTERVAL), len(seeds)))
        for part, noise in zip(zip(*parts, strict=True), NOISE, strict=True)
    ]


def watched(angle, rate, since=0.0):
    """The end of each window of one sea, s, and what the watch said then."""
    watch, rows = StabilityWatch(), round(WINDOW / INTERVAL)
    for first in range(round(since / INTERVAL), angle.size - rows + 1, rows):
        part = slice(first, first + rows)
        fit = identify_at_sea(AxisMotion('roll', INTERVAL * np.arange(rows), angle[part], rate[part]))
        begin, end = INTERVAL * first, INTERVAL * (first + rows)
        watch.add(PeriodEstimate(begin, end, fit.natural_period, fit.natural_period_std, fit.amplitude))
        yield end, watch.newest


def lines(*, seeds: int = 20, hours: Annotated[float, 'without a change; 0: leave these runs out'] = 6.0):
    """A line a seed."""
    angle, rate = measured(range(seeds), [(HULL, BEFORE), (with_height(0.9), AFTER + WINDOW)])
    for seed in range(seeds):
        since = np.random.default_rng(seed).uniform(0.0, WINDOW)
        said = [(end - BEFORE, each) for end, each in watched(angle[:, seed], rate[:, seed], since) if each is not None]
        warned = [(late, each) for late, each in said if each.warning]
        found = f'{warned[0][0] / 60.0:.0f} min after' if warned else 'not'
        last = max((pair for pair in said if pair[0] <= AFTER), key=lambda pair: pair[0])[1]
        low, high = last.interval
        yield f'seed {seed}: found {found}; GM half an hour after {last.relative:.3f} ({low:.3f} to {high:.3f})'
    if not hours:
        return
    angle, rate = measured([1000 + seed for seed in range(seeds)], [(HULL, 3600.0 * hours)])
    for seed in range(seeds):
        said = [each for _, each in watched(angle[:, seed], rate[:, seed]) if each is not None]
        alarms = sum(bool(each.warning) for each in said)
        end = f'GM at the end {said[-1].relative:.3f}'
        yield f'seed {seed}: {len(said)} judgements in {hours:g} h without a change, {alarms} warnings, {end}'


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
