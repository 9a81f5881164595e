"""The manifest of a campaign: which trials, under which conditions, and what to fit; YAML.

Whatever is wrong is named with its line. What is wrong with one trial leaves that trial out; the
others are kept, because a campaign shall not stop at one bad entry.
"""

import difflib
import os
import re
from dataclasses import dataclass, field, fields
from pathlib import Path

import yaml

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.scheduled_model import QUANTITIES
from swath_sysid.attitude.identification.identify import OBJECTIVES
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.untrusted_yaml import parsed, scalar_value, shown, text_of

NUMBER = r'[-+]?\d+(?:[.,]\d+)?'
PLACEHOLDERS = {
    'angle': ('initial_angle_deg', NUMBER),
    'repeat': ('repeat', r'\d+'),
    'draft_factor': ('draft_factor', NUMBER),
    'draft': ('draft_m', NUMBER),
    'displacement': ('displacement_kg', NUMBER),
    'axis': ('axis', '|'.join(AXES)),
}
"""Placeholder of a pattern to the field it fills and what it matches."""

CAMPAIGN_KEYS = ('title', 'craft', 'axis', 'equations', 'objectives', 'search', 'trials')
SEARCH_KEYS = tuple(f.name for f in fields(SearchSettings))
TRIAL_KEYS = (
    'file',
    'pattern',
    'axis',
    *QUANTITIES,
    'initial_angle_deg',
    'repeat',
    'start_s',
    'end_s',
    'frame',
    'topic',
)
FRAMES = ('flu', 'frd')
SHOWN_FILES = 3
LARGEST = 1e9
"""Of any number but those of the search: kg, s, m, deg."""

LONGEST_WORD = 40
LONGEST_TEXT = 1000
"""Characters; of a title, a file's name with its folders, a pattern."""


@dataclass(frozen=True)
class Craft:
    """Particulars of the craft; what is not known is None.

    Attributes
    ----------
    name : str
    length_m, beam_m, depth_m : float or None
    draft_m : float or None
        Design draft, to which draft factors refer.
    displacement_kg : float or None
        At the design draft.
    """

    name: str = 'the craft'
    length_m: float | None = None
    beam_m: float | None = None
    depth_m: float | None = None
    draft_m: float | None = None
    displacement_kg: float | None = None


CRAFT_KEYS = tuple(f.name for f in fields(Craft))


@dataclass(frozen=True)
class Fault:
    """Something wrong in the manifest.

    Attributes
    ----------
    line : int
        From 1; 0 where it has no line.
    message : str
        What is wrong and what to do.
    """

    line: int
    message: str

    def __str__(self):
        return f'line {self.line}: {self.message}' if self.line else self.message


@dataclass(frozen=True)
class TrialEntry:
    """One trial of the manifest; what it does not say is None.

    Attributes
    ----------
    path : Path
    line : int
        Of the entry in the manifest.
    axis : str
    loading : tuple of str and float, or None
        Quantity, one of ``QUANTITIES``, and value.
    initial_angle_deg : float or None
    repeat : int or None
    start, end : float or None
        Bounds of the decay, s.
    frame, topic : str or None
    """

    path: Path
    line: int
    axis: str
    loading: tuple[str, float] | None = None
    initial_angle_deg: float | None = None
    repeat: int | None = None
    start: float | None = None
    end: float | None = None
    frame: str | None = None
    topic: str | None = None


@dataclass(frozen=True)
class Manifest:
    """A campaign as it was asked for.

    Attributes
    ----------
    title : str
    craft : Craft
    trials : tuple of TrialEntry
    equations : tuple of str
        Names; empty: those of each axis.
    objectives : tuple of str
    search : SearchSettings
    faults : tuple of Fault
        What was left out, and why.
    """

    title: str
    craft: Craft
    trials: tuple[TrialEntry, ...]
    equations: tuple[str, ...] = ()
    objectives: tuple[str, ...] = (OBJECTIVES[0],)
    search: SearchSettings = field(default_factory=SearchSettings)
    faults: tuple[Fault, ...] = ()


class _Faulty(Exception):  # noqa: N818 - carries a fault to where the entry is left out
    def __init__(self, line, message):
        super().__init__(message)
        self.fault = Fault(line, message)


@dataclass(frozen=True)
class _Value:
    """A plain value with the line it stands on."""

    value: object
    line: int


