"""An identification at sea in words and in plain data."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from swath_sysid.formats.model_file import ratios_as_data
from swath_sysid.formats.plain_data import finite_or_none
from swath_sysid.report.fit_summary import ratio_lines, short_name, warnings_as_data

if TYPE_CHECKING:
    import numpy as np

    from swath_sysid.attitude.identification.at_sea import AtSeaIdentification

SEAS = {'heave': 'the sea as the vertical acceleration shows it', 'jonswap': 'a JONSWAP sea with a free tail'}


def at_sea_as_data(found: AtSeaIdentification, wall_s: float | None = None) -> dict:
    """What ``identify --json`` prints of a record in waves; ``misfit`` 1: hull and sea explain the motion."""
    model = found.model
    return finite_or_none(
        {
            'identified_from': 'motion in waves',
            'equation': model.equation.name,
            'axis': model.axis,
            'ratios': ratios_as_data(found),
            'trim_rad': model.trim,
            'trim_std_rad': found.trim_std,
            'natural_period_s': found.natural_period,
            'natural_period_std_s': found.natural_period_std,
            'damping_ratio': found.damping_ratio,
            'damping_ratio_std': found.damping_ratio_std,
            'correlation': _correlation(found.estimate_covariance),
            'reference_amplitude_rad': found.amplitude,
            'reference_amplitude_std_rad': found.amplitude_std,
            'valid_amplitude_rad': [found.amplitude, found.amplitude],
            'misfit': found.misfit,
            'sea': found.sea,
            'peak_period_s': found.peak_period,
            'segment_s': [float(found.motion.time[0]), float(found.motion.time[-1])],
            'sources': [found.motion.source],
            'wall_s': wall_s,
            **warnings_as_data(found.advice),
        }
    )


def _correlation(covariance: np.ndarray):
    return float(covariance[0, 1] / math.sqrt(covariance[0, 0] * covariance[1, 1]))


def at_sea_in_words(found: AtSeaIdentification) -> list[str]:
    """Lines for a reader."""
    model, motion = found.model, found.motion
    return [
        f'{model.axis}: identified at sea, the equivalent linear hull at {math.degrees(found.amplitude):.2f} deg '
        f'+- {math.degrees(found.amplitude_std):.2g}',
        f'  {short_name(motion.source)}: motion in waves from {motion.time[0]:.1f} to {motion.time[-1]:.1f} s',
        f'  natural period {found.natural_period:.3f} s +- {found.natural_period_std:.2g}, equivalent damping ratio '
        f'{found.damping_ratio:.3f} +- {found.damping_ratio_std:.2g}',
        *ratio_lines(found),
        f'  mean angle {math.degrees(model.trim):.2f} deg +- {math.degrees(found.trim_std):.2g}; '
        f'waves: {SEAS[found.sea]}; misfit {found.misfit:.2f} (1: all is explained)',
        f'  the exciting moment peaks at a period of {found.peak_period:.3g} s; it follows the slope of the waves, so '
        'their height peaks at a longer one',
    ]
