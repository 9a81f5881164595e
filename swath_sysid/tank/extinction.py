"""Extinction of a free decay and its damping in dimensions, as towing tanks report them (ITTC 7.5-02-07-04.5).

Amplitude a: half a double amplitude. decrement = p1 a + p2 a^2 + p3 a^3 per half-cycle, Bertin's N = decrement / a^2.
From the energy that a term b |w|^(k-1) w takes at frequency w: pk = b w^(k-2) times the integral of sin^(k+1) over half
a cycle, which is pi / 2, 4/3 and 3/8 pi; for p1 the exact 2 tanh(b1 T / 8) is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import beta

from swath_sysid.attitude.hull.decay_model import STANDARD_GRAVITY, DecayModel, inertia_from_metacentric_height
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERMS
from swath_sysid.attitude.identification.fit_quality import AmplitudeBands
from swath_sysid.attitude.identification.peaks import Peaks
from swath_sysid.common.conventions import TWO_STD
from swath_sysid.common.covariance import sandwich_covariance
from swath_sysid.common.errors import InputError

#: Of the rate, of the damping terms that an extinction curve shows; friction stays at every amplitude.
POWERS = tuple(TERMS[name].power for name in DAMPING_NAMES if TERMS[name].power > 0)
RESIDUAL_MEMORY = 4  #: Half cycles over which disturbances of a basin are correlated, at least.


@dataclass(frozen=True)
class Extinction:
    """The extinction curve of one or several decays of the same condition."""

    peaks: tuple[Peaks, ...]
    #: (3,); p1, p2 (1/rad), p3 (1/rad^2); zero where there are too few half cycles.
    coefficients: np.ndarray
    covariance: np.ndarray  #: (3, 3); From the scatter of the decrements about the curve (type A).
    bertin: float  #: N of the curve of the quadratic term alone, 1/rad.
    bertin_std: float  #: 1/rad.
    period: float  #: Mean of the cycles, weighted by their amplitudes, s.

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of the coefficients, shape (3,)."""
        return np.sqrt(np.diag(self.covariance))

    def curve(self, amplitude: np.ndarray) -> np.ndarray:
        """Decrement of half a cycle at mean amplitudes (A,), rad."""
        return np.power.outer(amplitude, POWERS) @ self.coefficients

    @property
    def damping(self) -> np.ndarray:
        """b1, 1/s, b2, 1/rad, and b3, s/rad^2, that the curve means."""
        linear = 8.0 / self.period * np.arctanh(self.coefficients[0] / 2.0)
        return np.array([linear, *self.coefficients[1:] / self._gains[1:]])

    @property
    def _gains(self) -> np.ndarray:
        """Coefficients that damping terms of ratio one give, for small amplitudes."""
        frequency = 2.0 * np.pi / self.period
        return np.array([beta(0.5, 0.5 * power + 1.0) * frequency ** (power - 2) for power in POWERS])

    @property
    def damping_std(self) -> np.ndarray:
        """Standard deviations of `damping`, to first order."""
        slopes = 1.0 / self._gains
        slopes[0] = 4.0 / self.period / (1.0 - self.coefficients[0] ** 2 / 4.0)
        return slopes * self.std


