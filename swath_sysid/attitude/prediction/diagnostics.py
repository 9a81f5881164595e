"""The running state of a forecaster, for operators."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.bank import CANDIDATES, Bank
from swath_sysid.common.advice import Advice


@dataclass(frozen=True)
class ForecasterDiagnostics:
    """The running state, for operators."""

    sample_interval: float  #: s; NaN before the second sample.
    has_model: dict[str, bool]  #: By axis.
    has_waves: bool  #: Whether a state space of the waves is in use.
    nis_ratio: dict[str, float]  #: Innovations squared over their expectation, by axis; one is healthy.
    nrmse: np.ndarray  #: (A, L); running error over the size of the motion.
    coverage: np.ndarray  #: (A, L); coverage of the 90 % intervals.
    candidates: tuple[str, ...]  #: (K,); their names.
    candidate_nrmse: np.ndarray  #: (K, A, L); running error of each.
    weights: np.ndarray  #: (K, A, L); their weights.
    upstream_gain: dict[str, np.ndarray]  #: (A, L); share of the running error that each upstream channel saves.
    advice: tuple[Advice, ...]
    valid_leads: dict[str, float] = field(default_factory=dict)  #: As in `Forecast`.


def diagnose(
    axes: Mapping[str, AxisFilter], bank: Bank | None, asked: Any, count: int, interval: float, has_waves: bool
) -> ForecasterDiagnostics:
    """The running state at ``count`` leads, the places ``asked`` of the bank's; errors are NaN before any row."""
    started = {name: axis for name, axis in axes.items() if axis.hull.is_started}
    advice = tuple(Advice.of('no-model', axis=name) for name, axis in started.items() if axis.identified is None)
    if not has_waves:
        advice += (Advice.of('no-waves'),)
    advice += tuple(note for axis in axes.values() for note in axis.advice())
    gain: dict[str, np.ndarray] = {}
    nrmse = coverage = np.full((len(axes), count), np.nan)
    names = tuple(CANDIDATES) if bank is None else bank.names
    candidate = weights = np.full((len(names), len(axes), count), np.nan)
    if bank is not None:
        # a still craft moves less than its sensor's noise, which no forecast of readings can miss by less
        size = np.array([max(axis.size.deviation, math.sqrt(axis.noise[0])) for axis in axes.values()])[:, None]
        blend = bank.blend
        places = blend.place_of_lead[asked]
        nrmse, coverage = np.sqrt(blend.blended_square[places]).T / size, blend.coverage[places].T
        candidate = np.sqrt(blend.mean_square[:, places]).transpose(0, 2, 1) / size
        weights = blend.weights[:, places].transpose(0, 2, 1)
        gain = {channel: bank.gain_of(channel)[places].T for channel in bank.channels}
    return ForecasterDiagnostics(
        interval,
        {name: axis.identified is not None for name, axis in axes.items()},
        has_waves,
        {name: axis.hull.strain for name, axis in started.items()},
        nrmse,
        coverage,
        names,
        candidate,
        weights,
        gain,
        advice,
    )
