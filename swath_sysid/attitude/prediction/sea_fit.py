"""Learning the sea from the recent past: a request as data, a pure function, a result."""

import math
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.motion.trial import AXES, AxisMotion
from swath_sysid.attitude.motion.vertical import vertical_acceleration
from swath_sysid.attitude.prediction.excitation_model import ExcitationFit, fit_excitation
from swath_sysid.attitude.prediction.hull_filter import ExcitationRequest
from swath_sysid.attitude.prediction.hull_watch import HullChange, HullLook, hull_change
from swath_sysid.attitude.prediction.memories import NEW_SEA
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD
from swath_sysid.attitude.prediction.sea_state import SeaReport, sea_report
from swath_sysid.attitude.prediction.state_space import InnovationsModel
from swath_sysid.attitude.prediction.upstream import UpstreamFit, UpstreamRequest, fit_upstream
from swath_sysid.attitude.prediction.variate_analysis import identify, identify_alone
from swath_sysid.attitude.prediction.vertical_forecast import FORCE, VerticalFit, VerticalRequest, fit_vertical

#: State spaces of the whole past, of the whole past with a longer memory on fewer rows, and of a new sea.
WAVES, LONG_WAVES, NEW_WAVES = 'waves', 'waves-long', 'waves-new'
SPARSE = 2  #: Rows between those of a longer memory.

LONGEST_FILLED = 0.6  #: Periods; the phase is lost in a longer gap.


@dataclass(frozen=True)
class SeaRequest:
    """The past to learn from."""

    time: float  #: When it was asked for, s of the forecaster's own time.
    step: float  #: Between rows, s.
    period: float  #: Of the motion, s.
    names: tuple[str, ...]  #: Of the channels.
    values: np.ndarray  #: (N, C); Oldest first; NaN where a sample or a channel is missing.
    excitations: dict[str, ExcitationRequest] = field(default_factory=dict)  #: By axis with an identified hull.
    vertical: VerticalRequest | None = None  #: None: vertical motion is not asked for.
    wants_sea_state: bool = False
    upstream: UpstreamRequest | None = None  #: None: there are no upstream channels.
    look: HullLook | None = None  #: At the hull of one of the axes in `excitations`.


@dataclass(frozen=True)
class SeaFit:
    """The result of `fit_sea`."""

    time: float  #: Of the request.
    waves: dict[str, InnovationsModel]  #: `WAVES` and `NEW_WAVES`, if the past is long enough.
    excitations: dict[str, ExcitationFit]  #: By axis; likewise.
    vertical: VerticalFit | None = None  #: With the waves of all channels.
    sea: SeaReport | None = None  #: Where it was asked for.
    upstream: dict[str, UpstreamFit] = field(default_factory=dict)  #: By candidate, if the past is long enough.
    change: HullChange | None = None  #: What the look has found.


def fit_sea(request: SeaRequest) -> SeaFit:
    """Identify the waves from the whole past and from its end, and the exciting moment of each hull.

    The waves are a state space in innovations form by canonical variate analysis. Live callers fit in the
    background: a sample does not wait for it.

    Args:
        request: The past to learn from, of a `ForecastStep`.

    Returns:
        For `ForecastPipeline.install`; empty where the past does not suffice.

    Example:
        >>> pipeline, fits = ForecastPipeline(), 0
        >>> for sample in samples_of(read_trial(records / 'morro_buoy.csv').between(0.0, 20.0)):
        ...     step = pipeline.add_sample(sample)
        ...     if step.sea_request is not None:
        ...         pipeline.install(fit_sea(step.sea_request))
        ...         fits += 1
        >>> fits > 0
        True
    """
    past, names, step, period = request.values, request.names, request.step, request.period
    newest = past[-round(NEW_SEA * period / step) :]
    new = identify(newest, names, step, period) if len(newest) < len(past) else None
    waves: dict[str, InnovationsModel | None] = {
        WAVES: identify(past, names, step, period),
        # fewer coefficients where all channels are too many for so few rows
        NEW_WAVES: identify_alone(past, names, step, period, AXES) if new is None else new,
    }
    if period / step >= ROWS_A_PERIOD / SPARSE:
        waves[LONG_WAVES] = identify(past[(len(past) - 1) % SPARSE :: SPARSE], names, SPARSE * step, period)
    elif new is not None:
        waves[LONG_WAVES] = identify_alone(past, names, step, period, AXES)
    excitations = {axis: fit_excitation(asked) for axis, asked in request.excitations.items()}
    vertical, model = None, waves[WAVES]
    if request.vertical is not None and model is not None:
        vertical = _fit_vertical(request, request.vertical, model)
    return SeaFit(
        request.time,
        {name: model for name, model in waves.items() if model is not None},
        {axis: fit for axis, fit in excitations.items() if fit is not None},
        vertical,
        sea_of(request) if request.wants_sea_state else None,
        {} if request.upstream is None else fit_upstream(past[:, : len(ATTITUDE)], step, period, request.upstream),
        None if request.look is None else _change(request.look, request.excitations[request.look.axis]),
    )


