"""How many motions that are no free decay become a model, and how that model is judged.

    python benchmark/false_models.py                  200 records
    python benchmark/false_models.py --count 60 --rows

Each record is an angle that something else than the hull's own restoring moment made, with the rate that goes with it.
Printed by kind: records in which no decay was found, and the verdicts on the others. None may be adequate.
"""

import os
from typing import Annotated

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np

RATE_HZ = 50.0
DURATION_S = 60.0
ANGLE_NOISE, RATE_NOISE = 5e-4, 3e-3
"""rad and rad/s, white."""


def bump(t, rng):
    """The other axis dips as the craft is pushed: one or two humps."""
    angle = np.zeros(t.size)
    at = 20.0
    for sign in (1.0, -1.0)[: rng.integers(1, 3)]:
        width = rng.uniform(0.2, 1.5)
        angle += sign * rng.uniform(1.0, 6.0) * np.exp(-(((t - at) / width) ** 2))
        at += width * rng.uniform(1.5, 3.0)
    return angle


def trim_shift(t, rng):
    """Somebody or something moves across the craft."""
    span = rng.uniform(0.5, 4.0)
    return rng.uniform(0.5, 4.0) * 0.5 * (1.0 - np.cos(np.pi * np.clip((t - 20.0) / span, 0.0, 1.0)))


def wake(t, rng):
    """The packet of a passing boat: fast to rise, slower to fall, its period shortening."""
    since = t - 20.0
    rise, fall = rng.uniform(1.0, 3.0), rng.uniform(2.0, 8.0)
    phase = 2.0 * np.pi * since / rng.uniform(1.0, 4.0) * (1.0 + rng.uniform(0.0, 0.02) * since)
    return rng.uniform(2.0, 8.0) * np.exp(-((since / np.where(since < 0.0, rise, fall)) ** 2)) * np.cos(phase)


def waves_that_stop(t, rng):
    """Irregular waves until something shelters the craft."""
    period = rng.uniform(1.5, 4.0)
    frequency = 2.0 * np.pi / period * rng.uniform(0.7, 1.3, 15)
    waves = np.sum(rng.rayleigh(0.6, 15) * np.cos(frequency * t[:, None] + rng.uniform(0, 2 * np.pi, 15)), axis=1)
    return waves * 0.5 * (1.0 - np.tanh((t - rng.uniform(25.0, 45.0)) / rng.uniform(0.3, 4.0)))


def rocking(t, rng):
    """A hand rocks the craft, unevenly, and stops it."""
    period, begin, end = rng.uniform(1.0, 4.0), 15.0, rng.uniform(22.0, 35.0)
    sway = np.cumsum(rng.normal(size=t.size)) / np.sqrt(RATE_HZ)
    size = rng.uniform(2.0, 8.0) * (1.0 + 0.15 * sway) * (1.0 + rng.uniform(-0.03, 0.0) * (t - begin))
    hand = 1.0 / (1.0 + np.exp(-(t - begin) / 0.5)) / (1.0 + np.exp((t - end) / rng.uniform(0.1, 0.6)))
    return smooth(size * np.sin(2.0 * np.pi * t / period + 0.3 * sway) * hand)


def dock_bump(t, rng):
    """The craft strikes and bounces, to one side, ever shorter."""
    angle, begin, width, size = np.zeros(t.size), 20.0, rng.uniform(0.3, 1.5), rng.uniform(1.5, 6.0)
    for _ in range(rng.integers(2, 6)):
        within = (t >= begin) & (t < begin + width)
        angle[within] += size * np.sin(np.pi * (t[within] - begin) / width)
        begin += width
        width, size = width * rng.uniform(0.6, 0.95), size * rng.uniform(0.3, 0.7)
    return smooth(angle)


KINDS = {each.__name__: each for each in (bump, trim_shift, wake, waves_that_stop, rocking, dock_bump)}


def smooth(angle):
    """Without corners that no mass can follow."""
    kernel = np.hanning(9)
    return np.convolve(angle, kernel / kernel.sum(), mode='same')


def made_motion(kind, seed):
    """A record of one axis, rad and rad/s.

    Args:
        kind: Of ``KINDS``.
        seed: Of its size, its course and the noise.
    """
    from swath_sysid.attitude.motion.trial import AxisMotion

    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    time = np.arange(round(DURATION_S * RATE_HZ)) / RATE_HZ
    angle = np.radians(KINDS[kind](time, rng) + rng.uniform(-1.0, 1.0))
    rate = np.gradient(angle, time)
    angle = angle + ANGLE_NOISE * rng.normal(size=time.size)
    return AxisMotion('pitch', time, angle, rate + RATE_NOISE * rng.normal(size=time.size))


def verdict_on(motion):
    """Level, code and sentence of the default fit; ``no decay`` where there is nothing to fit."""
    from swath_sysid.attitude.identification.identify import identify_problem
    from swath_sysid.attitude.identification.problem import decays_or_waves
    from swath_sysid.attitude.identification.result import IdentificationSettings
    from swath_sysid.common.errors import InputError

    try:
        problem = decays_or_waves([motion])
        if problem is None:
            return 'no decay', 'waves', ''
        found = identify_problem(problem, IdentificationSettings())
    except InputError as error:
        return 'no decay', error.code, str(error)
    verdict, segment = found.verdict, found.records[0].segment
    of = (
        f'{found.model.equation.name} T {found.model.natural_period:.3g} s, oscillates with {segment.period:.3g} s, '
        f'{segment.beginning}, {segment.cycles:.1f} cycles, r2 {found.r2:.4f}, error {verdict.motion_error:.3g}'
    )
    return verdict.level, verdict.code, of


def lines(
    *, count: int = 200, kinds: Annotated[str, KINDS] = tuple(KINDS), rows: Annotated[bool, 'print every fit'] = False
):
    """Every kind."""
    adequate = 0
    for place, kind in enumerate(kinds):
        seeds = range(len(range(place, count, len(kinds))))
        found = [verdict_on(made_motion(kind, seed)) for seed in seeds]
        levels = [level for level, _, _ in found]
        adequate += levels.count('adequate')
        yield f'{kind:<16} { {level: levels.count(level) for level in sorted(set(levels))} }'
        for seed, (level, code, words) in zip(seeds, found, strict=True):
            if level == 'adequate' or (rows and level != 'no decay'):
                yield f'  seed {seed}: {level}, {code}: {words}'
    yield f'{adequate} of {count} adequate'
    return int(adequate > 0)


if __name__ == '__main__':
    from swath_sysid.evaluation.cli.benchmark import Benchmark

    raise SystemExit(Benchmark(__doc__, lines).run())
