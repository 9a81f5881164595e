"""The outlook: IMU messages in, the messages of a forecast out, all as plain numbers.

Live node and play-through run this object, so that both publish the same stamps and values.
"""
from dataclasses import dataclass, field
from math import inf, pi
from typing import NamedTuple

import numpy as np

from swath_sysid.motion import attitude
from swath_sysid.motion.installation_watch import InstallationCheck
from swath_sysid.motion.intake import INTAKE_REASONS, NANOSECOND, ImuReading, Intake
from swath_sysid.motion.sensing import Installation
from swath_sysid.motion.stamps import GAP, JUMPED_BACK, LONG_GAP, STAMP_REASONS, StampSettings
from swath_sysid.motion.trial import AXES
from swath_sysid.prediction.predictor import ImuSample, Predictor, PredictorSettings, Step
from swath_sysid.prediction.waves import WaveRequest, fit_waves

UNKNOWN_ANGLE_VARIANCE = pi * pi
"""rad^2; of a heading, which is not forecast but held, and of an axis that the sensor does not give."""

UNKNOWN_RATE_VARIANCE = 100.0
"""rad^2/s^2."""

NOT_GIVEN = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The covariance of a quantity that a sensor_msgs/Imu does not give."""

COUNTED_BY_PREDICTOR = (JUMPED_BACK, GAP, LONG_GAP)
"""Of the stamps that follow; those that do not never reach it."""

OUTLOOK_REASONS = (*(reason for reason in STAMP_REASONS if reason not in COUNTED_BY_PREDICTOR), *INTAKE_REASONS)

NEXT_TOPIC = 'forecast/next'
HORIZON_TOPIC = 'forecast/horizon'
QUIESCENCE_TOPIC = 'forecast/quiescence'
HORIZON_COLUMNS = tuple(f'{axis}{kind}' for axis in AXES for kind in ('', '_std'))


def lead_topic(lead):
    """Topic of the forecasts at one lead: 0.5 s is on ``forecast/lead_0_5s``.

    Parameters
    ----------
    lead : float
        s.
    """
    return f'forecast/lead_{str(float(lead)).replace(".", "_")}s'


@dataclass(frozen=True)
class OutlookSettings:
    """Where the sensor sits, and how the predictor works.

    Attributes
    ----------
    installation : Installation
    predictor : PredictorSettings
    """

    installation: Installation = field(default_factory=Installation)
    predictor: PredictorSettings = field(default_factory=PredictorSettings)

    @property
    def stamps(self):
        """What counts as late, and what as a gap."""
        return StampSettings(self.predictor.backward_jump, self.predictor.gap_limit)


class AttitudeForecast(NamedTuple):
    """What a sensor_msgs/Imu of a forecast says, in the axes of the craft (FLU in ENU).

    Attributes
    ----------
    stamp_ns : int
        The time it is for.
    orientation : tuple of 4 floats
        Quaternion x, y, z, w.
    orientation_covariance : tuple of 9 floats
    rates : tuple of 3 floats
        Body rates, rad/s.
    rates_covariance : tuple of 9 floats
    """

    stamp_ns: int
    orientation: tuple[float, ...]
    orientation_covariance: tuple[float, ...]
    rates: tuple[float, ...]
    rates_covariance: tuple[float, ...]


@dataclass(frozen=True)
class HorizonForecast:
    """What a trajectory_msgs/JointTrajectory of a forecast says.

    Attributes
    ----------
    stamp_ns : int
        When issued.
    columns : tuple of str
        Of `HORIZON_COLUMNS`, those of the axes that the sensor gives: ``roll``, ``roll_std``, ...
    leads_ns : tuple of int
        From the stamp.
    positions : ndarray, shape (L, columns)
        Angle and its standard deviation, rad.
    velocities : ndarray, shape (L, columns)
        Euler rate and its standard deviation, rad/s.
    """

    stamp_ns: int
    columns: tuple[str, ...]
    leads_ns: tuple[int, ...]
    positions: np.ndarray
    velocities: np.ndarray


class OutlookStep(NamedTuple):
    """What one IMU message led to.

    Attributes
    ----------
    reasons : tuple of str
        What was counted, by intake and predictor.
    next : AttitudeForecast or None
        For ``forecast/next``.
    leads : tuple of (float, AttitudeForecast)
        Lead, s, and what is for its topic; empty unless due.
    horizon : HorizonForecast or None
        For ``forecast/horizon``; None unless due.
    waves : WaveRequest or None
        To be fitted by `fit_waves`, in the background or at once; the result is for `Outlook.install`.
    predicted : Step or None
        What the predictor said; None where the message held nothing usable.
    """

    reasons: tuple[str, ...] = ()
    next: AttitudeForecast | None = None
    leads: tuple[tuple[float, AttitudeForecast], ...] = ()
    horizon: HorizonForecast | None = None
    waves: WaveRequest | None = None
    predicted: Step | None = None

    @property
    def quiescence(self):
        """For ``forecast/quiescence``: the probability; None where none is known, or it is not due."""
        horizon = None if self.predicted is None else self.predicted.horizon
        return None if horizon is None or horizon.quiescence != horizon.quiescence else horizon.quiescence


class Outlook:
    """Forecast messages from IMU messages and models.

    Pure and causal: time is the stamps; the same messages give the same forecasts.

    Parameters
    ----------
    settings : OutlookSettings, optional
    intake : Intake, optional
        That of the settings, where another core shares it.
    """

    def __init__(self, settings=None, intake=None):
        self.settings = settings or OutlookSettings()
        self.predictor = Predictor(self.settings.predictor)
        self._intake = intake or Intake(self.settings.installation, self.settings.stamps)
        self.installation = InstallationCheck(self.settings.installation)
        self.counts = dict.fromkeys(OUTLOOK_REASONS, 0)
        self.used = 0
        self._hulls = dict.fromkeys(AXES)
        self._first_ns = None
        self._yaw = 0.0
        self._yaw_rate = 0.0

    def set_models(self, models):
        """Swap the hulls under the running filters; one that stays the same is not touched.

        Parameters
        ----------
        models : dict of str to IdentifiedModel
            By axis; an axis without one is forecast with constant rate.
        """
        for axis in AXES:
            held = models.get(axis)
            model = None if held is None else held.model
            if model != self._hulls[axis]:
                self._hulls[axis] = model
                self.predictor.set_model(axis, model, inf if held is None else held.amplitude_range[1])

    def install(self, fit):
        """Take in the fit of the waves that a step asked for.

        Parameters
        ----------
        fit : WaveFit
        """
        self.predictor.install(fit)

    def add(self, reading: ImuReading, on_next=None):
        """Take in one message.

        Parameters
        ----------
        reading : ImuReading
        on_next : callable, optional
            Called with the step's ``next`` as soon as it is known: the leads take longer.

        Returns
        -------
        OutlookStep
        """
        return self.add_taken(self._intake.take(reading), on_next)

    def add_taken(self, taken, on_next=None):
        """Take in what the intake made of one message.

        Parameters
        ----------
        taken : Taken
        on_next : callable, optional
            See `add`.

        Returns
        -------
        OutlookStep
        """
        sample, reasons = taken
        if reasons:
            reasons = tuple([reason for reason in reasons if reason not in COUNTED_BY_PREDICTOR])
            for reason in reasons:
                self.counts[reason] += 1
        if sample is None:
            return OutlookStep(reasons)
        self.installation.add(sample)
        stamp_ns = sample[0]
        if self._first_ns is None:
            self._first_ns = stamp_ns
        # seconds since the epoch would resolve 0.2 us only
        since_first = (stamp_ns - self._first_ns) * NANOSECOND
        # heading and its rate are not forecast: the last measured are held
        yaw, yaw_rate = sample[12:]
        if yaw == yaw:
            self._yaw = yaw
        if yaw_rate == yaw_rate:
            self._yaw_rate = yaw_rate
        following = None

        def tell(ahead):
            nonlocal following
            following = attitude_forecast(stamp_ns, *ahead, self._yaw, self._yaw_rate)
            if on_next is not None:
                on_next(following)

        step = self.predictor.observe(ImuSample(since_first, *sample[1:12]), tell)
        reasons += step.reasons
        if not step.used:
            return OutlookStep(reasons, predicted=step)
        self.used += 1
        if step.forecast is None:
            return OutlookStep(reasons, following, predicted=step)
        return OutlookStep(
            reasons, following, self._at_leads(step.forecast, stamp_ns), horizon_forecast(step.horizon, stamp_ns),
            step.refit, step,
        )  # fmt: skip

    def _at_leads(self, forecast, stamp_ns):
        rows = {
            axis: [
                (angle, rate, first, both, second)
                for angle, rate, ((first, both), (_, second)) in zip(
                    told.angle.tolist(), told.rate.tolist(), told.covariance.tolist(), strict=True
                )
            ] for axis, told in forecast.axes.items()
        }  # fmt: skip
        return tuple([
            (lead, attitude_forecast(
                stamp_ns, lead, {axis: row[k] for axis, row in rows.items()}, self._yaw, self._yaw_rate
            )) for k, lead in enumerate(forecast.leads.tolist())
        ])  # fmt: skip


_NOTHING_KNOWN = 0.0, 0.0, UNKNOWN_ANGLE_VARIANCE, 0.0, UNKNOWN_RATE_VARIANCE


def attitude_forecast(stamp_ns, lead, axes, yaw, yaw_rate):
    """The forecast at one lead as an attitude with covariance.

    Parameters
    ----------
    stamp_ns : int
        When issued.
    lead : float
        s.
    axes : dict of str to sequence of 5 floats
        By axis that the sensor gives: angle, rate, angle variance, covariance of both, rate variance.
    yaw, yaw_rate : float
        Held heading, rad, and its rate, rad/s.

    Returns
    -------
    AttitudeForecast
    """
    roll, roll_rate, roll_variance, _, roll_rate_variance = axes.get('roll', _NOTHING_KNOWN)
    pitch, pitch_rate, pitch_variance, _, pitch_rate_variance = axes.get('pitch', _NOTHING_KNOWN)
    return AttitudeForecast(
        stamp_ns + round(lead / NANOSECOND),
        attitude.quaternion(roll, pitch, yaw),
        _diagonal(roll_variance, pitch_variance, UNKNOWN_ANGLE_VARIANCE) if axes else NOT_GIVEN,
        attitude.body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate),
        _diagonal(roll_rate_variance, pitch_rate_variance, UNKNOWN_RATE_VARIANCE) if axes else NOT_GIVEN,
    )


def horizon_forecast(forecast, stamp_ns):
    """The forecast over the horizon as a table.

    Parameters
    ----------
    forecast : Forecast
    stamp_ns : int
        When issued.

    Returns
    -------
    HorizonForecast
    """
    positions, velocities = np.empty((2, forecast.leads.size, 2 * len(forecast.axes)))
    for place, told in enumerate(forecast.axes.values()):
        positions[:, 2 * place], velocities[:, 2 * place] = told.angle, told.rate
        np.sqrt(told.covariance[:, 0, 0], out=positions[:, 2 * place + 1])
        np.sqrt(told.covariance[:, 1, 1], out=velocities[:, 2 * place + 1])
    return HorizonForecast(
        stamp_ns,
        tuple([f'{axis}{kind}' for axis in forecast.axes for kind in ('', '_std')]),
        tuple(np.round(forecast.leads / NANOSECOND).astype(np.int64).tolist()),
        positions,
        velocities,
    )


def _diagonal(about_x, about_y, about_z):
    return (about_x, 0.0, 0.0, 0.0, about_y, 0.0, 0.0, 0.0, about_z)


def warm_up():
    """A small fit of simulated waves, so that the next one finds everything loaded."""
    time = np.arange(0.0, 12.0, 0.1)
    values = np.stack([np.sin((1.0 + 0.3 * c) * time + np.sin((2.0 + c) * time)) for c in range(7)], axis=1)
    fit_waves(WaveRequest(float(time[-1]), 0.1, values, np.array([0.5])))
