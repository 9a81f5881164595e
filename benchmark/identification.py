"""How long identification takes, as ratios of what was measured side by side in one run.

    python benchmark/identification.py              all of it
    python benchmark/identification.py --plain      the same without numba

pymoo, which the project does not need, is compared with where it is installed.
"""

import argparse
import os
import statistics
import subprocess
import sys
import time

import numpy as np
from scipy.optimize import differential_evolution

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.terms import LOWER, UPPER
from swath_sysid.attitude.identification.forecast_check import OneStepObjective
from swath_sysid.attitude.identification.identify import _search_objective, identify_problem
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.accelerator import has_numba
from swath_sysid.common.optimisers import GeneticSearch, GeneticSettings

HULL = PUBLISHED_HULLS['swath-pitch'].model
LOWER_7, UPPER_7 = np.zeros(7), np.array([1.0, 50.0, 50.0, 50.0, 50.0, 200.0, 1000.0])


def median_time(function, runs=3):
    """Median wall time of some runs, s, and the last result."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        result = function()
        times.append(time.perf_counter() - begin)
    return statistics.median(times), result


def trial():
    """1500 samples of the published pitch hull, 6 deg, at the published noise."""
    return simulated_trial(HULL, np.radians(6), 15.0, 100.0, SensorNoise(), seed=1).axis('pitch')


def published_search(objective):
    """Our genetic algorithm at the published budget: 200 x 2000, seven variables."""
    settings = GeneticSettings(generations=2000, population=200, patience=0, spread_tolerance=0.0)
    search = GeneticSearch(LOWER_7, UPPER_7, settings, seed=1)
    while not search.should_stop():
        search.tell(objective(search.ask()))
    return search.best_value


def pymoo_search(objective):
    """pymoo's genetic algorithm at the same budget on the same vectorised objective."""
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class OneStep(Problem):
        def __init__(self):
            super().__init__(n_var=7, n_obj=1, xl=LOWER_7, xu=UPPER_7)

        def _evaluate(self, x, out, *args, **kwargs):
            out['F'] = objective(x)[:, None]

    return float(minimize(OneStep(), GA(pop_size=200), ('n_gen', 2000), seed=1).F[0])


def one_step():
    """The published search against its exact optimum and against pymoo."""
    full = OneStepObjective.of([trial()], [0.0], 0.006)
    equation = EQUATIONS['swath-pitch-1'].with_friction()
    places = np.eye(HULL.ratios.size)[equation.indices]
    exact = full(full.minimum(equation, 0.0 * HULL.ratios, UPPER_7 @ places)[None])[0]

    def objective(candidates):
        return full(candidates @ places)

    ours, value = median_time(lambda: published_search(objective))
    print(f'one-step, 200 x 2000, seven variables: {ours:.2f} s, F above the exact optimum by {value / exact - 1:.1e}')
    try:
        theirs, other = median_time(lambda: pymoo_search(objective), runs=1)
    except ImportError:
        print('  pymoo is not installed: not compared')
        return
    print(f'  pymoo: {theirs:.2f} s, {other / exact - 1:.1e} above; {theirs / ours:.1f} times as long')


def simulation():
    """The default identification, and scipy's differential evolution on the same search."""
    problem = prepare([trial()], 0.0, 15.0)
    settings = IdentificationSettings('swath-pitch-2')
    identify_problem(problem, settings)
    ours, found = median_time(lambda: identify_problem(problem, settings), runs=5)
    print(f'simulation objective, 1500 samples, search and refinement: {ours:.2f} s ({found.search.stop})')
    equation = found.model.equation
    objective = _search_objective(problem, equation, settings)
    bounds = list(zip(LOWER[equation.indices], UPPER[equation.indices], strict=True))
    searched, _ = median_time(lambda: search_only(objective, bounds))
    target = found.search.value * (1 + 1e-4)
    theirs, other = median_time(lambda: evolution_only(objective, bounds, target), runs=1)
    print(
        f'  search alone {searched:.2f} s; scipy differential_evolution to the same optimum {theirs:.2f} s '
        f'({theirs / searched:.1f} times as long, value ratio {other / found.search.value:.6f})'
    )


def search_only(objective, bounds):
    """Our search with its default settings."""
    lower, upper = np.transpose(bounds)
    search = GeneticSearch(lower, upper, GeneticSettings(), seed=1)
    while not search.should_stop():
        search.tell(objective(search.ask()))
    return search.best_value


def evolution_only(objective, bounds, target):
    """scipy's defaults, vectorised, until the target is reached."""

    def reached(best, convergence=0.0):
        return objective(best[None])[0] <= target

    found = differential_evolution(
        lambda columns: np.minimum(objective(columns.T), 1e100),
        bounds,
        vectorized=True,
        updating='deferred',
        polish=False,
        seed=1,
        tol=0.0,
        maxiter=2000,
        callback=reached,
    )
    return float(found.fun)


def long_record():
    """A lightly damped record of 17000 samples and 70 cycles, as a towing tank gives it."""
    model = HULL.of(b1=0.0144, b2=0.0607, r1=6.065, r3=3.84, axis='roll')
    record = simulated_trial(model, np.radians(10), 170.0, 100.0, SensorNoise(1e-4, 0.0), seed=1).axis('roll')
    angles = AxisMotion('roll', record.time, record.angle, None)
    problem = prepare([angles], 0.0, 170.0)
    settings = IdentificationSettings('odd-cubic')
    identify_problem(problem, settings)
    took, found = median_time(lambda: identify_problem(problem, settings))
    print(f'simulation objective, 17000 samples, 70 cycles: {took:.2f} s, R2 {found.r2:.6f}')


def main():
    """Print every figure, with numba and without."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--plain', action='store_true', help='without numba')
    if parser.parse_args().plain and 'NUMBA_DISABLE_JIT' not in os.environ:
        environment = os.environ | {'NUMBA_DISABLE_JIT': '1'}
        return subprocess.call([sys.executable, __file__, '--plain'], env=environment)
    print(f'numba: {"yes" if has_numba() else "no"}, load average {os.getloadavg()[0]:.1f}')
    one_step()
    simulation()
    long_record()
    return 0


if __name__ == '__main__':
    sys.exit(main())
