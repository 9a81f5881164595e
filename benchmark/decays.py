"""Whether every release is found as a free decay, at its time, and none in waves: the corpus of the decay detector.

    python benchmark/decays.py                       the whole corpus
    python benchmark/decays.py --seeds 1 --seas 20   a part of it
    python benchmark/decays.py --rows                every release that was missed and every decay too many

Releases are made by scipy from the papers' coefficients (``basin.py``): a hand holds and wobbles, lets go, sometimes
twice, in basins that are never quite still. Seas are JONSWAP spectra through hulls of every damping.
"""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).resolve().parent))

import basin
import false_models
import numpy as np

from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.formats.reading import read_trial

ANGLES_DEG = 2.0, 4.0, 6.0, 8.0
RATES_HZ = 20.0, 50.0, 100.0
HULLS = {'swath-pitch': 6.0, 'swath-roll': 15.0, 'hydrofoil-pitch': 5.0, 'swath-usv-pitch': 9.0}
NEAR_S = 0.03  #: A fit loses little to a start so far from the release, or by one sample.
DATA = Path(__file__).resolve().parents[2] / 'shared' / 'data'

#: Earliest and latest start, earliest end, s, and period of the decay in each measured record.
MEASURED = {
    'decay/kvlcc2/run3_15kn.csv': ('roll', 24.0, 30.0, 70.0, 2.545),
    'decay/kvlcc2/run2_0kn.csv': ('roll', 9.0, 12.0, 174.0, 2.545),
    **{
        f'decay/foswec/pitch_{deg}deg_repeat{number}.csv': ('pitch', -0.15, 0.1, 6.5, 1.81)
        for deg in ('3', '5', '8.4')
        for number in (1, 2, 3)
    },
}


@dataclass(frozen=True)
class Made:
    """A record and the times of its releases, s."""

    name: str
    motion: AxisMotion
    releases: tuple[float, ...]