def read_manifest(path):
    """Read a manifest.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Manifest
        With the faults of what was left out. Paths are relative to the manifest's folder.

    Raises
    ------
    InputError
        It cannot be read, is not YAML, its search or objectives cannot be used, or no trial is left.
    """
    path = Path(path)
    root = parsed(text_of(path, 'manifest'), str(path))
    if not isinstance(root, yaml.MappingNode):
        raise InputError(
            f"{path} is no manifest: it must hold 'trials:' (start one with swath-sysid campaign --new FOLDER)"
        )
    try:
        return _manifest_of(root, path)
    except _Faulty as found:
        raise InputError(f'{path}, {found.fault}') from found


def _manifest_of(root, path):
    faults = []
    plain = _mapping(root, CAMPAIGN_KEYS, 'a campaign', faults)
    axis = _axis(plain['axis']) if 'axis' in plain else None
    trials_node = plain.get('trials')
    if trials_node is None or not isinstance(trials_node, yaml.SequenceNode) or not trials_node.value:
        line = trials_node.start_mark.line + 1 if trials_node is not None else 1
        raise _Faulty(line, "'trials:' must list at least one entry with 'file:' or 'pattern:'")
    trials = []
    for node in trials_node.value:
        try:
            trials.extend(_entries(node, path.parent, axis, faults))
        except _Faulty as found:
            faults.append(found.fault)
    trials = _without_duplicates(trials, faults)
    if not trials:
        told = '; '.join(str(f) for f in faults[:SHOWN_FILES])
        raise InputError(f'{path}: no trial is left to use: {told}')
    craft = _craft(plain.get('craft'), faults)
    return Manifest(
        title=_text(plain['title']) if 'title' in plain else craft.name,
        craft=craft,
        trials=tuple(trials),
        equations=_equations(plain.get('equations'), faults),
        objectives=_objectives(plain.get('objectives')),
        search=_search(plain.get('search'), faults),
        faults=tuple(faults),
    )


def _line(node):
    return node.start_mark.line + 1


def _mapping(node, keys, what, faults):
    """Key to value node; unknown and doubled keys become faults, or `_Faulty` where faults is None."""
    if not isinstance(node, yaml.MappingNode):
        raise _Faulty(_line(node), f'{what} must be written as keys and values; keys are {", ".join(keys)}')
    found = {}
    for key_node, value_node in node.value:
        key = key_node.value if isinstance(key_node, yaml.ScalarNode) else '[...]'
        wrong = None
        if key not in keys:
            wrong = f"{what} has no key '{shown(key)}': {_nearest(key, keys)}keys are {', '.join(keys)}"
        elif key in found:
            wrong = f"'{key}' is given twice: leave one out"
        if wrong is None:
            found[key] = value_node
        elif faults is None:
            raise _Faulty(_line(key_node), wrong)
        else:
            faults.append(Fault(_line(key_node), f'{wrong}; it is ignored'))
    return found


def _nearest(word, known):
    # the search takes time by the length of the word
    close = difflib.get_close_matches(word[:LONGEST_WORD], known, 1)
    return f"'{close[0]}' is meant? " if close else ''


def _scalar(node):
    if not isinstance(node, yaml.ScalarNode):
        raise _Faulty(_line(node), 'one value is expected here, not a list or a mapping')
    try:
        return _Value(scalar_value(node), _line(node))
    except InputError as error:
        raise _Faulty(_line(node), str(error)) from error


def _number(node, name, positive=False):
    item = _scalar(node)
    if isinstance(item.value, bool) or not isinstance(item.value, int | float):
        raise _Faulty(item.line, f"{name} must be a number, not '{shown(item.value)}'")
    if not abs(item.value) <= LARGEST:
        raise _Faulty(item.line, f'{name} of {item.value:g} is no measure of a trial: it is at most {LARGEST:g}')
    if positive and not item.value > 0:
        raise _Faulty(item.line, f'{name} must be greater than zero')
    return float(item.value)


def _text(node):
    """As it is written: a file may be called 007."""
    _scalar(node)
    if not node.value or len(node.value) > LONGEST_TEXT or not node.value.isprintable():
        raise _Faulty(_line(node), f"'{shown(node.value)}' is no name: 1 to {LONGEST_TEXT} characters on one line")
    return node.value


def _axis(node):
    item = _scalar(node)
    if item.value not in AXES:
        raise _Faulty(item.line, f"there is no axis '{shown(item.value)}': choose {' or '.join(AXES)}")
    return item.value


def _craft(node, faults):
    if node is None:
        return Craft()
    found = _mapping(node, CRAFT_KEYS, 'craft', faults)
    name = _text(found['name']) if 'name' in found else Craft.name
    return Craft(name, **{key: _number(value, key, positive=True) for key, value in found.items() if key != 'name'})


