"""Covariance of fitted parameters, and their correlation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.noise import autocovariance, correlated_information

NOT_SEPARABLE = 0.95  #: Correlation beyond which a record does not separate two terms.


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance (p, p) of fitted parameters under autocorrelated residuals."""

    matrix: np.ndarray
    effective_samples: float


def sandwich_covariance(
    residuals: Sequence[np.ndarray], jacobians: Sequence[np.ndarray], shortest_memory: int
) -> ParameterCovariance:
    """Least-squares covariance A^-1 (sum_k J_k^T Gamma_k J_k) A^-1, A = J^T J (Newey and West 1987).

    Gamma_k is the Toeplitz matrix of the autocovariance of residuals (N_k,), J_k their Jacobian (N_k, p). Parameters
    that the residuals do not depend on have NaN rows and columns. ``shortest_memory`` is that of `autocovariance`.
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


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlation matrix of a covariance, shape (n, n); zero beside a zero variance."""
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide='ignore', invalid='ignore'):
        found = covariance / np.outer(std, std)
    return np.where(np.isfinite(found), found, np.eye(len(std)))
