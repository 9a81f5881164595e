"""Latin hypercube sampling, with the numbers of `scipy.stats.qmc`, which takes half a second to load."""

import numpy as np


def latin_hypercube(rng: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Points in the unit cube, shape (count, dimensions): every coordinate hits each of ``count`` equal slices once.

    A child of the generator is drawn from, as `scipy.stats.qmc` does.

    McKay, Beckman and Conover, Technometrics 21 (1979), 239-245.
    """
    (rng,) = rng.spawn(1)
    within = rng.uniform(size=(count, dimensions))
    slices = np.tile(np.arange(1, count + 1), (dimensions, 1))
    for row in slices:
        rng.shuffle(row)
    return (slices.T - within) / count