def _items(node, name):
    if isinstance(node, yaml.ScalarNode):
        return [_scalar(node)]
    if not isinstance(node, yaml.SequenceNode) or not node.value:
        raise _Faulty(_line(node), f'{name} must be a list of names')
    return [_scalar(item) for item in node.value]


def _equations(node, faults):
    if node is None:
        return ()
    names = []
    for item in _items(node, 'equations'):
        try:
            equation_named(shown(item.value))
        except InputError as error:
            faults.append(Fault(item.line, f'{error}; it is left out'))
            continue
        if item.value in names:
            faults.append(Fault(item.line, f"the equation '{shown(item.value)}' is named twice: leave one out"))
        else:
            names.append(str(item.value))
    if not names:
        raise _Faulty(_line(node), 'none of the equations can be used: correct their names, or leave the key out')
    return tuple(names)


def _objectives(node):
    if node is None:
        return (OBJECTIVES[0],)
    items = _items(node, 'objectives')
    for item in items:
        if item.value not in OBJECTIVES:
            named = shown(item.value)
            raise _Faulty(item.line, f"there is no objective '{named}': choose from {', '.join(OBJECTIVES)}")
    # ranking, schedule and forecasts rest on the simulation objective, so that it is never left out
    return tuple(o for o in OBJECTIVES if o == OBJECTIVES[0] or o in {item.value for item in items})


def _search(node, faults):
    if node is None:
        return SearchSettings()
    found = _mapping(node, SEARCH_KEYS, 'search', faults)
    values = {}
    for key, value_node in found.items():
        value = _scalar(value_node).value
        values[key] = shown(value) if isinstance(value, str) else value
        # each alone first, so that the line is that of the key
        _search_settings({key: values[key]}, value_node)
    return _search_settings(values, node)


def _search_settings(values, node):
    try:
        return SearchSettings(**values)
    except InputError as error:
        raise _Faulty(_line(node), str(error)) from error


def _entries(node, folder, default_axis, faults):
    """The trials of one entry: one file, or all files of a pattern."""
    found = _mapping(node, TRIAL_KEYS, 'a trial', None)
    if ('file' in found) == ('pattern' in found):
        raise _Faulty(_line(node), "a trial is given by either 'file:' or 'pattern:'")
    line = _line(node)
    shared = {'line': line, 'axis': _axis(found['axis']) if 'axis' in found else default_axis}
    for key, name in (('start_s', 'start'), ('end_s', 'end')):
        if key in found:
            shared[name] = _number(found[key], key)
    if 'start' in shared and 'end' in shared and not shared['start'] < shared['end']:
        raise _Faulty(line, 'start_s must lie before end_s')
    if 'frame' in found:
        shared['frame'] = frame = _text(found['frame'])
        if frame not in FRAMES:
            raise _Faulty(_line(found['frame']), f"there is no frame '{shown(frame)}': choose {' or '.join(FRAMES)}")
    if 'topic' in found:
        shared['topic'] = _text(found['topic'])
    given = {
        key: _number(found[key], key, positive=key in QUANTITIES)
        for key in (*QUANTITIES, 'initial_angle_deg', 'repeat')
        if key in found
    }
    if 'file' in found:
        name = _text(found['file'])
        path = folder / name
        # not Path.exists, which raises an error for a name that is too long
        if not os.path.exists(path):
            raise _Faulty(
                _line(found['file']),
                f"there is no file '{shown(name)}': check the name, it is relative to the manifest",
            )
        return [_entry(path, shared, given, {})]
    entries = []
    for path, matched in _matches(found['pattern'], folder):
        try:
            entries.append(_entry(path, shared, given, matched))
        except _Faulty as one:
            faults.append(one.fault)
    return entries


def _entry(path, shared, given, matched):
    line = shared['line']
    twice = sorted(set(given) & set(matched))
    if twice:
        raise _Faulty(line, f"'{twice[0]}' is given both by the pattern and beside it: leave one out")
    values = given | {key: value for key, value in matched.items() if key != 'axis'}
    loadings = [(quantity, values[quantity]) for quantity in QUANTITIES if quantity in values]
    if len(loadings) > 1:
        raise _Faulty(line, f'give one of {", ".join(QUANTITIES)} for {path.name}, not {len(loadings)}')
    axis = matched.get('axis', shared['axis'])
    if axis is None:
        raise _Faulty(
            line,
            f"no axis is given for {path.name}: write 'axis: pitch' or 'axis: roll' here or for the whole campaign",
        )
    repeat = values.get('repeat')
    if repeat is not None and (repeat != int(repeat) or repeat < 1):
        raise _Faulty(line, f'repeat must be a whole number from 1, not {repeat:g}')
    return TrialEntry(
        path=path,
        loading=loadings[0] if loadings else None,
        initial_angle_deg=values.get('initial_angle_deg'),
        repeat=None if repeat is None else int(repeat),
        **(shared | {'axis': axis}),
    )


