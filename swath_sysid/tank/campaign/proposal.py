"""The manifest that is proposed for a folder of trials: from the names, the lines above the tables, and the periods."""

import os
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from swath_sysid.attitude.hull.identified_model import QUANTITIES
from swath_sysid.attitude.identification.peaks import Peaks
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.motion.attitude import in_degrees
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.advice import counted
from swath_sysid.common.errors import InputError, of_file
from swath_sysid.formats.files import write_text
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.registry import ENDINGS
from swath_sysid.tank.campaign.manifest import pattern_expression
from swath_sysid.tank.campaign.names import FROUDE, Meaning, meanings_of, pattern_of
from swath_sysid.tank.campaign.title_block import said_above
from swath_sysid.tank.campaign.trials import of_like_periods, turns_of

#: What must be made of a Froude number.
_OF_FROUDE = 'speed_m_s:   # a Froude number of {value:g}? then {value:g} times the root of 9.81 length_m'
QUESTION = 'Is this what {name} means? Then use the second line in place of the first.'
SEVERAL_DRAFTS = 'The {places} may mean several drafts ({drafts}): trials without a draft in the manifest count as one.'
Mounting = tuple[float, float, float] | None

CONTRADICTION = '  # The periods contradict each other, so these trials are of several drafts: give each its draft_m.'


@dataclass(frozen=True)
class Seen:
    """What is known of a file before anything is fitted."""

    path: Path
    said: dict[str, float]  #: What the lines above its table say, by the key of an entry.
    load_case: str = ''  #: As these lines name it.
    axis: str = ''
    decays: list[tuple[DecaySegment, Peaks]] = field(default_factory=list)
    fault: str = ''  #: Why it cannot be read as it is.

    @property
    def remark(self) -> str:
        """What its releases are, for a comment."""
        case = f', load case {self.load_case}' if self.load_case else ''
        if self.fault:
            return self.fault.replace('\n', ' ') + case
        period = float(np.mean([segment.period for segment, _ in self.decays]))
        return f'{counted(len(self.decays), "release")}, period {period:.3g} s{case}'

    @cached_property
    def stem(self) -> str:
        """The name without its ending."""
        return self.path.name.removesuffix(self.ending)

    @property
    def ending(self) -> str:
        """As of a file; a folder such as ``roll_1.5m_s`` has none."""
        return self.path.suffix if self.path.suffix.lower() in ENDINGS else ''

    @cached_property
    def proposed(self) -> tuple[Meaning, ...]:
        """What its name may mean, where the lines above the table say nothing of it."""
        said = {*self.said, *(QUANTITIES if set(QUANTITIES) & set(self.said) else ())}
        return tuple(each for each in meanings_of(self.stem) if each.key not in said)

    def pattern(self, is_said: bool, fixed: Collection[str] = ()) -> str:
        """The pattern of its name; conditions of these keys, which all names share, stay as they are."""
        varied = tuple(each for each in self.proposed if each.key not in fixed)
        return pattern_of(self.stem, varied, is_said) + self.ending


