"""Whether a manoeuvring model can be used, by free simulation of runs that were not fitted."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL, LEVELS, REJECTED, TWO_STD
from swath_sysid.common.judgement import Finding, Judgement
from swath_sysid.manoeuvring.hull.identified_model import StabilityCheck
from swath_sysid.manoeuvring.identification.validation import Scores

GOOD_R2 = {'surge': 0.9, 'sway': 0.5, 'yaw_rate': 0.8}  #: Of an adequate model.


@dataclass(frozen=True)
class ManoeuvringVerdict(Judgement):
    """A judgement of a manoeuvring model, as `ManoeuvringIdentification.verdict` gives it."""

    channels: dict[str, str]  #: Level of surge, sway and yaw_rate, as far as the runs held out test them.

    @property
    def metrics(self) -> dict[str, Any]:
        """As model files hold it."""
        return {**super().metrics, 'verdict_channels': self.channels}


def judge(
    identification: Scores, validation: Scores | None, noise: np.ndarray, instability: StabilityCheck | None
) -> ManoeuvringVerdict:
    """Judge a model by its gravest cause: its scores on the runs that it was fitted to, those of runs held out (None:
    there were none), the sensor noise (3,), and the check of a model that runs away at the speeds of its runs.
    """
    if instability is not None:
        speed = instability.unstable_speed
        unstable = Advice.of('unstable', where='' if np.isnan(speed) else f' (at {speed:.2f} m/s)')
        return ManoeuvringVerdict.by_gravest([(REJECTED, unstable)], {})
    if validation is None:
        return ManoeuvringVerdict.by_gravest([(DOUBTFUL, Advice.of('no-runs-held-out'))], {})
    levels = {name: level_of(name, validation, size) for name, size in zip(GOOD_R2, noise, strict=True)}
    channels = {name: level for name, level in levels.items() if np.isfinite(validation.r2[name])}
    shares = ', '.join(f'{max(validation.r2[name], 0.0):.0%} of the {_words(name)}' for name in channels)
    good = f'in free simulation of runs that were not fitted the model explains {shares}'
    causes: list[Finding] = [(ADEQUATE, Advice(ADEQUATE, good))]
    idle = [name for name, r2 in validation.r2.items() if np.isnan(r2) and identification.r2[name] > 0.0]
    if idle:
        named = ' and '.join(_words(name) for name in idle)
        causes.append((DOUBTFUL, Advice.of('not-validated', channels=named)))
    if poor := poor_channels(validation, noise):
        worst = min(channels.values(), key=LEVELS.index)
        causes.append((worst, Advice.of('poor-validation', channels=poor)))
    if validation.diverged:
        diverged, windows = validation.diverged, validation.windows
        causes.append((REJECTED, Advice.of('diverged', diverged=diverged, windows=windows, label='validation')))
    return ManoeuvringVerdict.by_gravest(causes, channels)


def level_of(name: str, scores: Scores, noise: float) -> str:
    """The level of a channel; an error of the size of the sensor noise leaves nothing to explain."""
    r2 = scores.r2[name]
    if not r2 < GOOD_R2[name] or scores.rmse[name] <= TWO_STD * noise:
        return ADEQUATE
    return DOUBTFUL if r2 >= 0.0 else REJECTED


def poor_channels(scores: Scores, noise: np.ndarray) -> str:
    """R2 of the channels that are not adequate, in words; empty where there are none."""
    poor = [name for name, size in zip(GOOD_R2, noise, strict=True) if level_of(name, scores, size) != ADEQUATE]
    return ', '.join(f'{_words(name)} {scores.r2[name]:.3g}' for name in poor)


def _words(name: str) -> str:
    return name.replace('_', ' ')