def pattern_expression(pattern):
    """Regular expression of a pattern with placeholders and the wildcards ``*`` and ``?``.

    Raises
    ------
    InputError
        An unknown placeholder, or one used twice.
    """
    parts, used = [], set()
    for piece in re.split(r'(\{[^{}]*\}|\*|\?)', pattern):
        if piece == '*':
            parts.append('[^/]*')
        elif piece == '?':
            parts.append('[^/]')
        elif piece.startswith('{') and piece.endswith('}'):
            name = piece[1:-1]
            if name not in PLACEHOLDERS:
                known = ', '.join(f'{{{n}}}' for n in PLACEHOLDERS)
                raise InputError(f"the pattern has an unknown placeholder '{piece}': use {known}, or * for anything")
            if name in used:
                raise InputError(f"the pattern uses '{piece}' twice: write * for one of them")
            used.add(name)
            parts.append(f'(?P<{name}>{PLACEHOLDERS[name][1]})')
        else:
            parts.append(re.escape(piece))
    return re.compile(''.join(parts))


def _matches(node, folder):
    """Files that a pattern matches, with what their names say."""
    pattern = _text(node)
    try:
        expression = pattern_expression(pattern)
    except InputError as error:
        raise _Faulty(_line(node), str(error)) from error
    if '**' in pattern:
        raise _Faulty(_line(node), f"the pattern '{shown(pattern)}' holds **: write * for each folder")
    base = Path(pattern).anchor
    root = Path(base) if base else folder
    relative = pattern[len(base) :]
    expression = pattern_expression(relative)
    glob = re.sub(r'\{[^{}]*\}', '*', relative)
    try:
        candidates = sorted(root.glob(glob))
    except (ValueError, NotImplementedError, OSError) as error:
        raise _Faulty(_line(node), f"'{shown(pattern)}' is no pattern: {shown(error)}") from error
    found = []
    for path in candidates:
        match = expression.fullmatch(_relative(path, root, relative))
        if match:
            said = {PLACEHOLDERS[name][0]: text for name, text in match.groupdict().items()}
            found.append((path, {k: v if k == 'axis' else float(v.replace(',', '.')) for k, v in said.items()}))
    if not found:
        parent = root / Path(glob).parent
        near = (
            sorted(p.name for p in parent.iterdir() if not p.name.startswith('.'))[:SHOWN_FILES]
            if parent.is_dir()
            else []
        )
        there = f'there are {", ".join(near)}, ...' if near else f'the folder {parent} is empty or does not exist'
        raise _Faulty(_line(node), f"no file matches '{pattern}' ({there}): check the folder and the placeholders")
    return found


def _relative(path, root, pattern):
    """The path as the pattern writes it, which may climb with ``..``."""
    text = path.as_posix()
    start = root.as_posix()
    if start not in ('.', '') and text.startswith(start):
        text = text[len(start) :].lstrip('/')
    return text.removeprefix('./') if not pattern.startswith('./') else f'./{text.removeprefix("./")}'


def _without_duplicates(trials, faults):
    kept, by_file, by_condition = [], {}, {}
    for trial in trials:
        file = (trial.path.resolve(), trial.axis, trial.start, trial.end)
        complete = None not in (trial.initial_angle_deg, trial.repeat)
        condition = (trial.axis, trial.loading, trial.initial_angle_deg, trial.repeat) if complete else None
        if file in by_file:
            faults.append(
                Fault(
                    trial.line,
                    f'{trial.path.name} is already given in line {by_file[file]}: it would count twice, name it once',
                )
            )
        elif condition is not None and condition in by_condition:
            other = by_condition[condition]
            faults.append(
                Fault(
                    trial.line,
                    f'{trial.path.name} has the same condition and repeat as {other.path.name} (line {other.line}): '
                    'give it another repeat',
                )
            )
        else:
            by_file[file] = trial.line
            if condition is not None:
                by_condition[condition] = trial
            kept.append(trial)
    return kept


