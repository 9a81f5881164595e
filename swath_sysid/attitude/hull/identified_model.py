"""A decay model with what is known of it: the content of a model file."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.common.errors import InputError


@dataclass(frozen=True)
class HullPosterior:
    """Every term of the general hull as a record leaves it, those pruned from the model included."""

    equation: Equation
    ratios: np.ndarray  #: (n,); of the equation's terms, in their order.
    covariance: np.ndarray  #: (n, n)

    def __post_init__(self) -> None:
        n = len(self.equation.terms)
        for name, shape in (('ratios', (n,)), ('covariance', (n, n))):
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != shape:
                raise InputError(f'the posterior of {n} ratios needs {name} of the shape {shape}, not {values.shape}')
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def about(self, equation: Equation, ratios: np.ndarray) -> np.ndarray:
        """Covariance (n, n) of an equation's terms about ratios (9,) from which other terms were pruned."""
        places = [self.equation.terms.index(name) for name in equation.terms]
        away = ratios[equation.indices] - self.ratios[places]
        return self.covariance[np.ix_(places, places)] + np.outer(away, away)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HullPosterior):
            return NotImplemented
        return (
            self.equation.terms == other.equation.terms
            and np.array_equal(self.ratios, other.ratios)
            and np.array_equal(self.covariance, other.covariance)
        )


@dataclass(frozen=True)
class IdentifiedModel:
    """An identified model, its uncertainty, where it is valid and where it came from.

    Raises:
        InputError: The covariance has another shape than the model's terms ask for.

    Example:
        A published hull is taken as exact:

        >>> identified = IdentifiedModel.exactly(hull_named('swath-roll').model)
        >>> identified.model.axis, identified.std['b1']
        ('roll', 0.0)
    """

    model: DecayModel
    covariance: np.ndarray  #: (n, n); Of the ratios of ``model.equation.terms``, in their order.
    trim_std: float = float('nan')  #: rad; NaN where the trim is not known from the record.
    amplitude_range: tuple[float, float] = (0.0, float('inf'))  #: Smallest and largest amplitude seen, rad.
    metrics: dict = field(default_factory=dict)  #: How well it fits, by name with unit.
    provenance: dict = field(default_factory=dict)  #: Sources with hashes, segments, version, seed, settings.
    posterior: HullPosterior | None = None  #: What the filter of a forecast starts from; None: the model's own terms.

    def __post_init__(self) -> None:
        covariance = np.array(self.covariance, dtype=float)
        n = len(self.model.equation.terms)
        if covariance.shape != (n, n):
            raise InputError(
                f'the covariance of {n} ratios has {n} rows and {n} columns, not the shape {covariance.shape}'
            )
        covariance.flags.writeable = False
        object.__setattr__(self, 'covariance', covariance)

    @classmethod
    def exactly(cls, model: DecayModel) -> 'IdentifiedModel':
        """A model taken as exact: a published hull, or an assumption."""
        n = len(model.equation.terms)
        return cls(model, np.zeros((n, n)))

    @property
    def verdict(self) -> str:
        """Of the fit: ``adequate`` or ``doubtful``; empty where it is not known."""
        return str(self.metrics.get('verdict', ''))

    @property
    def verdict_sentence(self) -> str:
        """Cause and cure; empty where they are not known."""
        return str(self.metrics.get('verdict_sentence', ''))

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, IdentifiedModel):
            return NotImplemented
        return (
            self.model == other.model
            and np.array_equal(self.covariance, other.covariance, equal_nan=True)
            and np.array_equal(self.trim_std, other.trim_std, equal_nan=True)
            and (self.amplitude_range, self.metrics, self.provenance, self.posterior)
            == (other.amplitude_range, other.metrics, other.provenance, other.posterior)
        )
