"""LabVIEW TDMS files.

Columns are channels with their ``unit_string``; the time is a channel, or the interval of the waveform
(``wf_increment``), and waveforms that start later (``wf_start_time``, ``wf_start_offset``) are shifted; tables are
groups.
"""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.cells import numbers_of
from swath_sysid.formats.text_tables import Losses, NamedColumns, Progress, Read, by_length, check_size, numbers_in
from swath_sysid.formats.vocabulary import with_unit


def tables(path: str | Path) -> list[NamedColumns]:
    """The channels of each group, with their units; those of a waveform state its interval."""
    from nptdms import TdmsFile
    from nptdms.log import log_manager

    # what it warns of is refused below, or raised when the channel is read
    log_manager.set_level(logging.ERROR)
    with TdmsFile.open(path) as file:
        if file.file_status.incomplete_final_segment:
            raise InputError(f'{path} was cut off while it was written or copied: copy it again, or export its rest')
        channels = [(group, channel) for group in file.groups() for channel in group.channels()]
        check_size(path, sum(len(channel) for _, channel in channels))
        found = []
        for group in file.groups():
            for columns in by_length((channel.name, channel) for channel in group.channels()):
                found.append(_table(path, {**file.properties, **group.properties}, group.name, columns))
    return found


def _table(path: str | Path, properties: dict[str, Any], group: str, channels: dict[str, Any]) -> NamedColumns:
    intervals = {channel.properties.get('wf_increment') for channel in channels.values()} - {None}
    remarks = {key.lower(): str(value) for key, value in properties.items()}
    remarks |= {'dt': str(intervals.pop())} if len(intervals) == 1 else {}
    return NamedColumns(
        tuple(with_unit(name, str(channel.properties.get('unit_string', ''))) for name, channel in channels.items()),
        _reader(path, group, list(channels), _shifts(channels)),
        remarks,
        {place: 'date' for place, channel in enumerate(channels.values()) if channel.dtype.kind == 'M'},
        group,
    )


def _shifts(channels: dict[str, Any]) -> list[float]:
    """How much later each waveform starts than the first one, in samples."""
    said = [channel.properties for channel in channels.values()]
    starts = [each.get('wf_start_time', np.datetime64('NaT')) for each in said]
    offsets = [float(each.get('wf_start_offset', 0.0)) for each in said]
    later = [numbers_of(start - starts[0]) if isinstance(start, np.datetime64) else np.nan for start in starts]
    seconds = np.nan_to_num(np.array(later, dtype=float)) + offsets - offsets[0]
    return [round(float(s) / (each.get('wf_increment') or np.inf), 6) for s, each in zip(seconds, said, strict=True)]


def _reader(path: str | Path, group: str, names: Sequence[str], shifts: Sequence[float]) -> Read:
    def read(places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, Losses]:
        from nptdms import TdmsFile

        with TdmsFile.open(path) as file:
            own = [names[place] for place in places]
            values, losses = numbers_in(own, [file[group][name][:] for name in own])
        rows = np.arange(values.shape[1], dtype=float)
        for row, shift in zip(values, (shifts[place] for place in places), strict=True):
            if shift:
                row[:] = np.interp(rows, rows + shift, row, left=np.nan, right=np.nan)
        return values, losses

    return read