HEAD = """\
# A campaign of free-decay trials for: swath-sysid campaign {name} --output FOLDER
title: {title}

# Particulars; leave out what is not known. Draft factors refer to draft_m.
craft:
  name: {title}
  # length_m: 1.26
  # beam_m: 0.6
  # depth_m: 0.37
  # draft_m: 0.154
  # displacement_kg: 30

axis: {axis}

# Equations to compare; without this key all published for the axis, and our own. Compositions are written
# 'linear,quadratic|linear,cubic', and '+friction' adds dry friction.
# equations: [linear, odd-cubic, odd-cubic+friction]

# The simulated motion is always fitted; one-step adds the objective of the papers, biased under noise, for comparison.
# objectives: [simulation, one-step]

# search: {{algorithm: ga, preset: swath-pitch, seed: 1}}

# Each entry names one file, or by a pattern many. Placeholders: {{angle}} initial angle in deg, {{repeat}},
# {{draft_factor}}, {{draft}} in m, {{displacement}} in kg, {{axis}}; * is anything. What the names do not say is given
# beside: draft_factor (or draft_m, displacement_kg), initial_angle_deg, repeat, axis, start_s, end_s, frame, topic.
trials:
"""


def new_manifest(folder, axis='pitch', name='campaign.yaml', at=None):
    """Text of a commented manifest for the trials in a folder.

    Parameters
    ----------
    folder : str or Path
    axis : str
        Where the names do not say it.
    name : str
        File name of the manifest, for its first line.
    at : str or Path, optional
        The folder the manifest is to stand in, to which its paths are relative; by default that of the trials.

    Returns
    -------
    str

    Raises
    ------
    InputError
        No folder, or nothing in it that could be a trial.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f'{folder} is no folder: give the folder of the trials')
    files = [p for p in sorted(folder.iterdir()) if _may_be_trial(p)]
    if not files:
        raise InputError(f'{folder} holds no trial: CSV files, bags or MTi exports (.txt) were looked for')
    by_pattern = {}
    for file in files:
        by_pattern.setdefault(pattern_of_name(file.name), []).append(file.name)
    way = '' if at is None else Path(os.path.relpath(os.path.realpath(folder), os.path.realpath(at))).as_posix() + '/'
    way = '' if way == './' else way
    lines = []
    for pattern, names in by_pattern.items():
        if '{' in pattern and len(names) > 1:
            lines.append(f'  - pattern: {_quoted(way + pattern)}   # {len(names)} files')
        else:
            lines += [_file_entry(way + name) for name in names]
    found_axis = next((a for a in AXES if any(a in file.name.lower() for file in files)), axis)
    return (
        HEAD.format(name=name, title=_quoted(folder.resolve().name or 'campaign'), axis=found_axis)
        + '\n'.join(lines)
        + '\n'
    )


def write_new_manifest(folder, path, axis='pitch'):
    """Write `new_manifest` to a file that does not exist yet.

    Raises
    ------
    InputError
        Also where the file exists.
    """
    path = Path(path)
    if path.exists():
        raise InputError(f'{path} exists already: remove it first, or name another file with --output')
    text = new_manifest(folder, axis, path.name, path.parent)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding='utf-8')


def pattern_of_name(name):
    """The pattern that a file's name suggests: numbers beside the words for angle, repeat and draft."""
    stem, dot, ending = name.rpartition('.')
    if not dot:
        stem, ending = name, ''
    number = r'\d+(?:[.,]\d+)?'
    stem = re.sub(rf'(?<![\d.,]){number}(?=[ _-]?(?:deg|°))', '{angle}', stem, count=1)
    stem = re.sub(rf'(?<![\d.,]){number}(?=[ _-]?T(?![a-z]))', '{draft_factor}', stem, count=1)
    stem = re.sub(rf'(?<![\d.,]){number}(?=[ _-]?kg)', '{displacement}', stem, count=1)
    stem = re.sub(r'((?:repeat|rep|run|trial)[ _-]?)\d+', r'\1{repeat}', stem, count=1, flags=re.IGNORECASE)
    stem = re.sub(r'(?<![a-z])(roll|pitch)(?![a-z])', '{axis}', stem, count=1)
    return f'{stem}{dot}{ending}'


def _file_entry(name):
    return f'  - file: {_quoted(name)}\n    # initial_angle_deg: 6\n    # draft_factor: 1.0\n    # repeat: 1'


def _quoted(text):
    return yaml.safe_dump(text, default_style="'", width=1000).strip()


def _may_be_trial(path):
    if path.name.startswith('.'):
        return False
    if path.is_dir():
        return (path / 'metadata.yaml').is_file()
    return path.suffix.lower() in ('.csv', '.mcap', '.db3', '.txt', '.tsv')
