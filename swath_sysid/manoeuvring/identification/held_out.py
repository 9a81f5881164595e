"""Runs held out one at a time: what they say of a set of terms, and how firmly the others hold the values.

The values without a run are those of all runs less the step that the run itself was worth (one Gauss-Newton step on
the others); under them the run is simulated freely from its measured states.
"""

from collections.abc import Sequence

import numpy as np

from swath_sysid.manoeuvring.identification.shooting import MultipleShooting

LOSS_TURNS_AT = 3.0  #: Standard deviations beyond which a residual counts by its size, not its square.

#: Of the misfit of all runs, and of what terms change in it: what one run exceeds it by does not count.
LARGEST_SHARE = 0.25

SCATTER = 0.5  #: Standard errors of the runs by which terms must help.
MIN_GAIN = 0.003  #: Share of the misfit that terms must explain of runs they were not fitted to.


def values_without_each_part(
    shooting: MultipleShooting, values: np.ndarray, parts: Sequence[tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """The values that the runs but one would give, shape (K, n).

    What holds the fit beside the runs stays in force: the regularisation, the demand of stable straight courses, and
    bounds that it has come to rest at. Otherwise unstable models would judge a hull that hardly keeps its course.

    Args:
        shooting: Of the fit.
        values: (n,); of its unknowns.
        parts: list of (ndarray of shape (N_k,), ndarray of shape (N_k, n)); residuals and Jacobian of each run: see
            `MultipleShooting.by_part`.
    """
    units, spread = shooting.unknowns.units, shooting.unknowns.spread
    at_rest = (values - shooting.unknowns.lower < 1e-9 * units) | (shooting.unknowns.upper - values < 1e-9 * units)
    units = np.where(at_rest, 0.0, units)
    scaled = [
        (np.clip(np.nan_to_num(r, nan=1e6), -1e6, 1e6), np.nan_to_num(j, posinf=0.0, neginf=0.0) * units)
        for r, j in parts
    ]
    prior = np.where(np.isfinite(spread), (units / spread) ** 2, 0.0)
    stability = shooting.instability_slopes(values) * units
    information = sum(j.T @ j for _, j in scaled) + stability.T @ stability + np.diag(prior + 1e-9)
    found = []
    for residual, jacobian in scaled:
        others = information - jacobian.T @ jacobian
        step = np.linalg.lstsq(others, jacobian.T @ residual, rcond=1e-10)[0]
        found.append(np.clip(values + step * units, shooting.unknowns.lower, shooting.unknowns.upper))
    return np.array(found)


def held_out_costs(shooting: MultipleShooting, values_without_it: np.ndarray) -> np.ndarray:
    """Misfit of each part in free runs under the values of the others, (K, n); shape (K,)."""
    residual = shooting.free_run_residuals(values_without_it)
    residual = np.clip(np.nan_to_num(residual, nan=1e3), -1e3, 1e3) / LOSS_TURNS_AT
    by_window = np.sum(np.sqrt(1.0 + residual**2) - 1.0, axis=(0, 1))
    return np.bincount(shooting.part_of_window, by_window)


def helps(costs: np.ndarray, costs_before: np.ndarray) -> bool:
    """Whether terms help runs that they were not fitted to, beyond the runs' scatter.

    Args:
        costs, costs_before: (K,); `held_out_costs` with the terms and without.
    """
    if costs.size < 2:
        # nothing can be held out of a single window
        return True
    weight = np.minimum(1.0, LARGEST_SHARE * costs_before.sum() / np.maximum(costs_before, 1e-300))
    gain = weight * (costs_before - costs)
    most = LARGEST_SHARE * np.abs(gain).sum()
    gain = np.clip(gain, -most, most)
    scatter = gain.std(ddof=1) * np.sqrt(gain.size)
    return bool(gain.sum() > max(SCATTER * scatter, MIN_GAIN * float(weight @ costs_before)))


def covariance_over_runs(without: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """A covariance no smaller than what the runs scatter by.

    The jackknife over runs (a sandwich over clusters with its leverage taken out: Bell and McCaffrey 2002, CR3)
    gives the variances where it is larger; few runs give no correlations, which stay.

    Args:
        without: (K, n); values without each run.
        matrix: (n, n); by the residuals' autocorrelation.
    """
    count = len(without)
    scatter = (count - 1.0) / count * np.sum((without - without.mean(axis=0)) ** 2, axis=0)
    return with_variances_of_at_least(matrix, scatter)


def with_variances_of_at_least(matrix: np.ndarray, least: np.ndarray) -> np.ndarray:
    """A covariance with its variances raised to some, shape (n,), where they are smaller; correlations stay."""
    variance = np.diag(matrix)
    with np.errstate(invalid='ignore', divide='ignore'):
        larger = np.sqrt(np.where(least > variance, least / variance, 1.0))
    larger = np.where(np.isfinite(larger), larger, 1.0)
    return matrix * np.outer(larger, larger)
