"""The file of what a craft has learnt of the sea: a state space and the period of the motion, in numpy's npz."""

import zipfile
from pathlib import Path

import numpy as np

from swath_sysid.attitude.prediction.rows import CHANNELS
from swath_sysid.attitude.prediction.sea_memory import SeaMemory
from swath_sysid.attitude.prediction.state_space import InnovationsModel
from swath_sysid.attitude.prediction.variate_analysis import LARGEST_RADIUS, spectral_radius
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import existing, reading, replacing, shown

LAYOUT = 1  #: Of the file.
MATRICES = {'mean': 'c', 'scale': 'c', 'a': 'nn', 'k': 'nc', 'c': 'cn', 's': 'cc', 'prior': 'nn'}
MOST_STATES = 200


def write_sea_memory(memory: SeaMemory, path: Path) -> None:
    """Write what was learnt, whole or not at all."""
    waves = memory.waves
    with replacing(path) as temporary, open(temporary, 'wb') as file:
        np.savez(
            file,
            layout=LAYOUT,
            period=memory.period,
            periods=memory.periods,
            step=waves.step,
            channels=np.array(waves.channels),
            **{name: getattr(waves, name) for name in MATRICES},
        )


def read_sea_memory(path: Path) -> SeaMemory:
    """What was learnt; raises `InputError` where the file holds no such thing, or one that cannot be used."""
    with reading(path):
        try:
            with np.load(existing(path), allow_pickle=False) as file:
                held = {name: file[name] for name in file.files}
        except (ValueError, EOFError, zipfile.BadZipFile) as error:
            raise InputError(f'{path} is no memory of the sea ({shown(error)}): move it away') from error
    if 'layout' in held and held['layout'].size == 1 and held['layout'].item() != LAYOUT:
        raise InputError(
            f'{path} is a memory of the sea of layout {shown(held["layout"].item())}, and this version reads {LAYOUT}: '
            'move it away, or use the version that wrote it'
        )
    try:
        return _checked(held)
    except (KeyError, ValueError, TypeError) as error:
        raise InputError(f'{path} is no memory of the sea ({shown(error)}): move it away') from error


def _checked(held: dict[str, np.ndarray]) -> SeaMemory:
    channels = tuple(held['channels'].tolist())
    places = tuple(CHANNELS.index(name) for name in channels)
    states = held['a'].shape[0] if held['a'].ndim else 0
    if not 0 < states <= MOST_STATES or len(set(channels)) < len(channels) or not channels:
        raise ValueError(f'{states} states of {len(channels)} channels')
    size = {'n': states, 'c': len(channels)}
    arrays = {}
    for name, axes in MATRICES.items():
        arrays[name] = held[name].astype(float)
        if arrays[name].shape != tuple(size[axis] for axis in axes) or not np.isfinite(arrays[name]).all():
            raise ValueError(f'{name} of shape {arrays[name].shape}')
    numbers = [float(held[name].item()) for name in ('period', 'periods', 'step')]
    if not all(np.isfinite(numbers)) or not min(numbers) > 0.0 or not (arrays['scale'] > 0.0).all():
        raise ValueError('a period, step or scale that is not positive')
    for name in ('s', 'prior'):
        if np.linalg.eigvalsh(arrays[name])[0] < -1e-9 * np.trace(arrays[name]):
            raise ValueError(f'{name} is no covariance')
    for matrix in (arrays['a'], arrays['a'] - arrays['k'] @ arrays['c']):
        if spectral_radius(matrix) > LARGEST_RADIUS + 1e-9:
            raise ValueError('it is not stable')
    period, periods, step = numbers
    return SeaMemory(period, periods, InnovationsModel(channels, places, step, **arrays))
