"""What to identify, and what is known of the model that was identified."""

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Self, get_type_hints

import numpy as np

from swath_sysid.attitude.hull.catalogue import AUTO, GENERAL_HULL, equation_named
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, mounting_of
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, LINEAR_RESTORING
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, interval
from swath_sysid.attitude.identification.decay_fit import DecayFit
from swath_sysid.attitude.identification.fit_quality import AmplitudeBands, Verdict, amplitude_bands, judge
from swath_sysid.attitude.identification.problem import Problem
from swath_sysid.attitude.identification.search import SearchResult, SearchSettings
from swath_sysid.common.advice import Advice
from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.common.plain import as_plain, from_plain

OBJECTIVES = ('simulation', 'one-step')
CURVE_POINTS = 40


@checked
@dataclass(frozen=True)
class IdentificationSettings:
    """What to fit and how.

    Raises:
        InputError: There is no such equation or objective, or the bounds are in the wrong order.

    Example:
        >>> settings = IdentificationSettings(equation='odd-cubic', start=5.0, end=60.0)
        >>> settings.chosen_equation.terms
        ('b1', 'b2', 'r1', 'r3')
    """

    #: A name that `equation_named` takes; ``auto``: the general hull, pruned to the terms that the records show.
    equation: str = AUTO
    objective: str = 'simulation'  #: ``simulation`` or ``one-step``.
    search: SearchSettings = field(default_factory=SearchSettings)
    start: float | None = None  #: Of the decay in the record's time, s; None: it is found.
    end: float | None = None  #: Of the decay in the record's time, s; None: it is found.

    def __post_init__(self):
        check_choice(self.objective, OBJECTIVES, 'objective')
        if not self.equation:
            raise InputError(f"an equation without a name cannot be fitted: leave it out, or give '{AUTO}' or a name")
        if self.equation != AUTO:
            equation_named(self.equation)
        if self.start is not None and self.end is not None and not self.start < self.end:
            raise InputError('the start must lie before the end')

    @property
    def chosen_equation(self) -> Equation:
        """The equation to search with: every smooth term where none is named."""
        return GENERAL_HULL if self.equation == AUTO else equation_named(self.equation)


@dataclass(frozen=True, kw_only=True)
class Identification(DecayFit):
    """An identified model and what must be known to use it.

    Example:
        >>> found = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')])
        >>> f'{found.damping_ratio:.4f} of critical, R2 {found.r2:.3f}'
        '0.0051 of critical, R2 1.000'
        >>> fit = found.records[0]  # measured and simulated motion of the first record
        >>> fit.angle.shape == fit.motion.time.shape
        True
    """

    #: Root mean square of the weighted residuals (simulation), or F in rad/s (one-step), at its own optimum.
    objective_value: float
    effective_samples: float  #: Independent samples that would leave the same uncertainty.
    search: SearchResult
    settings: IdentificationSettings
    basin: BasinFit | None = None  #: Fit of the likelihood; None where the ratios are those of least squares.

    @classmethod
    def restored(cls, plain: dict, problem: Problem, settings: IdentificationSettings) -> Self:
        """From what `plain` gave, with the problem that was solved."""
        hints = get_type_hints(cls)
        kept = {name: from_plain(hints[name], plain[name]) for name in KEPT}
        return cls(problem=problem, settings=settings, **kept)

    def plain(self) -> dict:
        """All that the problem and the settings do not give again: lists, numbers and texts."""
        return {name: as_plain(getattr(self, name)) for name in KEPT}

    @property
    def objective(self) -> str:
        """``simulation`` or ``one-step``."""
        return self.settings.objective

    @property
    def advice(self) -> tuple[Advice, ...]:
        """The warnings that leave the verdict as it is."""
        return self._judged[1]

    @cached_property
    def bands(self) -> AmplitudeBands:
        """Over the amplitudes seen."""
        amplitude = np.geomspace(*self.amplitude_range, CURVE_POINTS)
        return amplitude_bands(self.model, self.covariance, amplitude, self.posterior)

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % of each ratio in use; of a damping ratio that the record does not tell from zero, from zero up."""
        terms, std = self.model.terms, self.std
        return {name: interval(terms[name], std[name], name in DAMPING_NAMES) for name in terms}

    @property
    def samples(self) -> int:
        """Measured values, angles and rates."""
        return sum(m.size for each in self.problem.motions for m in (each.angle, each.rate) if m is not None)

    def ratio(self, term: str) -> tuple[float, float]:
        """Value and standard deviation of one ratio in use."""
        return self.model.terms[term], self.std[term]

    @property
    def verdict(self) -> Verdict:
        """Whether the fit can be used."""
        return self._judged[0]

    @cached_property
    def _judged(self):
        return judge(self, self.objective)

    @property
    def natural_period_std(self) -> float:
        """Standard deviation of the natural period of small motions, s."""
        linear = np.array([float(name in LINEAR_RESTORING) for name in self.model.equation.terms])
        share = float(np.sqrt(linear @ self.covariance @ linear)) / self.model.natural_frequency**2
        return 0.5 * self.model.natural_period * share

    @property
    def reference_amplitude(self) -> float:
        """Geometric mean of the amplitudes seen, rad."""
        return float(np.sqrt(np.prod(self.amplitude_range)))

    @property
    def damping_ratio(self) -> float:
        """Equivalent damping over critical damping at the reference amplitude."""
        curves = self.bands.curves
        return float(np.interp(self.reference_amplitude, curves.amplitude, curves.damping_ratio))

    def identified_model(self, provenance: dict) -> IdentifiedModel:
        """The content of a model file; ``provenance`` is the caller's record of files, hashes and software version."""
        search = self.settings.search
        how = {
            'segments_s': [[float(r.segment.start), float(r.segment.end)] for r in self.records],
            'search': search.algorithm,
            'preset': search.preset,
            'seed': search.seed,
            'generations': self.search.generations,
            'evaluations': self.search.evaluations,
            'stop': self.search.stop,
            'start': self.search.start,
            'advice': [a.code for a in self.advice],
            **mounting_of(self.problem.motions),
        }
        metrics = {
            'r2': self.r2,
            'rmse_rad': self.rmse,
            'rate_rmse_rad_s': self.rate_rmse,
            'objective': self.objective,
            'objective_value': self.objective_value,
            'samples': self.samples,
            'effective_samples': self.effective_samples,
            **self.verdict.metrics,
        }
        return IdentifiedModel(
            self.model,
            self.covariance,
            self.trim_std,
            self.amplitude_range,
            metrics,
            {**provenance, **how},
            self.posterior,
        )


#: What an `Identification` holds beside its problem and settings.
KEPT = tuple(each.name for each in fields(Identification) if each.name not in ('problem', 'settings', 'basin'))
