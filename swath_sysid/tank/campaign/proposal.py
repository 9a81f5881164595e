"""The manifest that is proposed for a folder of trials: from the names, the lines above the tables, and the periods."""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from swath_sysid.attitude.hull.identified_model import QUANTITIES
from swath_sysid.attitude.identification.peaks import Peaks
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.advice import counted
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import write_text
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.registry import ENDINGS
from swath_sysid.tank.campaign.manifest import NUMBER, values_in_name
from swath_sysid.tank.campaign.trials import of_like_periods, turns_of

_PLAIN = r'\d+(?:[.,]\d+)?'
#: Placeholder to where its number stands in a name, in the order in which they are looked for.
_IN_NAMES = (
    ('angle', rf'(?<![\d.,]){_PLAIN}(?=[ _-]?(?:deg|°|grad))'),
    ('angle', rf'(?<=phi){_PLAIN}|(?<=angle){_PLAIN}|(?<=winkel){_PLAIN}'),
    ('speed', rf'(?<![\d.,]){_PLAIN}(?=[ _-]?m(?:[_/-]?s|ps)(?![a-z]))'),
    ('speed', rf'(?<=(?<![a-z])[vu]){_PLAIN}|(?<=speed){_PLAIN}'),
    ('draft_factor', rf'(?<![\d.,]){_PLAIN}(?=[ _-]?T(?![a-z]))'),
    ('draft', rf'(?<![\d.,]){_PLAIN}(?=[ _-]?m(?![a-z0-9/]|[_-]s))'),
    ('draft', rf'(?<=(?<![a-z])[td])\d+[.,]\d+|(?<=draft){_PLAIN}|(?<=draught){_PLAIN}|(?<=tiefgang){_PLAIN}'),
    ('displacement', rf'(?<![\d.,]){_PLAIN}(?=[ _-]?kg)'),
    ('repeat', r'(?:(?<=repeat)|(?<=rep)|(?<=run)|(?<=trial)|(?<=(?<![a-z])r))[ _-]?\d+'),
    ('axis', r'(?<![a-z])(?:roll|pitch)(?![a-z])'),
)
#: Key of an entry to the words before its number in a line above a table, and the units that may follow it.
_IN_LINES = {
    'draft_m': ('draft|draught|tiefgang', {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}),
    'displacement_kg': ('displacement|verdrängung|masse?', {'kg': 1.0, 't': 1e3}),
    'speed_m_s': ('speed|velocity|geschwindigkeit', {'m/s': 1.0}),
    'initial_angle_deg': (r'(?:\w* )?\w*(?:angle|winkel)', {'deg': 1.0, '°': 1.0, 'grad': 1.0}),
}
CONTRADICTION = '  # The periods contradict each other, so these trials are of several drafts: give each its draft_m.'
LINES_ABOVE = 4096  #: Bytes in which lines above a table are looked for.


@dataclass(frozen=True)
class Seen:
    """What is known of a file before anything is fitted."""

    path: Path
    said: dict[str, float]  #: What the lines above its table say, by the key of an entry.
    axis: str = ''
    decays: list[tuple[DecaySegment, Peaks]] = field(default_factory=list)
    fault: str = ''  #: Why it cannot be read as it is.

    @property
    def remark(self) -> str:
        """What its releases are, for a comment."""
        if self.fault:
            return self.fault.replace('\n', ' ')
        period = float(np.mean([segment.period for segment, _ in self.decays]))
        return f'{counted(len(self.decays), "release")}, period {period:.3g} s'


def new_manifest(folder: str | Path, name: str = 'campaign.yaml', at: str | Path | None = None) -> str:
    """Text of a commented manifest for the trials in a folder."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f'{folder} is not a folder: give the folder of the trials')
    files = [_seen(p) for p in sorted(folder.iterdir()) if _may_be_trial(p)]
    if not files:
        raise InputError(f'{folder} holds no trial: {", ".join(ENDINGS)} and bag folders were looked for')
    by_pattern: dict[str, list[Seen]] = {}
    for file in files:
        by_pattern.setdefault(pattern_of_name(file.path.name), []).append(file)
    way = '' if at is None else Path(os.path.relpath(os.path.realpath(folder), os.path.realpath(at))).as_posix() + '/'
    way = '' if way == './' else way
    entries = [(pattern, file, _keys_of(pattern, file)) for pattern, group in by_pattern.items() for file in group]
    unplaced = [file for _, file, keys in entries if not set(QUANTITIES) & set(keys)]
    are_apart = len(_like_periods(unplaced)) > 1
    lines = [CONTRADICTION] if are_apart else []
    for pattern, group in by_pattern.items():
        own = [(file, keys) for each, file, keys in entries if each == pattern]
        in_name = values_in_name(pattern, group[0].path.name)
        if in_name and not any(set(keys) - set(in_name) or (are_apart and file in unplaced) for file, keys in own):
            lines.append(f'  - pattern: {_quoted(way + pattern)}   # {counted(len(group), "file")}')
        else:
            lines += [line for file, keys in own for line in _entry(file, keys, way)]
    named = next((a for a in AXES if any(a in file.path.name.lower() for file in files)), '')
    moving = [file.axis for file in files if file.axis]
    axis = named or max(AXES, key=moving.count) if named or moving else 'pitch'
    head = resources.files(__package__).joinpath('new_manifest.yaml').read_text(encoding='utf-8')
    title = _quoted(folder.resolve().name or 'campaign')
    return head.format(name=name, title=title, axis=axis) + '\n'.join(lines) + '\n'


def write_new_manifest(folder: str | Path, path: str | Path) -> list[str]:
    """Write `new_manifest` to a file that does not exist yet; sentences on what is to be filled in."""
    path = Path(path)
    if path.exists():
        raise InputError(f'{path} exists already: remove it first, or name another file', 'manifest-exists')
    text = new_manifest(folder, path.name, path.parent)
    write_text(path, text)
    return [CONTRADICTION.strip(' #')] if CONTRADICTION in text else []


def _keys_of(pattern: str, file: Seen) -> dict[str, Any]:
    """What a file's name says and, where that says nothing, the lines above its table."""
    named, said = values_in_name(pattern, file.path.name), dict(file.said)
    if 'displacement_kg' in said and {'draft_m', 'draft_factor'} & {*named, *said}:
        # the draft is the loading, and the displacement its mass
        said['mass_kg'] = said.pop('displacement_kg')
    taken = {*named, *(QUANTITIES if set(QUANTITIES) & set(named) else ())}
    return named | {key: value for key, value in said.items() if key not in taken}


