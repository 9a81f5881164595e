"""How far a fit can be trusted: covariance, correlation, and what a record cannot tell apart."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.hull.amplitude import AmplitudeCurves, amplitude_curves
from swath_sysid.identification.noise import autocovariance, correlated_information

NOT_SEPARABLE = 0.95
RELATIVE_STEP = 1e-4


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance of the fitted parameters, residual autocorrelation accounted for.

    Attributes
    ----------
    matrix : ndarray, shape (p, p)
    effective_samples : float
        Number of independent samples that would leave the same uncertainty.
    """

    matrix: np.ndarray
    effective_samples: float


def sandwich_covariance(residuals, jacobians, shortest_memory):
    """Covariance of least-squares parameters under autocorrelated residuals.

    A^-1 (sum_k J_k^T Gamma_k J_k) A^-1 with A = J^T J and Gamma_k the Toeplitz matrix of the
    autocovariance of the residuals of one record and channel (Newey and West 1987). White
    residuals give the usual s^2 (J^T J)^-1.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (N_k,)
    jacobians : sequence of ndarray, shape (N_k, p)
    shortest_memory : int
        See `autocovariance`; samples.

    Returns
    -------
    ParameterCovariance
        Parameters that the residuals do not depend on have NaN rows and columns.
    """
    information = sum(j.T @ j for j in jacobians)
    known = np.diag(information) > 0.0
    count = sum(r.size for r in residuals)
    freedom = count / max(1, count - known.sum())
    correlated, white = np.zeros_like(information), np.zeros_like(information)
    for residual, jacobian in zip(residuals, jacobians, strict=True):
        covariance = autocovariance(residual, shortest_memory)
        correlated += correlated_information(jacobian, covariance)
        white += covariance[0] * jacobian.T @ jacobian
    scale = np.sqrt(np.diag(information)[known])
    inverse = np.linalg.pinv(information[np.ix_(known, known)] / np.outer(scale, scale), rcond=1e-14, hermitian=True)
    inverse /= np.outer(scale, scale)
    matrix = np.full_like(information, np.nan)
    matrix[np.ix_(known, known)] = freedom * inverse @ correlated[np.ix_(known, known)] @ inverse
    independent = freedom * np.diag(inverse @ white[np.ix_(known, known)] @ inverse)
    with np.errstate(divide='ignore', invalid='ignore'):
        inflation = np.nanmedian(np.diag(matrix)[known] / independent)
    if not np.isfinite(inflation):
        inflation = 1.0
    return ParameterCovariance(matrix, float(count / max(inflation, 1.0)))


def correlation(covariance):
    """Correlation matrix of a covariance, shape (n, n); zero beside a zero variance."""
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide='ignore', invalid='ignore'):
        found = covariance / np.outer(std, std)
    return np.where(np.isfinite(found), found, np.eye(len(std)))


def inseparable_terms(terms, covariance):
    """Advice for each pair of terms that the records cannot tell apart.

    Parameters
    ----------
    terms : sequence of str
    covariance : ndarray, shape (n, n)

    Returns
    -------
    tuple of Advice
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
    """Natural frequency and equivalent damping over the amplitudes seen, with standard deviations.

    Attributes
    ----------
    curves : AmplitudeCurves
    frequency_std, damping_ratio_std : ndarray, shape (A,)
    """

    curves: AmplitudeCurves
    frequency_std: np.ndarray
    damping_ratio_std: np.ndarray


def amplitude_bands(model, covariance, amplitude):
    """Curves against amplitude with the standard deviations that the ratios' covariance implies.

    Parameters
    ----------
    model : DecayModel
    covariance : ndarray, shape (n, n)
        Of the ratios of the model's terms.
    amplitude : ndarray, shape (A,)
        rad.

    Returns
    -------
    AmplitudeBands
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
        slopes.append([
            (sides[0].frequency - sides[1].frequency) / (2 * step),
            (sides[0].damping_ratio - sides[1].damping_ratio) / (2 * step),
        ])  # fmt: skip
    frequency, damping = np.moveaxis(np.array(slopes), 1, 0)
    return AmplitudeBands(curves, _spread(frequency, covariance), _spread(damping, covariance))


def _spread(slopes, covariance):
    """Standard deviation of a quantity of slopes (n, A) by the delta method, shape (A,)."""
    return np.sqrt(np.maximum(np.einsum('ia,ij,ja->a', slopes, covariance, slopes), 0.0))
