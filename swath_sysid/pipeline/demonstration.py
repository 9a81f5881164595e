"""The result of a demonstration: forecasts of a released craft against the measured motion."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite

import numpy as np

from swath_sysid.attitude.hull.craft_simulator import CraftSettings
from swath_sysid.attitude.identification.fit_quality import ADEQUATE_ERROR
from swath_sysid.attitude.motion.attitude import euler_angles
from swath_sysid.attitude.motion.intake import NANOSECOND, ImuReading
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed

UNAWARE = 0.3  #: s after the release; no forecast issued earlier can know of it.
SCORED_SPAN = 10.0  #: s of motion after the release that are scored.
LIFTING = CraftSettings.lift + CraftSettings.hold  #: s before a release in which the craft is not free.

LARGEST_SHARE = 0.25  #: Largest part of the NRMSE of the one-period-ahead forecast without a model.


@dataclass(frozen=True)
class LeadForecasts:
    """The forecasts at one lead."""

    lead: float  #: s.
    time: np.ndarray  #: (N,); The times they are for, s.
    angle: np.ndarray  #: (N,); rad.
    std: np.ndarray  #: (N,); rad.


@dataclass(frozen=True)
class Demonstration:
    """A craft released twice, the second time with an identified model. Times in s, from one start."""

    axis: str
    hull: str
    release_angle: float  #: rad, from trim.
    period: float  #: The hull's natural period, s.
    time: np.ndarray  #: (N,); of the samples.
    angle: np.ndarray  #: (N,); measured, rad.
    releases: tuple[float, float]  #: When the craft was let go.
    model_time: float  #: When the first model arrived.
    forecasts: tuple[LeadForecasts, ...]  #: As they were published.
    unaided: tuple[LeadForecasts, ...]  #: What would have been published without a model.

    @property
    def period_lead(self) -> float:
        """The lead that is one natural period, s."""
        return min((f.lead for f in self.forecasts), key=lambda lead: abs(lead - self.period))

    def end(self, release: int) -> float:
        """Until when motion after the release of that number counts, s."""
        lifted_again = (following - LIFTING for following in self.releases[release + 1 :])
        return min(self.releases[release] + SCORED_SPAN, float(self.time[-1]), *lifted_again)

    def during(self, forecasts: LeadForecasts, release: int) -> LeadForecasts:
        """The forecasts issued (aware of the release) and due between that release and its end."""
        issued = forecasts.time - forecasts.lead
        chosen = (issued >= self.releases[release] + UNAWARE) & (forecasts.time <= self.end(release))
        return LeadForecasts(forecasts.lead, forecasts.time[chosen], forecasts.angle[chosen], forecasts.std[chosen])

    def error(self, forecasts: LeadForecasts, release: int) -> float:
        """NRMSE: error over the standard deviation of the motion since release; NaN if no forecast was due."""
        scored = self.during(forecasts, release)
        if not scored.time.size:
            return float('nan')
        moving = (self.time >= self.releases[release]) & (self.time <= self.end(release))
        missed = scored.angle - np.interp(scored.time, self.time, self.angle)
        return float(np.sqrt(np.mean(missed**2)) / np.std(self.angle[moving]))


@dataclass(frozen=True)
class Outcome:
    """Whether the forecasts became what they should."""

    lead: float  #: One natural period, s.
    before: float  #: NRMSE in the first release, without a model.
    after: float  #: NRMSE in the second.
    unaided: float  #: NRMSE of what would have been published in the second release without a model.

    @property
    def is_good(self) -> bool:
        """Whether both figures are met."""
        return self.after <= ADEQUATE_ERROR and self.after <= LARGEST_SHARE * self.unaided

    @property
    def text(self) -> str:
        """One line."""
        if not isfinite(self.after):
            return 'NOT PASSED: no forecast came due after the second release; the machine may be too busy, see the log'
        comparison = (
            f'{self.lead:g} s (one natural period) ahead, the forecast errs by {self.after:.1%} of the motion with the '
            f'identified model, by {self.unaided:.0%} without it, and by {self.before:.0%} in the first release'
        )
        limits = f'NOT PASSED (at most {ADEQUATE_ERROR:.0%}, and a quarter of that without a model)'
        return f'{"passed" if self.is_good else limits}: {comparison}'


def verdict_of(demonstration: Demonstration) -> Outcome:
    """Judge a demonstration by its forecasts one natural period ahead."""
    lead = demonstration.period_lead
    published, unaided = (
        next(f for f in given if f.lead == lead) for given in (demonstration.forecasts, demonstration.unaided)
    )
    error = demonstration.error
    return Outcome(lead, error(published, 0), error(published, 1), error(unaided, 1))


def attitude_at(forecast: ImuReading, axis: str) -> tuple[float, float]:
    """Angle about an axis and its standard deviation, rad, of a forecast as `ImuReading`."""
    place = AXES.index(axis)
    angle = float(euler_angles(*forecast.orientation)[place])
    return angle, float(np.sqrt(forecast.orientation_covariance[4 * place]))


def without_model(readings: Iterable[ImuReading], axis: str, settings: PipelineSettings) -> dict[float, list[tuple]]:
    """Forecasts of the same messages without a model: by lead, s, rows of stamp, ns, angle and standard deviation."""
    pipeline = ForecastPipeline(settings)
    found: dict[float, list[tuple]] = {lead: [] for lead in settings.forecaster.leads}
    for step in followed(pipeline, readings):
        if step.forecast is not None:
            angles, deviations = step.forecast.angle(axis), step.forecast.deviation[:, AXES.index(axis)]
            for lead, angle, deviation in zip(found, angles.tolist(), deviations.tolist(), strict=True):
                found[lead].append((step.forecast.stamp_ns + round(lead / NANOSECOND), angle, deviation))
    return found
