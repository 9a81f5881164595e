"""Whether a fit explains its records well enough to be used as a model."""
import numpy as np

from swath_sysid.common.advice import Advice

LEAST_R2 = 0.9
"""Below this share of the variance of the angle (or of the rate, where no angle was measured) a model is of no use."""

LEAST_R2_OF_COHERENT_RESIDUALS = 0.95
"""Residuals, of angle or rate, that swing as the motion does are no noise; those of measured decays are within 1 %."""

COHERENT = 0.5
"""Autocorrelation of the residuals a tenth of a period on: of white noise 0, of the motion 0.8, of an offset 1."""

LONGEST_PERIOD = 60.0
"""s; roll and pitch of craft that this package is for are several times as fast, so the time column is in doubt."""


def poor_fit(identification):
    """What is wrong with a fit that should not be used.

    Parameters
    ----------
    identification : Identification

    Returns
    -------
    tuple of Advice
        Codes ``poor-fit`` and ``implausible-period``; empty where the fit can be used.
    """
    found = []
    for quantity in ('angle', 'rate'):
        pairs = [
            (getattr(record.motion, quantity), getattr(record, quantity))
            for record in identification.records if getattr(record.motion, quantity) is not None
        ]
        if pairs:
            found += _poor(quantity, pairs, identification)
    if identification.model.natural_period > LONGEST_PERIOD:
        found.append(Advice('implausible-period', (
            f'the natural period came out as {identification.model.natural_period:.4g} s, more than '
            f'{LONGEST_PERIOD:g} s: check the unit of the time column, which may count milliseconds (time_ms) or '
            f'samples (time_samples)'
        )))
    return tuple(found)


def explained_share(pairs):
    """R2 of (measured, simulated) pairs, each record about its own mean.

    Parameters
    ----------
    pairs : sequence of tuple of two ndarrays, shape (N,)

    Returns
    -------
    float
    """
    error = sum(float(np.sum((measured - simulated) ** 2)) for measured, simulated in pairs)
    spread = sum(float(np.sum((measured - measured.mean()) ** 2)) for measured, _ in pairs)
    return 1.0 - error / spread if spread > 0.0 else 0.0


def _poor(quantity, pairs, identification):
    fitted = 'rate' if identification.records[0].motion.angle is None else 'angle'
    r2 = explained_share(pairs)
    if not r2 >= LEAST_R2 and quantity == fitted:
        return [Advice('poor-fit', (
            f'the fit explains {max(r2, 0.0):.1%} of the variance of the {quantity}, and {LEAST_R2:.0%} is the least '
            f'that a model is of use with: check units, signs and times of the columns, choose the decay with --start '
            f'and --end, or compare other equations'
        ))]
    if r2 < LEAST_R2_OF_COHERENT_RESIDUALS and _coherence(pairs, identification) > COHERENT:
        return [Advice('poor-fit', (
            f'the fit explains {max(r2, 0.0):.1%} of the variance of the {quantity}, and what is left is no noise: '
            f'check units, signs and times of the columns, choose the decay with --start and --end, or compare other '
            f'equations'
        ))]
    return []


def _coherence(pairs, identification):
    """Autocorrelation of the residuals a tenth of a period on, the median of the records."""
    found = []
    for record, (measured, simulated) in zip(identification.records, pairs, strict=False):
        lag = max(1, round(0.1 * record.segment.period / record.motion.sample_interval))
        residual = measured - simulated
        power = float(residual @ residual)
        if residual.size > 2 * lag and power > 0.0:
            found.append(float(residual[lag:] @ residual[:-lag]) / power)
    return float(np.median(found)) if found else 0.0
