"""Latin hypercube sampling beside scipy's."""

import numpy as np
import pytest
from scipy.stats import qmc

from swath_sysid.common.latin_hypercube import latin_hypercube


@pytest.mark.parametrize('count', [1, 2, 33])
def test_the_sample_is_that_of_scipy(count):
    ours, theirs = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(2):
        np.testing.assert_array_equal(latin_hypercube(ours, count, 5), qmc.LatinHypercube(5, seed=theirs).random(count))
    assert ours.random() == theirs.random()
