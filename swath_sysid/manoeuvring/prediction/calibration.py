"""Calibrated prediction intervals, by the forecast errors on the runs of the identification."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.motion.trial import Run
from swath_sysid.manoeuvring.prediction.predictor import MEASURABLE, ManoeuvreFilterSettings
from swath_sysid.manoeuvring.prediction.skill import HELD, INTERVAL, LEADS, due, recorded

FORECASTS = 250  #: More hardly improve the estimate of a 90 % interval.
MIN_SCALE = 0.1  #: Seldom changing thrust leaves most errors at short leads far below its variance.


def calibrated(identified: IdentifiedManoeuvringModel, runs: Sequence[Run]) -> IdentifiedManoeuvringModel:
    """The model with the scale of its forecast intervals by lead and channel, from the runs of its identification. With
    it the 90 % interval covers that share of the errors under held thrust, and more for few independent forecasts
    (split conformal prediction, Lei et al. 2018).
    """
    forecast = identified.forecast
    if forecast is None:
        raise InputError('the noise of forecasts was not measured: identify the craft again')
    errors, variances, noise = _errors(identified, runs)
    duration = sum(run.duration for run in runs)
    scale = np.ones((len(MEASURABLE), len(LEADS)))
    for c in range(len(MEASURABLE)):
        for k in range(len(LEADS)):
            known = np.isfinite(errors[:, k, c])
            apart = min(known.sum(), duration / max(LEADS[k], forecast.thrust_time))
            # where the sensor's own noise is larger, the errors say nothing about the forecast
            if known.any() and np.median(variances[known, k, c]) > noise[c] ** 2:
                scale[c, k] = _scale(errors[known, k, c], variances[known, k, c], noise[c], HELD * (1.0 + 1.0 / apart))
    return replace(identified, forecast=replace(forecast, leads=np.array(LEADS), scale=scale))


def _errors(identified: IdentifiedManoeuvringModel, runs: Sequence[Run]):
    """Errors and variances of forecasts, shape (F, L, 6) each, NaN where unknown; and the sensor noise, (6,)."""
    total = sum(run.duration for run in runs)
    errors, variances = [], []
    for run in runs:
        truth = recorded(run)
        for k, filter_, reach in due(identified, run, total / FORECASTS, LEADS):
            steps = np.array([round(LEADS[i] / run.step) for i in reach])
            forecast = filter_.forecast([LEADS[i] for i in reach])
            found = np.full((2, len(LEADS), len(MEASURABLE)), np.nan)
            found[0, reach] = forecast.recorded - truth[:, k + steps].T
            found[1, reach] = np.diagonal(forecast.recorded_covariances, axis1=1, axis2=2)
            errors.append(found[0])
            variances.append(found[1])
    shape, settings = (-1, len(LEADS), len(MEASURABLE)), ManoeuvreFilterSettings.of(identified)
    noise = np.array([settings.noise(name) for name in MEASURABLE])
    return np.reshape(errors, shape), np.reshape(variances, shape), noise


def _scale(errors: np.ndarray, variances: np.ndarray, noise: float, held: float):
    """Factor on the standard deviations, sensor noise apart, for a coverage of ``held``."""
    needed = np.sqrt(np.maximum((errors / INTERVAL) ** 2 - noise**2, 0.0) / variances)
    return max(float(np.quantile(needed, min(held, 1.0), method='higher')), MIN_SCALE)
