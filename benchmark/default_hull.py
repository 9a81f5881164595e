"""What is identified where no equation is named, on simulated decays of the published hulls, and how long it takes.

    python benchmark/default_hull.py                    four hulls, released from 6 and 3 deg, 10 seeds each
    python benchmark/default_hull.py --seeds 2 --no-numba

The coefficients may trade with each other, the motion may not be wrong: the error is that of a release from 5 deg as
the model found simulates it, root mean square over that of the true motion.
"""

import argparse
import os
import sys
import time

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np

NEXT_DEG, NEXT_S = 5.0, 12.0


def judged(hull, angle_deg, seed):
    """Error of the next release, the equation, the verdict, and the processor time, s, of one default fit."""
    from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
    from swath_sysid.attitude.hull.simulation import simulate
    from swath_sysid.formats.identify_records import identify

    made = simulated_trial(
        hull.model, np.radians(angle_deg), 20.0, 100.0, SensorNoise(rate=hull.rate_noise), seed, hold=1.0
    )
    began = time.process_time()
    found = identify([made.axis(hull.axis)])
    took = time.process_time() - began
    at = np.arange(0.0, NEXT_S, 0.01)
    model = found.model.with_trim(0.0)
    (truth, _), (forecast, _) = (simulate(each, np.radians(NEXT_DEG), 0.0, at) for each in (hull.model, model))
    error = float(np.sqrt(np.mean((forecast - truth) ** 2)) / truth.std())
    return error, found.model.equation.name, found.verdict, took


def main():
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seeds', type=int, default=10)
    parser.add_argument('--no-numba', action='store_true', help='as where numba is not installed')
    given = parser.parse_args()
    if given.no_numba:
        os.environ['NUMBA_DISABLE_JIT'] = '1'
    from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS

    judged(PUBLISHED_HULLS['swath-pitch'], 6.0, 0)  # compiled and loaded
    for angle_deg in (6.0, 3.0):
        errors, times = [], []
        for name, hull in PUBLISHED_HULLS.items():
            rows = [judged(hull, angle_deg, seed) for seed in range(1, given.seeds + 1)]
            errors += (own := [row[0] for row in rows])
            times += [row[3] for row in rows]
            names = [row[1] for row in rows]
            wrong = sum(row[0] > 0.15 and row[2].level == 'adequate' for row in rows)
            print(
                f'{name:<16} {angle_deg:g} deg: error {min(own):.4f} to {max(own):.4f}, mean {np.mean(own):.4f}; '
                f'above .15 and adequate: {wrong}; verdicts {sorted({row[2].code for row in rows})}; '
                f'{ {n: names.count(n) for n in sorted(set(names))} }',
                flush=True,
            )
        print(
            f'all from {angle_deg:g} deg: at most {max(errors):.4f}, mean {np.mean(errors):.4f}; '
            f'{np.median(times):.2f} s a fit, at most {max(times):.2f}',
            flush=True,
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
