"""A decay model with what is known of it, one that follows the draft, and the numbers of both in one table."""

import bisect
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.motion.attitude import Installation, angle_between, in_degrees
from swath_sysid.attitude.motion.trial import AXES, AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError
from swath_sysid.common.judgement import Judged


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


MOUNTING = 'mounting_deg'  #: Key of a provenance: roll, pitch, yaw of the sensor that the model was identified with.
OTHER_MOUNTING = math.radians(5.0)  #: By which the mounting of a sensor differs from that of a model.


def mounting_of(motions: Iterable[AxisMotion]) -> dict[str, list[float]]:
    """The entry of a provenance; none where a table names the axes of the craft, or where sensors differ."""
    mountings = {None if each.installation is None else each.installation.angles for each in motions}
    only = mountings.pop() if len(mountings) == 1 else None
    return {} if only is None else {MOUNTING: in_degrees(only, 3)}


def other_mounting(identified: 'IdentifiedModel', installation: Installation | None) -> str:
    """The mounting, deg, that a model was identified with; empty unless it is another than that of a sensor."""
    # a model file may say anything there
    known = identified.provenance.get(MOUNTING) if isinstance(identified.provenance, dict) else None
    is_known = isinstance(known, list | tuple) and len(known) == 3 and all(isinstance(a, int | float) for a in known)
    if installation is None or known is None or not is_known:
        return ''
    turn = angle_between([math.radians(angle) for angle in known], installation.angles)
    return ','.join(f'{angle:g}' for angle in known) if turn > OTHER_MOUNTING else ''


def check_mounting(models: Mapping[str, 'IdentifiedModel'], installation: Installation | None) -> None:
    """Reject models that were identified with another mounting than that of the sensor they are used with."""
    for axis, identified in models.items():
        if installation is not None and (known := other_mounting(identified, installation)):
            now = ','.join(f'{angle:g}' for angle in in_degrees(installation.angles, 1))
            raise InputError(
                f'the {axis} model was identified with the sensor mounted at {known} deg, '
                f'and {"it is stated" if installation.mounting else "without a stated mounting it is used"} at {now}: '
                f'state the same mounting, identify again, or remove {MOUNTING} from the model file if it is another '
                'sensor',
                'other-mounting',
            )


@checked
@dataclass(frozen=True)
class IdentifiedModel(Judged):
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
    @checked
    def exactly(cls, model: DecayModel) -> 'IdentifiedModel':
        """A model taken as exact: a published hull, or an assumption."""
        n = len(model.equation.terms)
        return cls(model, np.zeros((n, n)))

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


QUANTITIES = ('draft_factor', 'draft_m', 'displacement_kg')


