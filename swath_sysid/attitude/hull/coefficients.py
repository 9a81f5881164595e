"""The numbers of identified models in one table."""

from collections.abc import Mapping

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.motion.trial import AXES

#: The ratios to inertia, the trim, rad, and in the rows of values the verdict and the amplitudes, rad, of the record.
COEFFICIENT_NAMES = (*TERM_NAMES, 'offset', 'verdict', 'smallest_amplitude', 'largest_amplitude')

#: The empty one is not known; any that is not here is as bad as rejected.
VERDICT_NUMBERS = {name: number for number, name in enumerate(('', 'rejected', 'doubtful', 'adequate'), -1)}


def coefficients(models: Mapping[str, IdentifiedModel]) -> tuple[tuple[str, ...], np.ndarray]:
    """Row names (``pitch``, ``pitch_std``) and values (2 axes, 13), columns as `COEFFICIENT_NAMES`; unused terms: 0."""
    axes = tuple(axis for axis in AXES if axis in models)
    names = tuple(f'{axis}{kind}' for axis in axes for kind in ('', '_std'))
    rows = [row for axis in axes for row in _rows(models[axis])]
    return names, np.array(rows, dtype=float).reshape(len(names), len(COEFFICIENT_NAMES))


def _rows(identified: IdentifiedModel) -> tuple[list[float], list[float]]:
    model, std = identified.model, identified.std
    verdict = VERDICT_NUMBERS.get(identified.verdict, VERDICT_NUMBERS['rejected'])
    return (
        [*model.ratios.tolist(), model.trim, verdict, *identified.amplitude_range],
        [*(std.get(name, 0.0) for name in TERM_NAMES), identified.trim_std, 0.0, 0.0, 0.0],
    )
