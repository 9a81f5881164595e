"""Recently received motion, forecasts, models and statuses, in memory of constant size, for display and guidance."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.live_decays import MOST_DECAYS
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.intake import NANOSECOND, ImuReading
from swath_sysid.attitude.motion.trial import AXES, AxisMotion, Trial
from swath_sysid.attitude.motion.window import MotionWindow, WindowSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.attitude.prediction.sea_state import SeaReport
from swath_sysid.common.errors import InputError
from swath_sysid.page.bring_up import Facts
from swath_sysid.page.release import Release, release_of
from swath_sysid.pipeline.health import Report

RATE = 25.0  #: Hz; faster samples are thinned: a craft rolls in 1 s and more.
STALE_S = 5.0  #: s after which a status is ignored.
SHOWN_S = 30.0  #: s of motion in a chart, and of the earlier forecasts that are kept for it.
CHECKED_LEAD = 2.0  #: s; lead of the forecast that is kept until its motion has been measured.

LARGEST = 1e6  #: In rad or m; a chart of a larger forecast would show nothing else.

ANOTHERS = 'end or remap the other program that publishes on this topic'

#: Statuses that the page reads; others may come by the thousand.
READ = tuple(f'{node}: imu' for node in ('imu_buffer', 'predictor')) + (
    'imu_buffer: window',
    'predictor: installation',
    'predictor: forecast',
    'identifier: identification',
)

Calm = tuple[float, float, float]


@dataclass(frozen=True)
class Horizon:
    """A forecast over the horizon."""

    stamp: float  #: When issued, s.
    leads: np.ndarray  #: (L,); s.
    mean: dict[str, np.ndarray]  #: (L,) by quantity: roll and pitch, rad; heave of a point, m.
    std: dict[str, np.ndarray]  #: Likewise.


def horizon_of(
    stamp_ns: int,
    leads_ns: Sequence[int],
    columns: Sequence[str],
    positions: Sequence[float],
    shown: Sequence[str] = AXES,
) -> Horizon:
    """The ``shown`` quantities of a message: its stamp, times from then, and columns (``roll``, ``roll_std``, ...).

    Raises:
        InputError: It has other columns only, or values beyond `LARGEST`.
    """
    table = dict(zip(columns, np.reshape(positions, (len(leads_ns), len(columns))).T, strict=True))
    means = {name: table[name] for name in shown if leads_ns and name in table}
    if leads_ns and columns and not means:
        raise InputError(f'the forecast has no {" or ".join(shown)}: {ANOTHERS}')
    if np.any(np.abs(positions) > LARGEST):
        raise InputError(f'the forecast has values beyond {LARGEST:g}: {ANOTHERS}')
    return Horizon(
        stamp_ns * NANOSECOND,
        np.asarray(leads_ns) * NANOSECOND,
        means,
        {name: table.get(f'{name}_std', np.zeros(len(leads_ns))) for name in means},
    )


def calm_of(stamp_ns: int, times_ns: Sequence[int], columns: Sequence[str], positions: Sequence[float]) -> Calm | None:
    """Start and end of a calm window, s, and its probability, from its message; None without one."""
    if not times_ns:
        return None
    probability_of(positions[0] if positions else math.nan)
    return (stamp_ns + times_ns[0]) * NANOSECOND, (stamp_ns + times_ns[-1]) * NANOSECOND, positions[0]


def probability_of(value: float) -> float:
    """The value; raises `InputError` where it is no probability."""
    if not 0.0 <= value <= 1.0:
        raise InputError(f'{value:g} is no probability: {ANOTHERS}')
    return value


class LiveRecord:
    """Recent motion, forecasts, models and statuses; clocks are steady, s, stamps those of the sensor."""

    def __init__(self) -> None:
        self._window: MotionWindow | None = None
        self._installation: Installation | None = None
        self._newest_ns = 0
        self._arrival = float('-inf')
        self._statuses: dict[str, tuple[float, Report]] = {}
        self.horizons: dict[str, Horizon] = {}
        self.checked: dict[str, deque[tuple[float, float, float]]] = {}
        self.models: dict[str, IdentifiedModel] = {}
        self.models_before: dict[str, deque[IdentifiedModel]] = {}
        self.stamps_of_models: dict[str, deque[float]] = {}  #: s; when each came, 0 before the first sample.
        self.releases: dict[str, Release] = {}
        #: The last releases of each axis, with the models up to the one that came after it.
        self.tried: dict[str, deque[tuple[Release, tuple[IdentifiedModel, ...]]]] = {}
        self._model_came: dict[str, float] = {}
        self.limits: QuiescenceLimits | None = None
        self.sea: SeaReport | None = None
        self.quiescence: float | None = None
        self.calm: Calm | None = None
        self.unreadable: dict[str, str] = {}  #: Why the newest message of a topic cannot be shown, where it cannot.
        self.is_kept = False
        self.can_push = False

    def install(self, installation: Installation) -> None:
        """Set the sensor mounting; readings are accepted from the first call on."""
        if installation != self._installation:
            self._installation = installation
            self._window = MotionWindow(WindowSettings(max_rate=2.0 * RATE, installation=installation))

    def is_due(self, stamp_ns: int, clock: float) -> bool:
        """Whether a sample of this stamp is due; every sample is counted."""
        self._arrival = clock
        due = not 0 <= (stamp_ns - self._newest_ns) * NANOSECOND < 1.0 / RATE
        return due and self._window is not None

    def add_reading(self, reading: ImuReading) -> None:
        """Add a sample."""
        self._newest_ns = reading.stamp_ns
        finished = None if self._window is None else self._window.add(reading).finished
        if finished is not None and (release := release_of(finished)) is not None:
            self.releases[finished.axis] = release
            self.tried.setdefault(finished.axis, deque(maxlen=MOST_DECAYS)).append((release, ()))
            self._credit(finished.axis)

    def add_horizon(self, horizon: Horizon, name: str = '') -> None:
        """Add a forecast of the attitude or of the heave of a named point."""
        if name:
            horizon = Horizon(horizon.stamp, horizon.leads, {name: horizon.mean['heave']}, {name: horizon.std['heave']})
        for quantity in horizon.mean:
            self.horizons[quantity] = horizon
            # as many as there are samples in a chart
            kept = self.checked.setdefault(quantity, deque(maxlen=round(SHOWN_S * RATE)))
            at = int(np.argmin(np.abs(horizon.leads - CHECKED_LEAD)))
            time = horizon.stamp + float(horizon.leads[at])
            if kept and time < kept[-1][0]:
                kept.clear()
            kept.append((time, float(horizon.mean[quantity][at]), float(horizon.std[quantity][at])))

    def add_status(self, report: Report, clock: float) -> None:
        """Add a status, named ``NODE: NAME``, if it is one of `READ`."""
        if report.name in READ:
            self._statuses[report.name] = clock, report

    def set_models(self, models: Mapping[str, IdentifiedModel]) -> None:
        """Set the published models; an axis without one has none any more."""
        for axis in AXES:
            before = self.models_before.setdefault(axis, deque(maxlen=MOST_DECAYS))
            stamps = self.stamps_of_models.setdefault(axis, deque(maxlen=MOST_DECAYS))
            if axis not in models:
                before.clear()
                stamps.clear()
            elif models[axis] in before:
                # a rollback, or one that was undone
                place = before.index(models[axis])
                before.append(_taken(before, place))
                stamps.append(_taken(stamps, place))
            else:
                before.append(models[axis])
                stamps.append(self.stamp)
                self._model_came[axis] = self.stamp
                self._credit(axis)
        self.models = dict(models)

    def _credit(self, axis: str) -> None:
        """Credit the last release of an axis with the first model after it; either may be noticed first."""
        tried = self.tried.get(axis)
        if tried and not tried[-1][1] and self._model_came.get(axis, 0.0) > tried[-1][0].motion.time[0]:
            tried[-1] = tried[-1][0], tuple(self.models_before[axis])

    def statuses(self, clock: float) -> dict[str, Report]:
        """Fresh statuses by name."""
        return {name: report for name, (received, report) in self._statuses.items() if clock - received < STALE_S}

    @property
    def stamp(self) -> float:
        """Stamp of the newest sample, s."""
        return self._newest_ns * NANOSECOND

    def trial(self) -> Trial | None:
        """The last minute; None where nothing was measured."""
        return None if self._window is None or self._window.size < 2 else self._window.table().trial()

    def motions(self) -> dict[str, AxisMotion]:
        """The last minute by axis, where angles are measured."""
        if self._window is None or self._window.size < 2:
            return {}
        table, found = self._window.table(), {}
        trial = table.trial()
        start = table.stamp_ns * NANOSECOND - float(trial.time[-1])
        for axis in AXES:
            try:
                motion = trial.axis(axis)
            except InputError:
                # this axis has too few samples, the other may have enough
                continue
            if motion.angle is not None:
                found[axis] = AxisMotion(axis, motion.time + start, motion.angle, motion.rate)
        return found

    def facts(self, axis: str, clock: float) -> Facts:
        """Facts for the bring-up of an axis."""
        return Facts(
            self.statuses(clock),
            clock - self._arrival,
            self.motions(),
            dict(self.releases),
            tuple(self.models_before.get(axis, ())),
            self.is_kept,
            self.can_push,
        )


def _taken(line: deque, place: int) -> Any:
    """Take out what is at a place."""
    found = line[place]
    del line[place]
    return found
