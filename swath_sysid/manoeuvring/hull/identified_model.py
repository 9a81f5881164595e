"""A manoeuvring model with what is known of it: uncertainty, validity, provenance."""
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.stability import Region


@dataclass(frozen=True)
class IdentifiedManoeuvringModel:
    """What a model file of manoeuvring holds.

    Attributes
    ----------
    model : ManoeuvringModel
    names : tuple of str
        Identified numbers, current included, in the order of the covariance.
    covariance : ndarray, shape (n, n)
    noise : ndarray, shape (3,)
        Standard deviation of what the model left of surge, sway, m/s, and yaw rate, rad/s.
    region : Region
        Motion and inputs that it was identified at.
    metrics, provenance : dict
    """

    model: ManoeuvringModel
    names: tuple[str, ...]
    covariance: np.ndarray
    noise: np.ndarray
    region: Region
    metrics: dict = field(default_factory=dict)
    provenance: dict = field(default_factory=dict)
