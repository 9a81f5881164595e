"""Natural frequency and equivalent damping of a nonlinear hull as functions of amplitude.

The undamped orbit of amplitude a lies between c - a and c + a, where the potential energies are equal (with even
restoring terms c is not the trim). By Gauss-Chebyshev quadrature over that orbit

    T = 2 int dx / w(x),   b_eq = oint D(w) dx / oint w dx,   zeta_eq = b_eq / (2 w0(a)),

for harmonic motion b1 + 8/(3 pi) b2 w0 a + 3/4 b3 w0^2 a^2 + 4 b0 / (pi w0 a).
"""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.terms import TERM_NAMES, damping_moment, restoring_energy, restoring_moment

QUADRATURE_NODES = 96
NEWTON_STEPS = 6  #: Each doubles the correct digits.

_ALL_TERMS = (True,) * len(TERM_NAMES)


@dataclass(frozen=True)
class AmplitudeCurves:
    """What a hull's oscillation looks like at each amplitude."""

    amplitude: np.ndarray  #: (A,); Half the peak-to-peak motion, rad.
    frequency: np.ndarray  #: (A,); undamped natural frequency, rad/s; NaN where there is no closed orbit.
    damping_ratio: np.ndarray  #: (A,); Equivalent linear damping over critical damping.


def amplitude_curves(ratios: np.ndarray, amplitude: np.ndarray, friction_rate: float) -> AmplitudeCurves:
    """Natural frequency and equivalent damping of ratios (9,) at amplitudes (A,) > 0, rad; friction rate in rad/s."""
    ratios = np.asarray(ratios, dtype=float)
    amplitude = np.asarray(amplitude, dtype=float)
    with np.errstate(all='ignore'):
        centre = orbit_centre(ratios, amplitude)
        theta = np.pi * (np.arange(QUADRATURE_NODES) + 0.5) / QUADRATURE_NODES
        x = centre[:, None] + amplitude[:, None] * np.cos(theta)
        height = restoring_energy(centre + amplitude, ratios)[:, None] - restoring_energy(x, ratios)
        rate = np.sqrt(2.0 * height)
        arc = amplitude[:, None] * np.sin(theta)
        period = 2.0 * np.pi * np.mean(arc / rate, axis=1)
        taken = np.mean(damping_moment(rate, ratios, _ALL_TERMS, friction_rate) * arc, axis=1)
        upper, lower = (restoring_energy(centre + side * amplitude, ratios) for side in (1.0, -1.0))
        meets = np.abs(upper - lower) <= 1e-6 * np.abs(upper + lower)
        closed = (np.abs(centre) < amplitude) & (height > 0.0).all(axis=1) & meets
        frequency = np.where(closed, 2.0 * np.pi / period, np.nan)
        damping = taken / np.mean(rate * arc, axis=1)
        return AmplitudeCurves(amplitude, frequency, damping / (2.0 * frequency))


def orbit_centre(ratios: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """Middle of the undamped orbit of each amplitude (A,), rad from trim, by Newton's method."""
    centre = np.zeros_like(amplitude)
    if not (ratios[5] or ratios[8]):
        return centre
    for _ in range(NEWTON_STEPS):
        upper, lower = centre + amplitude, centre - amplitude
        gap = restoring_energy(upper, ratios) - restoring_energy(lower, ratios)
        slope = restoring_moment(upper, ratios, _ALL_TERMS) - restoring_moment(lower, ratios, _ALL_TERMS)
        centre = centre - np.clip(gap / slope, -0.5 * amplitude, 0.5 * amplitude)
    return centre