def new_manifest(
    folder: str | Path, name: str = 'campaign.yaml', at: str | Path | None = None, mounting: Mounting = None
) -> tuple[str, list[str]]:
    """Text of a commented manifest for the trials in a folder, and warnings; with the mounting of the sensor, rad."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f'{folder} is not a folder: give the folder of the trials')
    files = [_seen(p, mounting) for p in sorted(folder.iterdir()) if may_be_trial(p)]
    if not files:
        raise InputError(f'{folder} holds no trial: {", ".join(ENDINGS)} and bag folders were looked for')
    way = '' if at is None else Path(os.path.relpath(os.path.realpath(folder), os.path.realpath(at))).as_posix() + '/'
    way = '' if way == './' else way
    said = _shared([file.said for file in files])
    named = _shared([{each.key: each.value for each in file.proposed if each.is_condition} for file in files])
    unplaced = [file for file in files if not set(QUANTITIES) & set(file.said)]
    are_apart = len(_like_periods(unplaced)) > 1
    warnings = [CONTRADICTION.strip(' #')] if are_apart else []
    warnings += [of_file(file.path, file.remark) for file in files if file.fault]
    drafts = sorted({each.value for f in files for each in f.proposed if each.key in QUANTITIES}, key=str)
    cases = sorted({file.load_case or 'none' for file in files}) if unplaced else []
    for places, found in (('names', drafts), ('load cases', cases)):
        if len(found) > 1:
            warnings.append(SEVERAL_DRAFTS.format(places=places, drafts=', '.join(map(str, found))))
    lines = [f'{key}: {value}   # all files say so' for key, value in said.items()]
    for key, value in named.items():
        lines += [f'# Does {_shown(files[0], key)} in all names mean this?', f'# {_proposal(key, value)}']
    lines += ['trials:', *([CONTRADICTION] if are_apart else [])]
    by_pattern: dict[str, list[Seen]] = {}
    single: list[Seen] = []
    for file in files:
        by_pattern.setdefault(file.pattern(False, named), []).append(file)
    for pattern, group in by_pattern.items():
        full = {file.pattern(True, named) for file in group}
        others = [file.path.name for file in files if file not in group]
        is_one_pattern = len(group) > 1 and len(full) == 1 and '{' in pattern + min(full)
        is_one_pattern &= all(each.is_plain for file in group for each in _varied(file, named))
        is_one_pattern &= len({file.load_case for file in group}) == 1
        is_one_pattern &= not any(set(file.said) - set(said) or (are_apart and file in unplaced) for file in group)
        if not is_one_pattern or any(map(pattern_expression(pattern).fullmatch, others)):
            single += group
            continue
        lines.append(f'  - pattern: {_quoted(way + pattern)}   # {counted(len(group), "file")}')
        if _varied(group[0], named):
            lines.insert(-1, f'  # {QUESTION.format(name=group[0].path.name)}')
            lines.append(f'  # - pattern: {_quoted(way + full.pop())}')
    lines += [line for file in files if file in single for line in _entry(file, said, named, way)]
    axis_named = next((a for a in AXES if any(a in file.path.name.lower() for file in files)), '')
    moving = [file.axis for file in files if file.axis]
    axis = axis_named or max(AXES, key=moving.count) if axis_named or moving else 'pitch'
    head = resources.files(__package__).joinpath('new_manifest.yaml').read_text(encoding='utf-8')
    title = _quoted(folder.resolve().name or 'campaign')
    angles = in_degrees(mounting or (0.0, 0.0, 0.0), 6)
    text = head.format(name=name, title=title, axis=axis, angles=angles, mounting='' if mounting else '# ')
    return text + '\n'.join(lines) + '\n', warnings


def write_new_manifest(folder: str | Path, path: str | Path, mounting: Mounting = None) -> list[str]:
    """Write `new_manifest` to a file that does not exist yet; sentences on what is to be filled in."""
    path = Path(path)
    if path.exists():
        raise InputError(f'{path} exists already: remove it first, or name another file', 'manifest-exists')
    text, warnings = new_manifest(folder, path.name, path.parent, mounting)
    write_text(path, text)
    return warnings


def _shared(values: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What two files or more all say alike."""
    same = dict(set(values[0].items()).intersection(*(each.items() for each in values[1:])))
    return {key: same[key] for key in values[0] if key in same} if len(values) > 1 else {}


def _varied(file: Seen, named: Collection[str]) -> list[Meaning]:
    return [each for each in file.proposed if each.is_condition and each.key not in named]


def _shown(file: Seen, key: str) -> str:
    """The part of a name that a key would be read from, with what stands beside the number."""
    each = next(each for each in file.proposed if each.key == key)
    start, end = (re.search(r'[^\s_-]*$', file.stem[: each.start]), re.search(r'^[^\s_-]*', file.stem[each.end :]))
    return f"'{start[0] if start else ''}{file.stem[each.start : each.end]}{end[0] if end else ''}'"


def _proposal(key: str, value: Any) -> str:
    return _OF_FROUDE.format(value=value) if key == FROUDE else f'{key}: {value}'


def _entry(file: Seen, said: Collection[str], named: Collection[str], way: str) -> Iterator[str]:
    """Lines for one file: what it says, and what its name may mean."""
    yield f'  - file: {_quoted(way + file.path.name)}   # {file.remark}'
    yield from (f'    {key}: {value}' for key, value in file.said.items() if key not in said)
    yield from (f'    axis: {each.value}' for each in file.proposed if each.placeholder == 'axis')
    for each in _varied(file, named):
        yield f'    # {_proposal(each.key, each.value)}   # does {_shown(file, each.key)} mean this?'


def _like_periods(group: list[Seen]) -> list[list[int]]:
    decays = [decay for file in group for decay in file.decays]
    return of_like_periods([segment for segment, _ in decays], [peaks for _, peaks in decays])


def _seen(path: Path, mounting: Mounting) -> Seen:
    """A file's lines above its table, the axis that moves more, and its releases."""
    said, case = ({}, '') if path.is_dir() else said_above(path)
    of_draft = {'draft_m', 'draft_factor'} & {*said, *(each.key for each in meanings_of(path.name))}
    if 'displacement_kg' in said and of_draft:
        # the draft is the loading, and the displacement its mass
        said['mass_kg'] = said.pop('displacement_kg')
    try:
        trial = read_trial(path, mounting=mounting)
        motions = [trial.axis(axis) for axis in trial.axes]
        problem = prepare([max(motions, key=lambda motion: float(np.ptp(motion.primary)))])
    except Exception as error:  # noqa: BLE001 - one damaged file must not stop the others; its reason is reported
        return Seen(path, said, case, fault=str(error))
    decays = [(s, turns_of(m, s)) for s, m in zip(problem.segments, problem.motions, strict=True)]
    return Seen(path, said, case, problem.axis, decays)


def _quoted(text: str) -> str:
    return yaml.safe_dump(text, default_style="'", width=1000).strip()


def may_be_trial(path: Path) -> bool:
    """Whether a file or folder is named as a record is."""
    if path.name.startswith('.'):
        return False
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return path.suffix.lower() in ENDINGS
