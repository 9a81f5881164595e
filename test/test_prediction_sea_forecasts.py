"""Forecasts in a JONSWAP sea, beside the filter that knows hull, noise and spectrum."""
import importlib.util
from pathlib import Path

import numpy as np
import pytest

_PLACE = Path(__file__).resolve().parents[1] / 'benchmark' / 'sea_forecasts.py'


@pytest.fixture(scope='module')
def sea_forecasts():
    """The benchmark, as a module."""
    spec = importlib.util.spec_from_file_location(_PLACE.stem, _PLACE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_shaping_filter_has_the_spectrum_of_the_excitation(sea_forecasts):
    sea = sea_forecasts.make_sea(1, 60.0)
    coefficients, noise, covariance = sea_forecasts.shaping_filter(sea)
    assert covariance[1:] @ coefficients + noise == pytest.approx(covariance[0], rel=1e-6)
    again = [covariance[abs(k - np.arange(1, sea_forecasts.ORDER + 1))] @ coefficients for k in (1, 10, 40)]
    assert again == pytest.approx(covariance[[1, 10, 40]], abs=1e-5 * covariance[0])


def test_forecasts_in_a_sea_come_near_those_of_the_filter_that_knows_everything(sea_forecasts):
    leads = 0.5, 2.0, 5.0
    sea, (ours, best, coverage) = sea_forecasts.compare(2, 200.0, 100.0, leads)
    assert np.abs(sea.angle).max() < 0.12
    assert np.all(best < 1.03) and np.all(best[:2] < ours[:2])
    assert np.all(ours < 1.3 * best) and np.all(ours < 1.03)
    assert np.all(np.abs(coverage - 0.9) < 0.06)
