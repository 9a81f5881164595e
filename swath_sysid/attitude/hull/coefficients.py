"""The numbers of identified models in one table."""

from collections.abc import Mapping

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.motion.trial import AXES

COEFFICIENT_NAMES = (*TERM_NAMES, 'offset')  #: The ratios to inertia, and the trim, rad.


def coefficients(models: Mapping[str, IdentifiedModel]) -> tuple[tuple[str, ...], np.ndarray]:
    """The ratios and the trim of models, a row an axis.

    Args:
        models: By axis.

    Returns:
        axes: Of the rows.
        values: (axes, 10); columns as `COEFFICIENT_NAMES`.
    """
    axes = tuple(axis for axis in AXES if axis in models)
    rows = [[*models[axis].model.ratios.tolist(), models[axis].model.trim] for axis in axes]
    return axes, np.array(rows, dtype=float).reshape(len(axes), len(COEFFICIENT_NAMES))
