"""NMEA 0183 logs.

Roll, pitch and heading are those of the sentences ``PASHR``, ``PRDID``, ``PSXN,23``, ``PFEC,GPatt`` and ``XDR``
(forward-right-down); each talker is a table; the time is that of the sentence, or of the last ``ZDA``, ``RMC`` or
``GGA``, else the one that a logger wrote before the sentence.
"""

import os
import re
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np

from swath_sysid.common.account import Loss
from swath_sysid.common.errors import InputError
from swath_sysid.formats.cells import numbers_of, seconds_of_text
from swath_sysid.formats.text_tables import Losses, NamedColumns, check_size, of_arrays
from swath_sysid.formats.vocabulary import plain_name

#: What the fields of a sentence are, by how it begins.
SENTENCES = {
    'PASHR,': 'time heading - roll pitch',
    'PRDID,': 'pitch roll heading',
    'PSXN,23,': 'roll pitch heading',
    'PFEC,GPatt,': 'heading pitch roll',
}
NAMES = ('time_s', 'roll_deg', 'pitch_deg', 'heading_deg')
TIMED = ('ZDA,', 'RMC,', 'GGA,')
LINE = re.compile(r'([^$\r\n]*)\$([A-Za-z]+,[^*\r\n]*)(?:\*([0-9A-Fa-f]{2}))?')
CLOCK = re.compile(r'(\d\d)(\d\d)(\d\d(\.\d*)?)')
XDR = re.compile(r'A,([-+.\d]+),D,([^,*]*)')
#: What a transducer of the attitude may be called, by the first letter of the quantity.
TRANSDUCERS = {'p': ('pitch', 'ptch', 'trim'), 'r': ('roll', 'heel', 'krang', 'kraeng', 'gite')}
#: What begins any sentence of the attitude, also one that was cut.
BEGIN = re.compile(
    rf'{"|".join(SENTENCES)}|XDR,.*?({"|".join(word for words in TRANSDUCERS.values() for word in words)})',
    re.IGNORECASE,
)


def tables(path: str | Path) -> list[NamedColumns]:
    """The attitude by talker."""
    check_size(path, os.path.getsize(path))
    rows: dict[str, list[list[float]]] = {}
    clock, text = '', Path(path).read_text('latin-1')
    sentences = LINE.findall(text)
    summed = {said[:5] for _, said, checksum in sentences if checksum}
    # a bare number would not state what it counts
    logged = numbers_of([before.strip(' ,;\t') if ':' in before else '' for before, *_ in sentences])
    for (_, said, checksum), received in zip(sentences, logged.tolist(), strict=True):
        row, is_whole = _attitude(said), said[:5] not in summed
        if checksum:
            is_whole = reduce(xor, said.encode('latin-1')) == int(checksum, 16)
        if is_whole and said[2:].startswith(TIMED):
            clock = said.split(',')[1]
        if is_whole and row:
            times = _seconds(row.get('t', clock)), received
            talker = said.split(',')[0] if said.startswith('P') else said[:2]
            rows.setdefault(talker, []).append([*times, *(_number(row.get(name, '')) for name in 'rph')])
    if not rows:
        raise InputError(f'{path} is an NMEA log without a sentence of the attitude: log {", ".join(SENTENCES)} or XDR')
    number = len(BEGIN.findall(text))
    damaged = Loss('damaged-sentences', number - sum(map(len, rows.values())), number, 'sentences of the attitude')
    return [_table(talker, found, (damaged,)) for talker, found in rows.items()]


def _table(talker: str, rows: list[list[float]], losses: Losses) -> NamedColumns:
    time, logged, *angles = np.array(rows).T
    columns = zip(NAMES, (time if np.isfinite(time).any() else logged, *angles), strict=True)
    return of_arrays({n: v for n, v in columns if np.isfinite(v).any()}, {'frame': 'frd'}, talker, losses)


def _attitude(said: str) -> dict[str, str]:
    """What a sentence says of the attitude, by the first letter of the quantity; empty if nothing."""
    row: dict[str, str] = {}
    for value, name in XDR.findall(said) if said[2:].startswith('XDR,') else ():
        plain = plain_name(name)
        row |= {key: value for key, words in TRANSDUCERS.items() if any(word in plain for word in words)}
    for begin, fields in SENTENCES.items():
        if said.startswith(begin):
            row = {name[0]: value for name, value in zip(fields.split(), said[len(begin) :].split(','), strict=False)}
    return row if {'r', 'p'} & row.keys() else {}


def _seconds(clock: str) -> float:
    found = CLOCK.fullmatch(clock)
    return seconds_of_text(':'.join(found.groups()[:3])) if found else np.nan


def _number(said: str) -> float:
    return float(said) if re.fullmatch(r'[-+]?\d+(\.\d*)?', said) else np.nan
