"""The published study of a WAM-V, carried out again."""

import numpy as np
import pytest

from swath_sysid.manoeuvring.paper.study import run_manoeuvring_study, track_error
from swath_sysid.manoeuvring.report.paper import manoeuvring_page


@pytest.fixture(scope='module')
def manoeuvring():
    return run_manoeuvring_study()


@pytest.mark.long
def test_the_catamarans_own_method_fits_its_track_and_tells_none_of_its_derivatives(manoeuvring):
    exact, measured = manoeuvring.runs['identification']
    assert track_error(measured, exact) == pytest.approx(0.3 * np.sqrt(2.0), rel=0.1)
    assert track_error(manoeuvring.simulated(manoeuvring.estimated, 'identification'), exact) < 0.1
    free = [d for d in manoeuvring.derivatives if np.isfinite(d.std)]
    assert len(free) == 10
    assert sum(d.std > abs(d.truth) for d in free) >= 8
    assert all(d.lower <= d.estimate <= d.upper for d in free)
    # in our method the drift of the turn is not taken for a compass askew
    assert 'compass-misaligned' not in {a.code for a in manoeuvring.ours.advice}
    assert track_error(manoeuvring.simulated(manoeuvring.ours.model, 'identification'), exact) < 2.0


@pytest.mark.long
def test_the_page_of_the_catamaran_and_its_derivatives_in_the_prime_system(manoeuvring):
    # Y of dv/dt: rho L^3 / 2
    assert manoeuvring.truth['Yv_dot'] == pytest.approx(-1120e-5 * 0.5 * 1025.0 * 3.91**3)
    # N of r: rho L^4 U / 2
    assert manoeuvring.truth['Nr'] == pytest.approx(-177e-5 * 0.5 * 1025.0 * 3.91**4 * 0.5)
    text = manoeuvring_page(manoeuvring, wall_s=1.0)
    assert all(f'As figure {n}:' in text for n in (4, 5, 6))
    assert all(str(value) in text for value in manoeuvring.content['derivatives']['printed'].values())