def extinction_of(peaks: Sequence[Peaks]) -> Extinction:
    """The extinction curve through the decrements of decays of one condition, by generalised least squares. Decays with
    fewer than three turning points are ignored; `InputError` where none is left.
    """
    peaks = tuple(p for p in peaks if p.time.size >= 3 and (p.amplitude > 0.0).all())
    if not peaks:
        raise InputError(
            'an extinction curve needs three turning points: the damping is too strong, or the record too short'
        )
    amplitude, period = (np.concatenate([getattr(p, name) for p in peaks]) for name in ('mean_amplitude', 'period'))
    terms, size = min(max(amplitude.size // 2, 1), len(POWERS)), len(POWERS)
    coefficients, covariance = np.zeros(size), np.zeros((size, size))
    coefficients[:terms], covariance[:terms, :terms] = _fitted(peaks, POWERS[:terms])
    (bertin,), ((bertin_variance,),) = _fitted(peaks, [2])
    return Extinction(
        peaks,
        coefficients,
        covariance,
        float(bertin),
        float(np.sqrt(bertin_variance)),
        float(np.average(period, weights=amplitude)),
    )


def _fitted(peaks: Sequence[Peaks], powers: Sequence[int]):
    """Coefficients of powers of the amplitude and their covariance, NaN without a degree of freedom to spare."""
    columns, right = [], []
    for p in peaks:
        # neighbouring decrements share a turning point: whitened, their errors are independent
        whiten = np.linalg.inv(np.linalg.cholesky(p.decrement_covariance))
        columns.append(whiten @ np.column_stack([p.mean_amplitude**power for power in powers]))
        right.append(whiten @ p.decrement)
    size = np.linalg.norm(np.concatenate(columns), axis=0)
    found, *_ = np.linalg.lstsq(np.concatenate(columns) / size, np.concatenate(right), rcond=None)
    if sum(r.size for r in right) <= size.size:
        return found / size, np.full((size.size, size.size), np.nan)
    residuals = [r - c / size @ found for c, r in zip(columns, right, strict=True)]
    covariance = sandwich_covariance(residuals, [c / size for c in columns], RESIDUAL_MEMORY)
    return found / size, covariance.matrix / np.outer(size, size)


@dataclass(frozen=True)
class Particulars:
    """Particulars that turn ratios into moments; None where not known."""

    mass: float | None = None  #: Displacement, kg.
    metacentric_height: float | None = None  #: GM, transverse for roll, longitudinal for pitch, m.
    inertia: float | None = None  #: With added inertia, kg m^2; overrides mass and metacentric height.
    length: float | None = None  #: m.
    breadth: float | None = None  #: m.

    def inertia_of(self, model: DecayModel) -> float | None:
        """I' as given, else from hydrostatics and a decay model's stiffness, else None."""
        if self.inertia is not None or self.mass is None or self.metacentric_height is None:
            return self.inertia
        return inertia_from_metacentric_height(model, self.mass, self.metacentric_height)

    def damping_unit(self, axis: str) -> float | None:
        """Divisor of a damping coefficient, N m s, that makes it dimensionless, or None. Roll: rho V B^2 sqrt(2 g / B)
        (ITTC 7.5-02-07-04.5); pitch: rho V L^2 sqrt(g / L).
        """
        size, gravity = (self.breadth, 2.0 * STANDARD_GRAVITY) if axis == 'roll' else (self.length, STANDARD_GRAVITY)
        if self.mass is None or size is None:
            return None
        return self.mass * size**2 * np.sqrt(gravity / size)


def froude_number(speed: float, length: float) -> float:
    """U / sqrt(g L); speed in m/s, length in m."""
    return speed / np.sqrt(STANDARD_GRAVITY * length)


@dataclass(frozen=True)
class TypeB:
    """Relative standard uncertainties of sources that a decay itself cannot show."""

    sensor_scale: float = 0.0
    time_base: float = 0.0
    mass: float = 0.0
    metacentric_height: float = 0.0
    inertia: float = 0.0

    def __post_init__(self):
        for name, value in vars(self).items():
            if not 0.0 <= value < 1.0:
                raise InputError(f'the uncertainty of {name} is a share from 0 to 1 of its value, not {value:g}')


@dataclass(frozen=True)
class TankQuantity:
    """A result with its uncertainty budget, all in its unit."""

    name: str
    unit: str
    value: float
    fit: float  #: Type A: standard uncertainty of the fit.
    repeats: float  #: Type A: standard uncertainty of the mean of repeats; NaN without any.
    type_b: dict  #: Standard uncertainty from each source of `TypeB`.

    @property
    def combined(self) -> float:
        """Standard uncertainty: the scatter of repeats holds that of each fit, so that the larger counts."""
        type_a = np.nanmax([self.fit, self.repeats])
        return float(np.sqrt(type_a**2 + sum(u**2 for u in self.type_b.values())))

    @property
    def expanded(self) -> float:
        """U with coverage factor 2."""
        return TWO_STD * self.combined


_BOTH = ('frequency', 'damping_ratio')


def tank_quantities(
    axis: str,
    bands: AmplitudeBands,
    amplitude: float,
    inertia: float | None,
    particulars: Particulars,
    type_b: TypeB,
    repeats: Sequence[AmplitudeBands] = (),
) -> tuple[TankQuantity, ...]:
    """Natural period, damping ratio and equivalent damping at one amplitude, rad, each with its uncertainty budget. The
    scatter is that of the single ``repeats``. Damping in N m s needs the inertia, kg m^2; without dimension it needs
    mass and size too.
    """
    unit = particulars.damping_unit(axis)
    # powers of the sources in the damping
    sources = {'time_base': 1, 'mass': 1, 'metacentric_height': 1}
    if particulars.inertia is not None:
        sources = {'time_base': -1, 'inertia': 1}
    symbol = {'roll': 'B44', 'pitch': 'B55'}[axis]
    rows = [
        ('natural period', 's', lambda w, z: 2.0 * np.pi / w, _BOTH[:1], {'time_base': 1}),
        ('equivalent damping ratio', '-', lambda w, z: z, _BOTH[1:], {}),
        ('equivalent damping over inertia', '1/s', lambda w, z: 2.0 * z * w, _BOTH, {'time_base': -1}),
    ]
    if inertia is not None:
        rows.append((symbol, 'N m s', lambda w, z: 2.0 * z * w * inertia, _BOTH, sources))
    if inertia is not None and unit is not None:
        by_mass = {**sources, 'mass': sources.get('mass', 0) - 1}
        rows.append((f'{symbol} without dimension', '-', lambda w, z: 2.0 * z * w * inertia / unit, _BOTH, by_mass))
    return tuple(_with_budget(row, bands, amplitude, type_b, repeats) for row in rows)


def _with_budget(row: tuple, bands: AmplitudeBands, amplitude: float, type_b: TypeB, repeats: Sequence[AmplitudeBands]):
    name, unit, formula, depends_on, exponents = row
    own, *others = (dict(zip(_BOTH, b.quantities_at(amplitude), strict=True)) for b in (bands, *repeats))
    value, *singles = (formula(*(quantities[q][0] for q in _BOTH)) for quantities in (own, *others))
    relative = [own[q][1] / abs(own[q][0]) for q in depends_on]
    shares = {source: power * getattr(type_b, source) for source, power in exponents.items()}
    shares['sensor_scale'] = type_b.sensor_scale * sum(own[q][2] for q in depends_on)
    return TankQuantity(
        name,
        unit,
        value,
        fit=abs(value) * float(np.linalg.norm(relative)),
        repeats=float(np.std(singles, ddof=1) / np.sqrt(len(singles))) if len(singles) > 1 else float('nan'),
        type_b={source: abs(value * share) for source, share in shares.items() if share},
    )
