"""How well a hull is identified from motion in waves: the published roll hull, or a softer one, in known seas.

For each peak period and kind of excitation, fresh seeds of several hundred incommensurate waves; IMU noise is
added. The truth is the hull's own natural period and equivalent damping (`hull.amplitude`) at the record's amplitude,
two standard deviations of the roll.
"""

import sys
import time
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))

from craft_at_sea import known_sea  # noqa: E402

from swath_sysid.attitude.hull.catalogue import hull_named  # noqa: E402
from swath_sysid.attitude.hull.decay_model import DecayModel  # noqa: E402
from swath_sysid.attitude.motion.trial import AxisMotion  # noqa: E402
from swath_sysid.common.errors import InputError  # noqa: E402
from swath_sysid.evaluation.cli.benchmark import Benchmark  # noqa: E402
from swath_sysid.formats.identify_records import identify_at_sea  # noqa: E402

RATIOS = (0.7, 1.0, 1.5, 2.0, 3.0)
PERIOD_WITHIN, DAMPING_WITHIN = 0.03, 0.25
HULLS = {
    'swath-roll': hull_named('swath-roll').model,
    # 3.2 s, light damping, softening: the hull for seas near resonance that roll it by 5 to 6 deg
    'soft-roll': DecayModel.of(b1=0.25, b2=0.6, r1=3.855, r3=-6.0, axis='roll'),
}


def measured(sea, column, angle_noise, rate_noise):
    """The motion of one seed as an IMU would have recorded it."""
    rng = np.random.default_rng(1000 + column)
    noise = rng.normal(size=(2, sea.time.size)) * [[angle_noise], [rate_noise]]
    return AxisMotion('roll', sea.time, sea.angle[:, column] + noise[0], sea.rate[:, column] + noise[1])


def score(sea, seeds, angle_noise, rate_noise):
    """Relative errors and stated standard deviations, shape (seeds, 4); seconds each."""
    rows, begun = [], time.perf_counter()
    for column in range(len(seeds)):
        period, damping = sea.truth(column)
        try:
            found = identify_at_sea(measured(sea, column, angle_noise, rate_noise))
        except InputError as error:
            print(f'  seed {seeds[column]}: {error}')
            rows.append([np.inf] * 4)
            continue
        rows.append(
            [
                found.natural_period / period - 1.0,
                found.damping_ratio / damping - 1.0,
                found.natural_period_std / period,
                found.damping_ratio_std / damping,
            ]
        )
    return np.array(rows), (time.perf_counter() - begun) / len(seeds)


def _error_words(errors, stds, within):
    share, inside = np.mean(np.abs(errors) < within), np.mean(np.abs(errors) < 2.0 * stds)
    return (
        f'{100 * errors.mean():+5.1f} {100 * errors.std():4.1f} {100 * np.abs(errors).max():5.1f}, '
        f'{share:4.0%} within {100 * within:.0f}, {inside:4.0%} within 2 std, stated {100 * stds.mean():.1f}'
    )


def lines(
    *,
    seeds: int = 20,
    first_seed: int = 101,
    minutes: float = 15.0,
    rate_hz: float = 20.0,
    ratios: Annotated[float, 'peak period over natural period'] = RATIOS,
    hull: Annotated[str, HULLS] = 'swath-roll',
    std_deg: Annotated[float, 'of the roll'] = 1.1,
    angle_noise: Annotated[float, 'rad'] = 1e-3,
    rate_noise: Annotated[float, 'rad/s'] = 1.65e-2,
):
    """A line for each sea."""
    yield (
        f'{seeds} seeds, {minutes:g} min at {rate_hz:g} Hz, {std_deg:g} deg of roll; errors in % of the truth (bias, '
        'spread, worst); share within the target, and within twice the standard deviation stated; that'
    )
    tried = list(range(first_seed, first_seed + seeds))
    for by_slope, ratio in product((False, True), ratios):
        size, duration, interval = np.radians(std_deg), 60.0 * minutes, 1.0 / rate_hz
        try:
            sea = known_sea(HULLS[hull], tried, ratio, size, duration, by_slope=by_slope, interval=interval)
        except AssertionError as error:
            yield f'Tp/Tn {ratio:g}: {error}'
            continue
        rows, seconds = score(sea, tried, angle_noise, rate_noise)
        largest = np.degrees(np.abs(sea.angle).max())
        yield (
            f'moment by {"slope " if by_slope else "height"} Tp/Tn {ratio:g}, largest roll {largest:.1f} deg | '
            f'period {_error_words(rows[:, 0], rows[:, 2], PERIOD_WITHIN)} | '
            f'damping {_error_words(rows[:, 1], rows[:, 3], DAMPING_WITHIN)} | {seconds:.2f} s each'
        )


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