@dataclass(frozen=True)
class ScheduledModel:
    """Models identified at several loadings, with what lies between them."""

    quantity: str  #: What the loading is given as: ``draft_factor``, ``draft_m`` or ``displacement_kg``.
    loadings: tuple[float, ...]  #: Increasing.
    models: tuple[IdentifiedModel, ...]  #: One a loading; of one axis and with the same terms.

    def __post_init__(self) -> None:
        if self.quantity not in QUANTITIES:
            raise InputError(f"a model cannot be scheduled on '{self.quantity}': choose from {', '.join(QUANTITIES)}")
        loadings = tuple(float(v) for v in self.loadings)
        if not loadings or len(loadings) != len(self.models):
            raise InputError('a schedule needs one model for each loading, and at least one')
        if not all(v > 0 and np.isfinite(v) for v in loadings):
            raise InputError(f'{self.quantity} must be greater than zero')
        if any(b <= a or math.isclose(a, b) for a, b in zip(loadings, loadings[1:], strict=False)):
            raise InputError(f'{self.quantity} must increase from model to model: sort them, and give each once')
        first = self.models[0].model
        for other in (m.model for m in self.models[1:]):
            if other.equation.terms != first.equation.terms or other.axis != first.axis:
                raise InputError('the models of a schedule must be of one axis and have the same terms')
        object.__setattr__(self, 'loadings', loadings)
        object.__setattr__(self, 'models', tuple(self.models))

    @property
    def axis(self) -> str:
        """``roll`` or ``pitch``."""
        return self.models[0].model.axis

    @property
    def equation(self) -> Equation:
        """The equation that all loadings share."""
        return self.models[0].model.equation

    @property
    def reference(self) -> IdentifiedModel:
        """The model of the middle loading: for readers without a draft."""
        return self.models[len(self.models) // 2]

    def at(self, loading: float) -> tuple[IdentifiedModel, tuple[Advice, ...]]:
        """The model at a loading, in the unit of `quantity`, and what to know of it. Between two identified loadings
        ratios, trim and amplitude range are interpolated linearly and covariances combined by the squared weights. The
        curvature f[a, b, c] (t - a)(t - b) over the three nearest loadings is added as one standard deviation. Beyond
        the identified loadings the nearest model is used.
        """
        loading = float(loading)
        if not (np.isfinite(loading) and loading > 0.0):
            raise InputError(f'{self.quantity} must be a number greater than zero, not {loading}')
        first, last = self.loadings[0], self.loadings[-1]
        nearest = min(max(loading, first), last)
        if not math.isclose(loading, nearest):
            advice = Advice.of(
                'loading-outside', quantity=self.quantity, lowest=first, highest=last, loading=loading, nearest=nearest
            )
            return self._mixed(nearest), (advice,)
        mixed = self._mixed(nearest)
        if len(self.loadings) == 2 and not any(math.isclose(loading, v) for v in self.loadings):
            return mixed, (Advice.of('loading-curvature-unknown', quantity=self.quantity),)
        return mixed, ()

    def _mixed(self, loading: float) -> IdentifiedModel:
        right = min(bisect.bisect_left(self.loadings, loading), len(self.loadings) - 1)
        if math.isclose(self.loadings[right], loading):
            return self.models[right]
        left = right - 1
        before, after = self.models[left], self.models[right]
        weight = (loading - self.loadings[left]) / (self.loadings[right] - self.loadings[left])
        covariance = (1.0 - weight) ** 2 * before.covariance + weight**2 * after.covariance
        covariance = covariance + np.diag(self._missed(left, loading) ** 2)

        def between(a: Any, b: Any) -> Any:
            return (1.0 - weight) * a + weight * b

        old, new = before.model, after.model
        trim, friction_rate = (float(between(getattr(old, n), getattr(new, n))) for n in ('trim', 'friction_rate'))
        model = DecayModel(self.equation, between(old.ratios, new.ratios), trim, friction_rate, self.axis)
        (low, high), (low_after, high_after) = before.amplitude_range, after.amplitude_range
        amplitudes = float(between(low, low_after)), float(between(high, high_after))
        trim_std = float(np.hypot((1.0 - weight) * before.trim_std, weight * after.trim_std))
        between_loadings = list(self.loadings[left : right + 1])
        provenance = {'scheduled_on': self.quantity, 'loading': loading, 'between': between_loadings}
        return IdentifiedModel(model, covariance, trim_std, amplitudes, provenance=provenance)

    def _missed(self, left: int, loading: float) -> np.ndarray:
        """What linear interpolation may miss of each ratio, shape (n,)."""
        count = len(self.loadings)
        if count < 3:
            return np.zeros(len(self.equation.terms))
        away = abs((loading - self.loadings[left]) * (loading - self.loadings[left + 1]))
        ratios = np.array([m.model.ratios[self.equation.indices] for m in self.models])
        slopes = np.diff(ratios, axis=0) / np.diff(self.loadings)[:, None]
        curvatures = np.diff(slopes, axis=0) / (np.array(self.loadings[2:]) - self.loadings[:-2])[:, None]
        return away * np.max(np.abs(curvatures[max(left - 1, 0) : left + 1]), axis=0)

    def curve(self, loadings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ratios and standard deviations, (K, n), of the equation's terms at loadings (K,)."""
        found = [self._mixed(min(max(v, self.loadings[0]), self.loadings[-1])) for v in loadings]
        ratios = np.array([m.model.ratios[self.equation.indices] for m in found])
        return ratios, np.array([np.sqrt(np.diag(m.covariance)) for m in found])


def models_at(
    models: Mapping[str, IdentifiedModel], schedules: Mapping[str, ScheduledModel], loading: float | None
) -> tuple[dict[str, IdentifiedModel], tuple[Advice, ...]]:
    """The models by axis at a loading (None: unknown), scheduled where there is a schedule, and advice."""
    if loading is None:
        return dict(models), ()
    if not (np.isfinite(loading) and loading > 0.0):
        raise InputError(f'the draft or displacement must be a number greater than zero, not {loading}')
    found = {axis: schedule.at(loading) for axis, schedule in schedules.items()}
    advice = dict.fromkeys(a for _, remarks in found.values() for a in remarks)
    return {**models, **{axis: model for axis, (model, _) in found.items()}}, tuple(advice)


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
