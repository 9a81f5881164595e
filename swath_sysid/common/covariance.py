"""Covariance of fitted parameters, and their correlation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.signals import autocovariance, correlated

NOT_SEPARABLE = 0.95  #: Correlation beyond which a record does not separate two terms.


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance (p, p) of fitted parameters under autocorrelated residuals."""

    matrix: np.ndarray
    effective_samples: float


def sandwich_covariance(
    residuals: Sequence[np.ndarray],
    jacobians: Sequence[np.ndarray],
    shortest_memory: int,
    lasting: Sequence[np.ndarray] = (),
) -> ParameterCovariance:
    """Least-squares covariance A^-1 (sum_k J_k^T Gamma_k J_k) A^-1, A = J^T J (Newey and West 1987). Gamma_k is the
    Toeplitz matrix of the autocovariance of residuals (N_k,), J_k their Jacobian (N_k, p). Parameters that the
    residuals do not depend on have NaN rows and columns. ``shortest_memory`` is that of `autocovariance`, to which the
    ``lasting`` noise of `lasting_noise` is added where its autocorrelations (N_k,) are given.
    """
    information = sum(j.T @ j for j in jacobians)
    known = np.diag(information) > 0.0
    count = sum(r.size for r in residuals)
    freedom = count / max(1, count - known.sum())
    scale = np.sqrt(np.diag(information)[known])
    inverse = np.linalg.pinv(information[np.ix_(known, known)] / np.outer(scale, scale), rcond=1e-14, hermitian=True)
    inverse /= np.outer(scale, scale)
    columns = [j[:, known] for j in jacobians]
    covariances = [autocovariance(residual, shortest_memory) for residual in residuals]
    white = sum(c[0] * j.T @ j for c, j in zip(covariances, columns, strict=True))
    if lasting:
        covariances = lasting_noise(residuals, columns, inverse, covariances, lasting)
    spread = sum(j.T @ correlated(j, c) for j, c in zip(columns, covariances, strict=True))
    matrix = np.full_like(information, np.nan)
    matrix[np.ix_(known, known)] = freedom * inverse @ spread @ inverse
    independent = freedom * np.diag(inverse @ white @ inverse)
    with np.errstate(divide='ignore', invalid='ignore'):
        shares = np.diag(matrix)[known] / independent
    shares = shares[~np.isnan(shares)]
    inflation = np.median(shares) if shares.size else 1.0
    if not np.isfinite(inflation):
        inflation = 1.0
    return ParameterCovariance(matrix, float(count / max(inflation, 1.0)))


def lasting_noise(
    residuals: Sequence[np.ndarray],
    jacobians: Sequence[np.ndarray],
    inverse: np.ndarray,
    brief: Sequence[np.ndarray],
    lasting: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """Autocovariances (N_k,) of brief noise and of noise that lasts so long that the fit has absorbed most of it.
    ``inverse`` is (J^T J)^-1, ``brief`` are autocovariances (L_k,) of the residuals, ``lasting`` autocorrelations
    (N_k,). The variance of lasting noise follows from quadratic forms of the residuals, and what the fit is expected to
    leave of them in noise of both kinds (Rao 1971).
    """
    from scipy.optimize import nnls

    kinds = brief, lasting
    moved = [[correlated(j, c) for j, c in zip(jacobians, kind, strict=True)] for kind in kinds]
    absorbed = [inverse @ sum(j.T @ m for j, m in zip(jacobians, each, strict=True)) for each in moved]
    forms, left = np.zeros(2), np.zeros((2, 2))
    for a, kind in enumerate(kinds):
        forms[a] = sum(r @ correlated(r[:, None], c)[:, 0] for r, c in zip(residuals, kind, strict=True))
        for b, other in enumerate(kinds):
            left[a, b] = np.trace(absorbed[a] @ absorbed[b])
            for r, c, d, m, n in zip(residuals, kind, other, moved[a], moved[b], strict=True):
                products = c[: d.size] * d[: c.size]
                left[a, b] += 2.0 * (r.size - np.arange(products.size)) @ products - r.size * products[0]
                left[a, b] -= 2.0 * np.trace(inverse @ m.T @ n)
    (_, variance), _ = nnls(left, forms)
    return [variance * d + np.pad(c, (0, d.size - c.size)) for c, d in zip(brief, lasting, strict=True)]


def correlation(covariance: np.ndarray) -> np.ndarray:
    """Correlation matrix of a covariance, shape (n, n); zero beside a zero variance."""
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide='ignore', invalid='ignore'):
        found = covariance / np.outer(std, std)
    return np.where(np.isfinite(found), found, np.eye(len(std)))
