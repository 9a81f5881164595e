"""Latin hypercube sampling, with the numbers of `scipy.stats.qmc`, which takes half a second to load."""

import numpy as np


def latin_hypercube(rng: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Points in the unit cube, (count, dimensions), one in each of ``count`` slices of every coordinate, as scipy's.
    McKay, Beckman and Conover, Technometrics 21 (1979), 239-245.
    """
    (rng,) = rng.spawn(1)
    within = rng.uniform(size=(count, dimensions))
    slices = np.tile(np.arange(1, count + 1), (dimensions, 1))
    for row in slices:
        rng.shuffle(row)
    return (slices.T - within) / count