def sea(seed, duration=600.0, rate_hz=10.0):
    """Roll of a hull of random period and damping in a JONSWAP sea."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 1 / rate_hz)
    w = 2 * np.pi * np.fft.rfftfreq(time.size, 1 / rate_hz)[1:]
    natural = 2 * np.pi / rng.uniform(1.5, 8.0)
    damping_ratio = 10 ** rng.uniform(-1.8, -0.4)
    peak = natural / rng.uniform(0.7, 1.8)
    width = np.where(w <= peak, 0.07, 0.09)
    enhanced = rng.choice([1.0, 3.3, 7.0]) ** np.exp(-((w - peak) ** 2) / (2 * (width * peak) ** 2))
    spectrum = w**-5.0 * np.exp(-1.25 * (peak / w) ** 4) * enhanced
    response = natural**2 * w**2 / (natural**2 - w**2 + 2j * damping_ratio * natural * w)
    phases = rng.normal(size=w.size) + 1j * rng.normal(size=w.size)
    angle = np.fft.irfft(np.concatenate([[0.0], response * np.sqrt(spectrum) * phases]), time.size)
    angle *= np.radians(rng.uniform(1.0, 6.0)) / angle.std()
    return AxisMotion('roll', time, angle + basin.ANGLE_NOISE * rng.normal(size=time.size), None, f'sea {seed}')


def sea_after_rest(seed):
    """Waves that set in a minute after the record began."""
    motion = sea(1000 + seed, 180.0)
    rising = np.clip((motion.time - 60.0) / 3.0, 0.0, 1.0)
    return AxisMotion('roll', motion.time, motion.angle * rising, None, f'sea after rest {seed}')


def live_window(seed):
    """Some seconds of a sea, as the motion window of the nodes sees them."""
    rng = np.random.default_rng(seed)
    length = rng.choice([15.0, 30.0, 60.0])
    start = rng.uniform(0.0, 600.0 - length)
    return sea(seed // 4).between(start, start + length)


def released_again(hull, angle_deg, count, seed):
    """A hull at rest that is inclined slowly, held by a wobbling hand and released, once or several times."""
    rng = np.random.default_rng([seed, count, round(angle_deg), list(HULLS).index(hull)])
    axis, c, _ = basin.HULLS[f'{hull} {HULLS[hull]:.0f}']
    rate_hz, level = RATES_HZ[rng.integers(len(RATES_HZ))], rng.choice([0.3, 1.0])
    angles, speeds, releases, now = [], [], [], 0.0
    for size in np.radians(angle_deg) * rng.uniform(0.7, 1.0, count):
        rest, raising, holding = rng.uniform(2.0, 6.0), rng.uniform(1.5, 4.0), rng.uniform(1.5, 6.0)
        held = np.arange(round((rest + raising + holding) * rate_hz)) / rate_hz
        w, phase = 2 * np.pi * rng.uniform(0.4, 1.5, 3), rng.uniform(0, 2 * np.pi, 3)
        wobble = 0.02 * size * rng.rayleigh(1, 3)
        free = np.arange(round(rng.uniform(10.0, 20.0) * rate_hz)) / rate_hz
        lag = rng.uniform(0.0, 1.0) / rate_hz
        let_go = held[-1] + 1.0 / rate_hz - lag
        moments = np.append(held, let_go)
        turn, swing = np.pi * np.clip((moments - rest) / raising, 0.0, 1.0), w * moments[:, None] + phase
        share, level_held = 0.5 - 0.5 * np.cos(turn), size + np.sum(wobble * np.sin(swing), axis=1)
        hand = share * level_held
        hand_speed = 0.5 * np.pi / raising * np.sin(turn) * level_held + share * ((wobble * w) * np.cos(swing)).sum(
            axis=1
        )
        angle, speed = basin.free_motion(c, hand[-1], hand_speed[-1], np.r_[0.0, free + lag])
        angles += [hand[:-1], angle[1:]]
        speeds += [hand_speed[:-1], speed[1:]]
        releases.append(now + let_go)
        now += (held.size + free.size) / rate_hz
    side = rng.choice([-1.0, 1.0])
    angle, speed = side * np.concatenate(angles), side * np.concatenate(speeds)
    time = np.arange(angle.size) / rate_hz
    angle = angle + np.radians(rng.uniform(-1.0, 1.0)) + level * basin.ANGLE_NOISE * rng.normal(size=time.size)
    speed = speed + level * basin.RATE_NOISE * rng.normal(size=time.size)
    name = f'{hull} {angle_deg:g} deg x{count} {rate_hz:g} Hz seed {seed}'
    return Made(name, AxisMotion(axis, time, angle, speed if rng.random() < 0.7 else None), tuple(releases))


def releases_made(seeds):
    """Every scene of ``basin.py``, and single, double and triple releases of the four hulls."""
    for seed in range(seeds):
        for scene in basin.SCENES:
            for hull in basin.HULLS:
                made = basin.made_trial(hull, basin.SCENES[scene], seed)
                motion = AxisMotion(made.axis, made.time, made.angle, made.rate)
                yield Made(f'{hull} {scene} seed {seed}', motion, (made.release,))
        for hull in HULLS:
            for angle_deg in ANGLES_DEG:
                for count in (1, 2, 3):
                    yield released_again(hull, angle_deg, count, seed)


def lateness(decays, release, following):
    """Seconds from a release to the start of the decay found there, None where none was."""
    own = [each for each in decays if abs(each.start - release) < each.period and each.start < following]
    return min((each.start - release for each in own), key=abs, default=None)


def measured_misses():
    """The measured decay records in which the decay was not found where it is."""
    misses = []
    for name, (axis, earliest, latest, end, period) in MEASURED.items():
        found = find_decays(read_trial(DATA / name).axis(axis))
        best = found[0] if found else None
        if best is None or not (
            earliest <= best.start <= latest and best.end >= end and abs(best.period / period - 1.0) < 0.03
        ):
            misses.append(f'{name}: {best}')
    return misses


def report(title, misses, total, rows):
    """One line, and what it counts."""
    yield f'{title:<44}{len(misses):>5} of {total}'
    if rows:
        yield '\n'.join(f'    {each}' for each in misses)


def lines(*, seeds: Annotated[int, 'at least 1'] = 2, seas: int = 100, rows: bool = False):
    """Every figure."""
    missed, late, many, total, double = [], [], [], 0, 0
    for made in releases_made(seeds):
        decays = find_decays(made.motion)
        known = 0
        for release, following in zip(made.releases, (*made.releases[1:], np.inf), strict=True):
            off = lateness(decays, release, following)
            total += 1
            if off is None:
                missed.append(f'{made.name}: {release:.2f} s, found {[round(each.start, 2) for each in decays]}')
                continue
            known += 1
            if abs(off) > max(NEAR_S, made.motion.sample_interval):
                late.append(f'{made.name}: {release:.2f} s, {off:+.3f} s')
        double += 1
        if len(decays) > known:
            many.append(f'{made.name}: {made.releases}, found {[round(each.start, 2) for each in decays]}')
    found, near = 1 - len(missed) / total, 1 - (len(missed) + len(late)) / total
    yield f'releases found {found:.4f}, within 30 ms or a sample {near:.4f}'
    yield from report('releases not found', missed, total, rows)
    yield from report('releases found, but off by more', late, total, rows)
    yield from report('records with a decay too many', many, double, rows)
    yield from report('measured decays not found', measured_misses() if DATA.is_dir() else [], len(MEASURED), True)
    waves = [sea(seed) for seed in range(seas)] + [sea_after_rest(seed) for seed in range(seas // 4)]
    if DATA.is_dir():
        trials = [read_trial(DATA / f'waves/{name}.csv') for name in ('morro_buoy', 'nbp1406_ship')]
        waves += [trial.axis(axis) for trial in trials for axis in trial.axes]
    false = [f'{motion.source}: {found}' for motion in waves if (found := find_decays(motion))]
    yield from report('seas with a decay', false, len(waves), rows)
    windows = [live_window(seed) for seed in range(4 * seas)]
    yield from report(
        'windows of seas with a decay', [each.source for each in windows if find_decays(each)], len(windows), False
    )
    for kind in false_models.KINDS:
        found = [seed for seed in range(40) if find_decays(false_models.made_motion(kind, seed))]
        yield from report(f'{kind} called a decay', found, 40, False)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