def _change(look: HullLook, seen: ExcitationRequest):
    time = seen.step * np.arange(seen.angle.size)
    return hull_change(look, AxisMotion(look.axis, time, seen.angle, seen.rate), seen.period)


def sea_of(request: SeaRequest) -> SeaReport:
    """The `SeaReport` of the newest stretch of a `SeaRequest`."""
    place = {name: number for number, name in enumerate(request.names)}
    needed = request.values[:, [place[name] for name in (*AXES, *FORCE)]].T
    if not np.isfinite(needed).any(axis=1).all():
        return SeaReport(None, 'the sea shows in attitude and accelerations together, and the sensor lacks one of them')
    roll, pitch, *force = newest_stretch(needed, request.step, request.period)
    return sea_report(vertical_acceleration(roll, pitch, np.stack(force, axis=1)), roll, pitch, request.step)


def _fit_vertical(request: SeaRequest, wanted: VerticalRequest, model: InnovationsModel):
    """Fit of vertical motion to the newest complete stretch of the channels that it needs."""
    needed = sorted({*model.places, *(request.names.index(name) for name in (*ATTITUDE, *FORCE))})
    rows = np.full_like(request.values, math.nan)
    rows[:, needed] = request.values[:, needed]
    numbered = newest_stretch(np.vstack([rows[:, needed].T, np.arange(float(len(rows)))]), request.step, request.period)
    if not numbered.size:
        return None
    stretch = np.full((numbered.shape[1], rows.shape[1]), math.nan)
    stretch[:, needed] = numbered[:-1].T
    age = len(rows) - 1 - int(numbered[-1, -1])
    return fit_vertical(stretch, request.names, request.step, model, wanted, age)


def newest_stretch(channels: np.ndarray, step: float, period: float) -> np.ndarray:
    """The newest stretch of channels (C, N), oldest first, NaN where missing, without a long gap.

    Short gaps are interpolated linearly; a channel that is not measured stays NaN; empty where nothing is measured.
    """
    measured = np.isfinite(channels).any(axis=1)
    seen = np.flatnonzero(np.isfinite(channels[measured]).all(axis=0) & measured.any())
    if not seen.size:
        return channels[:, :0]
    breaks = np.flatnonzero(np.diff(seen) * step > LONGEST_FILLED * period)
    seen = seen[breaks[-1] + 1 :] if breaks.size else seen
    even = np.arange(seen[0], seen[-1] + 1)
    return np.array(
        [
            np.interp(even, seen, channel[seen]) if known else np.full(even.size, math.nan)
            for channel, known in zip(channels, measured, strict=True)
        ]
    )


def newest_motion(motion: np.ndarray, step: float, period: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The newest stretch of an angle and its rate (2, N), NaN where missing, and where (N,) it is measured.

    What is bridged follows both.
    """
    numbered = np.vstack([motion, np.arange(float(motion.shape[1]))])
    angle, rate, place = newest_stretch(numbered, step, period)
    known = np.isin(place, np.flatnonzero(np.isfinite(motion).all(axis=0)))
    if known.all() or not known.any():
        return angle, rate, known
    from scipy.interpolate import CubicHermiteSpline  # loads much, and a complete record needs none of it

    curve = CubicHermiteSpline(place[known], angle[known], step * rate[known])
    return np.where(known, angle, curve(place)), np.where(known, rate, curve.derivative()(place) / step), known


def warm_up() -> None:
    """A small fit of simulated waves, so that the next one finds everything loaded."""
    time = np.arange(0.0, 30.0, 0.1)
    values = np.stack([np.sin((1.0 + 0.3 * c) * time + np.sin((2.0 + c) * time)) for c in range(7)], axis=1)
    fit_sea(SeaRequest(float(time[-1]), 0.1, 3.0, tuple('abcdefg'), values))
