"""Uncertainty of a fit: terms that a record cannot separate, and what it knows of them together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.amplitude import AmplitudeCurves, amplitude_curves
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, RESTORING_NAMES
from swath_sysid.common.covariance import NOT_SEPARABLE, correlation

RELATIVE_STEP = 1e-4


def known_together(terms: Sequence[str], covariance: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Groups of terms that the records do not separate, all of damping or all of restoring.

    Args:
        terms: Names.
        covariance: (n, n); of their ratios, of any unit.
    """
    linked = np.abs(correlation(covariance)) > NOT_SEPARABLE
    groups: list[tuple[str, ...]] = []
    for names in (DAMPING_NAMES, RESTORING_NAMES):
        places = [k for k, name in enumerate(terms) if name in names]
        together = [terms[k] for k in places if linked[k, places].sum() > 1]
        groups += [tuple(together)] if together else []
    return tuple(groups)


@dataclass(frozen=True)
class AmplitudeBands:
    """Natural frequency and equivalent damping over the amplitudes seen, with standard deviations."""

    curves: AmplitudeCurves
    frequency_std: np.ndarray  #: (A,)
    damping_ratio_std: np.ndarray  #: (A,)

    def at(self, amplitude: float) -> tuple[float, float, float, float]:
        """Natural period, s, damping ratio, and the standard deviation of each, at an amplitude, rad."""
        columns = (
            self.curves.frequency,
            self.curves.damping_ratio,
            self.frequency_std,
            self.damping_ratio_std,
        )
        frequency, damping, *stds = (float(np.interp(amplitude, self.curves.amplitude, c)) for c in columns)
        period = 2.0 * np.pi / frequency
        return period, damping, period * stds[0] / frequency, stds[1]


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
