"""An identified model in words: its numbers, its verdict, and the gain from each release."""

import re
from collections.abc import Iterable, Sequence
from datetime import datetime
from math import isfinite

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.fit_quality import AmplitudeBands, amplitude_bands
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.conventions import ADEQUATE, percent

ASSUMED_REACH = float(np.radians(5.0))  #: Largest amplitude shown of a model that states none.
NOT_JUDGED = 'not judged'
FAINTEST = 0.1  #: Smallest, as a share of the largest; below, noise scatters the cycles of a release.


def amplitudes(model: IdentifiedModel) -> tuple[float, float]:
    """Range of amplitudes of a model's identification, rad."""
    low, high = model.amplitude_range
    high = high if isfinite(high) and high > 0.0 else ASSUMED_REACH
    return (low if 0.0 < low < high else FAINTEST * high), high


def reference(model: IdentifiedModel) -> tuple[float, AmplitudeBands]:
    """Geometric mean of those amplitudes, rad, and the curves there."""
    amplitude = float(np.sqrt(np.prod(amplitudes(model))))
    return amplitude, amplitude_bands(model.model, model.covariance, np.array([amplitude]), model.posterior)


def described(model: IdentifiedModel) -> str:
    """One period with its amplitude, and the damping with two standard deviations."""
    amplitude, bands = reference(model)
    period = 2.0 * np.pi / float(bands.curves.frequency[0])
    damping, std = float(bands.curves.damping_ratio[0]), float(bands.damping_ratio_std[0])
    damped = f'damping ratio {damping:.3f}\u00a0±\u00a0{2.0 * std:.2g}'
    return f'{period:.2f} s at {np.degrees(amplitude):.2g} deg, {damped}'


def verdict_of(model: IdentifiedModel) -> tuple[str, str]:
    """Level of a model's verdict and, unless it is adequate, cause and cure in one sentence."""
    level = str(model.metrics.get('verdict') or NOT_JUDGED)
    if level == ADEQUATE:
        return level, ''
    return level, str(model.metrics.get('verdict_sentence') or 'release again in still water, from a larger angle')


def releases_in(model: IdentifiedModel) -> int:
    """Number of decays in a fit."""
    return len(model.provenance.get('segments_s', ()))


def error_of(model: IdentifiedModel) -> str:
    """Expected error of the next release's motion; empty where not known."""
    error = model.metrics.get('motion_error')
    return percent(error, 2) if isinstance(error, float) and isfinite(error) else ''


def gain(models: Sequence[IdentifiedModel]) -> str:
    """The gain of the last release for the models of an axis, the newest last; empty where not known."""
    error = error_of(models[-1])
    before = error_of(models[-2]) if len(models) > 1 and releases_in(models[-2]) < releases_in(models[-1]) else ''
    return error and f'next decay forecast to within {error} of its motion' + (f' ({before} before)' if before else '')


def history(models: Sequence[IdentifiedModel], stamps: Iterable[float]) -> list[str]:
    """The models of an axis in words, each with its date, unless that is 0, and verdict; the newest last."""
    lines = []
    for model, stamp in zip(models, stamps, strict=True):
        count, error = releases_in(model), error_of(model)
        date = f'{datetime.fromtimestamp(stamp):%Y-%m-%d %H:%M}, ' if stamp else ''
        fit = f'{count} release{"s" if count != 1 else ""}' if count else 'identified'
        within = f', next decay to within {error} of its motion' if error else ''
        lines.append(f'{date}{verdict_of(model)[0]}, {fit}: {described(model)}{within}')
    return lines


def of_axis(message: str, axis: str) -> str:
    """The part of an identifier's message about an axis; all of it where no axis is named."""
    clauses = re.split(rf'(?:^|; )({"|".join(AXES)}): ', message)
    found = dict(zip(clauses[1::2], clauses[2::2], strict=True))
    return found.get(axis, f'no free decay in {axis}') if found else message
