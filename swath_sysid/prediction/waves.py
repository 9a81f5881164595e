"""What a window of the past tells of the motion to come: fitted in the background, used at every forecast."""
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.hull.decay_model import DecayModel
from swath_sysid.motion.trial import AXES
from swath_sysid.prediction.excitation import ExcitationSettings, ForecastTable, fit_table
from swath_sysid.prediction.free_forecast import longest_horizon_step, mean_moments

CHANNELS = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
_LEAST_SHARE = 0.5


@dataclass(frozen=True)
class WaveRequest:
    """A window to fit: plain values, so that another process can do it.

    Attributes
    ----------
    stamp : float
        Of the newest row, s.
    step : float
        s between rows.
    values : ndarray, shape (N, 7)
        `CHANNELS`, oldest first, NaN where missing.
    leads : ndarray, shape (L,)
        s, increasing.
    models : dict of str to DecayModel
        The hulls known, by axis.
    trims : dict of str to float
        Their present trims, rad.
    settings : ExcitationSettings
    """

    stamp: float
    step: float
    values: np.ndarray
    leads: np.ndarray
    models: dict[str, DecayModel] = field(default_factory=dict)
    trims: dict[str, float] = field(default_factory=dict)
    settings: ExcitationSettings = field(default_factory=ExcitationSettings)


@dataclass(frozen=True)
class WaveFit:
    """The regressions of a window.

    Attributes
    ----------
    stamp, step : float
    channels : tuple of int
        Places in `CHANNELS` of what ``motion`` reads.
    targets : tuple of int
        Places in `CHANNELS` of what ``motion`` forecasts: angles, then rates.
    motion : ForecastTable or None
        Of the motion itself, at the request's leads.
    alone : dict of int to ForecastTable
        By the place of an angle: the same from that axis alone, which a short window teaches better.
    others : tuple of int
        Places in `CHANNELS` of what ``moments`` reads beside the moments.
    moments : ForecastTable or None
        Of the exciting moments of the axes in ``hulls``, at 1 .. K steps.
    hulls : dict of str to DecayModel
        The hulls whose moments they are.
    """

    stamp: float
    step: float
    channels: tuple[int, ...]
    targets: tuple[int, ...]
    motion: ForecastTable | None
    alone: dict[int, ForecastTable]
    others: tuple[int, ...]
    moments: ForecastTable | None
    hulls: dict[str, DecayModel]

    @property
    def reach(self):
        """Rows of the past that a forecast reads."""
        return max(t.order + 1 if t else 1 for t in (self.motion, self.moments, *self.alone.values()))

    def motion_ahead(self, lags):
        """Each target at the leads, by its place in `CHANNELS`, from the newest rows (newest first)."""
        ahead = _ahead(self.motion, lags[:, self.channels])
        return {} if ahead is None else dict(zip(self.targets, ahead.T, strict=True))

    def alone_ahead(self, lags):
        """As `motion_ahead`, each axis from itself alone."""
        result = {}
        for place, table in self.alone.items():
            own = own_channels(place, self.channels)
            ahead = _ahead(table, lags[:, own])
            if ahead is not None:
                result.update(zip(own, ahead.T, strict=True))
        return result

    def moments_ahead(self, lags, trims):
        """Moments of the hulls in each step to come, shape (K, H); None where unknown."""
        if self.moments is None:
            return None
        return _ahead(self.moments, moment_channels(lags[::-1], self.hulls, trims, self.others, self.step)[::-1])


def _ahead(table, lags):
    if table is None or lags.shape[0] < table.order:
        return None
    lags = lags[:table.order]
    return table.forecast(lags) if np.isfinite(lags).all() else None


def own_channels(place, channels):
    """The angle at a place and its rate, of those in use."""
    return [c for c in (place, place + len(AXES)) if c in channels]


def moment_channels(values, hulls, trims, others, step):
    """The exciting moments of the hulls and the other channels, one row fewer than given.

    Parameters
    ----------
    values : ndarray, shape (N, 7)
        Oldest first.
    hulls : dict of str to DecayModel
    trims : dict of str to float
    others : sequence of int
    step : float
        s.

    Returns
    -------
    ndarray, shape (N - 1, H + len(others))
    """
    columns = []
    for axis, model in hulls.items():
        place = AXES.index(axis)
        small, per_grid = longest_horizon_step(model, step)
        columns.append(mean_moments(model, values[:, place], values[:, place + 2], trims[axis], small, per_grid))
    return np.column_stack([*columns, values[1:, list(others)]])


def fit_waves(request):
    """Fit the regressions of a window.

    Pure: the same request gives the same fit, in whatever process.

    Parameters
    ----------
    request : WaveRequest

    Returns
    -------
    WaveFit
    """
    values = request.values
    finite = np.isfinite(values)
    useful = [
        c for c in range(values.shape[1])
        if finite[:, c].mean() > _LEAST_SHARE and np.nanstd(values[:, c]) > 1e-9
    ]  # fmt: skip
    axes = [a for a in range(len(AXES)) if a in useful]
    targets = tuple(c for c in (*axes, *(a + len(AXES) for a in axes)) if c in useful)
    motion = None
    if targets:
        places = [useful.index(c) for c in targets]
        # the angles alone decide between candidates: they are what is scored
        motion = fit_table(
            values[:, useful], request.step, places, request.leads, request.settings, decisive=len(axes)
        )
    alone = {}
    for place in axes if len(useful) > 2 or len(axes) > 1 else ():
        own = own_channels(place, useful)
        table = fit_table(
            values[:, own], request.step, range(len(own)), request.leads, request.settings, decisive=1
        )
        if table is not None:
            alone[place] = table
    hulls = {
        axis: model for axis, model in request.models.items()
        if AXES.index(axis) in useful and AXES.index(axis) + len(AXES) in useful
    }  # fmt: skip
    # an axis whose hull is known gives its moment instead of its motion
    others = tuple(
        c for c in useful
        if c >= 2 * len(AXES) or AXES[c % len(AXES)] not in hulls
    )  # fmt: skip
    moments = None
    if hulls:
        rows = moment_channels(values, hulls, request.trims, others, request.step)
        count = int(np.ceil(request.leads[-1] / request.step - 1e-9))
        moments = fit_table(
            rows, request.step, range(len(hulls)), request.step * np.arange(1, count + 1), request.settings
        )
    return WaveFit(request.stamp, request.step, tuple(useful), targets, motion, alone, others, moments, hulls)
