"""Uncertainty of a fit: covariance, correlation, and terms that a record cannot separate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.amplitude import AmplitudeCurves, amplitude_curves
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.common.advice import Advice
from swath_sysid.common.covariance import NOT_SEPARABLE, correlation

RELATIVE_STEP = 1e-4


def inseparable_terms(terms: Sequence[str], covariance: np.ndarray) -> tuple[Advice, ...]:
    """Advice for each pair of terms that the records cannot separate.

    Args:
        terms: Names.
        covariance: (n, n); of their ratios, of any unit.
    """
    found = correlation(covariance)
    pairs = [(i, j) for i in range(len(terms)) for j in range(i) if abs(found[i, j]) > NOT_SEPARABLE]
    return tuple(
        Advice(
            'not-separable',
            f'{terms[j]} and {terms[i]} cannot be told apart on these records (correlation {found[i, j]:+.3f}): use '
            'them together only, choose an equation without one of them, or add records of other amplitudes',
        )
        for i, j in pairs
    )


@dataclass(frozen=True)
class AmplitudeBands:
    """Natural frequency and equivalent damping over the amplitudes seen, with standard deviations."""

    curves: AmplitudeCurves
    frequency_std: np.ndarray  #: (A,)
    damping_ratio_std: np.ndarray  #: (A,)


def amplitude_bands(model: DecayModel, covariance: np.ndarray, amplitude: np.ndarray) -> AmplitudeBands:
    """Curves against amplitude with the standard deviations that the ratios' covariance implies.

    Args:
        model: Whose curves they are.
        covariance: (n, n); of the ratios of the model's terms.
        amplitude: (A,); rad.
    """
    curves = amplitude_curves(model.ratios, amplitude, model.friction_rate)
    std = np.sqrt(np.diag(covariance))
    slopes = []
    for index, spread in zip(model.equation.indices, std, strict=True):
        step = RELATIVE_STEP * max(abs(model.ratios[index]), spread) or RELATIVE_STEP
        sides = []
        for sign in (1.0, -1.0):
            ratios = model.ratios.copy()
            ratios[index] += sign * step
            sides.append(amplitude_curves(ratios, amplitude, model.friction_rate))
        slopes.append(
            [
                (sides[0].frequency - sides[1].frequency) / (2 * step),
                (sides[0].damping_ratio - sides[1].damping_ratio) / (2 * step),
            ]
        )
    frequency, damping = np.moveaxis(np.array(slopes), 1, 0)
    return AmplitudeBands(curves, _spread(frequency, covariance), _spread(damping, covariance))


def _spread(slopes: np.ndarray, covariance: np.ndarray):
    """Standard deviation of a quantity of slopes (n, A) by the delta method, shape (A,)."""
    return np.sqrt(np.maximum(np.einsum('ia,ij,ja->a', slopes, covariance, slopes), 0.0))