def _entry(file: Seen, keys: dict[str, Any], way: str) -> Iterator[str]:
    """Lines for one file: what is known of it, and what may be added."""
    yield f'  - file: {_quoted(way + file.path.name)}   # {file.remark}'
    yield from (f'    {key}: {value}' for key, value in keys.items())
    hints: dict[str, float] = {} if len(file.decays) > 1 else {'initial_angle_deg': 6, 'repeat': 1}
    if not set(QUANTITIES) & set(keys):
        hints['draft_m'] = 0.15
    yield from (f'    # {key}: {value}' for key, value in hints.items() if key not in keys)


def _like_periods(group: list[Seen]) -> list[list[int]]:
    decays = [decay for file in group for decay in file.decays]
    return of_like_periods([segment for segment, _ in decays], [peaks for _, peaks in decays])


def _seen(path: Path) -> Seen:
    """A file's lines above its table, the axis that moves more, and its releases."""
    said = _said_above(path) if path.is_file() else {}
    try:
        trial = read_trial(path)
        motions = [trial.axis(axis) for axis in trial.axes]
        problem = prepare([max(motions, key=lambda motion: float(np.ptp(motion.primary)))])
    except Exception as error:  # noqa: BLE001 - one damaged file must not stop the others; its reason is reported
        return Seen(path, said, fault=str(error))
    decays = [(s, turns_of(m, s)) for s, m in zip(problem.segments, problem.motions, strict=True)]
    return Seen(path, said, problem.axis, decays)


def _said_above(path: Path) -> dict[str, float]:
    """Draft, displacement, speed and angle as lines above a table of text say them."""
    with open(path, 'rb') as file:
        raw = file.read(LINES_ABOVE)
    text = raw.decode('utf-8' if b'\xc2' in raw or b'\xc3' in raw else 'latin-1', errors='ignore')
    found = {}
    for key, (words, units) in _IN_LINES.items():
        unit = '|'.join(sorted(map(re.escape, units), key=len, reverse=True))
        line = rf'^\W*(?:{words})[ _]*[\[(]?({unit})?[\])]?["\s]*[:=;,\t]["\s]*({NUMBER})[\s;,"\[(]*({unit})?(?!\w)'
        if match := re.search(line, text, re.IGNORECASE | re.MULTILINE):
            given = (match[1] or match[3] or '').lower()
            value = float(match[2].replace(',', '.')) * units.get(given, 1.0)
            if given and (value > 0.0 or key == 'speed_m_s'):
                found[key] = value
    return found


def pattern_of_name(name: str) -> str:
    """The pattern that a file's name suggests: numbers beside the words for angle, speed, draft and repeat."""
    stem, dot, ending = name.rpartition('.')
    if not dot:
        stem, ending = name, ''
    for placeholder, place in _IN_NAMES:
        if f'{{{placeholder}}}' in stem or (placeholder == 'draft' and '{draft_factor}' in stem):
            continue
        flags = 0 if placeholder == 'draft_factor' else re.IGNORECASE
        if found := re.search(place, stem, flags):
            named = re.sub(r'[^ _-]+', f'{{{placeholder}}}', found[0])
            stem = f'{stem[: found.start()]}{named}{stem[found.end() :]}'
    return f'{stem}{dot}{ending}'


def _quoted(text: str) -> str:
    return yaml.safe_dump(text, default_style="'", width=1000).strip()


def _may_be_trial(path: Path) -> bool:
    if path.name.startswith('.'):
        return False
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return path.suffix.lower() in ENDINGS
