"""How well runs excite each derivative: the share of its motion that no other one explains."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.manoeuvring.hull.terms import INDEX, PARAMETERS
from swath_sysid.manoeuvring.motion.trial import CraftRun

ENOUGH = 0.15  #: Derivatives with a smaller share of their own can hardly be separated.


def excitation(runs: Sequence[CraftRun]) -> dict[str, float]:
    """Excitation of derivatives by runs, 0 to 1; 0 where the motion does not occur. In each equation the motion of a
    derivative is regressed on that of the others; the residual over its size is the excitation (the root of one over
    the variance inflation factor).
    """
    found = {}
    for names, columns in _equations(runs):
        known = np.all(np.isfinite(columns), axis=0)
        matrix = columns[:, known] if known.sum() > 10 * len(columns) else np.zeros((len(columns), 1))
        size = np.linalg.norm(matrix, axis=1)
        for k, name in enumerate(names):
            if name is None:
                continue
            others = np.delete(matrix, k, axis=0)[np.delete(size, k) > 0.0]
            left = matrix[k] - (np.linalg.lstsq(others.T, matrix[k], rcond=None)[0] @ others if len(others) else 0.0)
            found[name] = float(np.linalg.norm(left) / size[k]) if size[k] > 0.0 else 0.0
    inputs = np.concatenate([np.concatenate([run.port, run.starboard]) for run in runs])
    most = float(np.max(np.abs(inputs), initial=0.0)) or 1.0
    found['reverse_ratio'] = float(np.clip(np.mean(inputs < -0.05 * most) / 0.1, 0.0, 1.0))
    if all(run.heading is not None for run in runs):
        courses = np.concatenate([run.heading for run in runs])
        found['deviation_B'] = float(1.0 - abs(np.mean(np.exp(1j * courses))))
    return found


def lacking(shares: dict[str, float]) -> dict[str, str]:
    """Derivatives that lack excitation, with the manoeuvre that would help."""
    return {name: PARAMETERS[INDEX[name]].separated_by for name, share in shares.items() if share < ENOUGH}


def _equations(runs: Sequence[CraftRun]):
    """Names and motions, shape (K, N), of surge, sway and yaw; the thrust is a motion without a name."""
    u, v, r = (_known(np.concatenate([run.smooth[c] for run in runs])) for c in range(3))
    changes = [_known(np.concatenate([np.gradient(run.smooth[c], run.step) for run in runs])) for c in range(3)]
    port, starboard = (np.concatenate([getattr(run, side) for run in runs]) for side in ('port', 'starboard'))
    return (
        (('Xu_dot', 'Xu', 'Xuu', 'Xvr', None), np.stack([changes[0], u, np.abs(u) * u, v * r, starboard + port])),
        (('Yv_dot', 'Yv', 'Yvv', 'Yur'), np.stack([changes[1], v, np.abs(v) * v, u * r])),
        (
            ('Iz', 'Nr', 'Nrr', 'Nuur', 'Nuv', None),
            np.stack([changes[2], r, np.abs(r) * r, u * u * r, u * v, starboard - port]),
        ),
    )


def _known(values: np.ndarray) -> np.ndarray:
    """Zeros for a motion that no run has, so that the others are judged without it."""
    return values if np.isfinite(values).any() else np.zeros_like(values)
