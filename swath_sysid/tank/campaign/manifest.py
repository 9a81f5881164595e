"""The manifest of a campaign, YAML: which trials, under which conditions, and what to fit.

A fault in one trial leaves that trial out; a fault that concerns all of them is an error.
"""

import os
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.identified_model import QUANTITIES
from swath_sysid.attitude.identification.result import OBJECTIVES
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats import schema
from swath_sysid.formats.files import existing, shown
from swath_sysid.formats.vocabulary import listed_names
from swath_sysid.tank.extinction import TypeB

NUMBER = r'[-+]?\d+(?:[.,]\d+)?'
#: Placeholder of a pattern to the field it fills and what it matches.
PLACEHOLDERS = {
    'angle': ('initial_angle_deg', NUMBER),
    'repeat': ('repeat', r'\d+'),
    'draft_factor': ('draft_factor', NUMBER),
    'draft': ('draft_m', NUMBER),
    'displacement': ('displacement_kg', NUMBER),
    'speed': ('speed_m_s', NUMBER),
    'axis': ('axis', '|'.join(AXES)),
}

#: Of a loading, on pages and in tables.
LOADING_NAMES = {'draft_factor': 'draft factor', 'draft_m': 'draft [m]', 'displacement_kg': 'displacement [kg]'}

#: Ending of a logo to its media type.
PICTURES = {'.png': 'image/png', '.jpg': 'image/jpeg', '.jpeg': 'image/jpeg', '.svg': 'image/svg+xml'}

LARGEST = 1e9  #: Of any number but those of the search: kg, s, m, deg.

#: Given beside a trial; the craft's own values hold at the design draft alone.
OF_CONDITION = ('mass_kg', 'gm_m', 'inertia_kg_m2')
#: Given beside a trial, or once for all of which nothing else is said.
FOR_ALL = ('axis', 'columns', 'mounting_deg', 'speed_m_s', 'initial_angle_deg', *QUANTITIES, *OF_CONDITION)

_NAME = schema.text(1000)
_NUMBER = schema.number(-LARGEST, LARGEST)
_POSITIVE = schema.number(above=0.0, highest=LARGEST)
_MOUNTING = schema.list_of(schema.number(-180.0, 180.0), 3)  # roll, pitch, yaw
Name = Annotated[str, _NAME]
Positive = Annotated[float, _POSITIVE]


def _columns(value: Any, where: str) -> tuple[tuple[str, str], ...]:
    """Columns by the quantity that they hold, as pairs, which can be compared."""
    return tuple(
        (quantity, _NAME(column, f'{where}, {quantity}')) for quantity, column in schema.mapping(value, where).items()
    )


def _picture(value: Any, where: str) -> Path:
    """A picture that a page can hold; its content is looked at where it is read."""
    path = Path(_NAME(value, where))
    if path.suffix.lower() not in PICTURES:
        raise InputError(f"{where}: '{shown(value)}' is no picture: give one that ends in {', '.join(PICTURES)}")
    return path


#: What an entry may say.
_TRIAL = schema.named(
    {
        'file': _NAME,
        'pattern': _NAME,
        'axis': schema.one_of(AXES, 'axis'),
        **dict.fromkeys(QUANTITIES, _POSITIVE),
        **dict.fromkeys(OF_CONDITION, _POSITIVE),
        'speed_m_s': schema.number(0.0, LARGEST),
        'initial_angle_deg': _NUMBER,
        'repeat': schema.whole(1),
        'start_s': _NUMBER,
        'end_s': _NUMBER,
        'frame': schema.one_of(('flu', 'frd'), 'frame'),
        'mounting_deg': _MOUNTING,
        'topic': _NAME,
        'columns': _columns,
    }
)


@dataclass(frozen=True)
class Craft:
    """Particulars of the craft; what is not known is None. Mass and heights are those at the design draft."""

    name: Name = 'the craft'
    length_m: Positive | None = None
    beam_m: Positive | None = None
    depth_m: Positive | None = None
    draft_m: Positive | None = None  #: Design draft, to which draft factors refer.
    displacement_kg: Positive | None = None
    kg_m: Positive | None = None  #: Height of the centre of gravity above the keel.
    gm_transverse_m: Positive | None = None
    gm_longitudinal_m: Positive | None = None
    gyradius_m: Positive | None = None
    inertia_kg_m2: Positive | None = None  #: About the axis of the trials, with added inertia.
    water_density_kg_m3: Positive | None = None
    water_temperature_c: Annotated[float, _NUMBER] | None = None
    appendages: Name | None = None
    basin: Name | None = None

    def design_loading(self, quantity: str) -> float | None:
        """The loading at the design draft, in one of ``QUANTITIES``."""
        return {'draft_factor': 1.0, 'draft_m': self.draft_m, 'displacement_kg': self.displacement_kg}[quantity]


@dataclass(frozen=True)
class TitleBlock:
    """What the cover of the report says beside the craft; what is not given is None."""

    client: Name | None = None
    tank: Name | None = None
    date: Name | None = None
    author: Name | None = None
    test_numbers: Name | None = None
    scale: Name | None = None  #: Of the model, as in ``1:25``.
    logo: Annotated[Path, _picture] | None = None  #: Of a picture; in a manifest relative to its folder.


@dataclass(frozen=True)
class PredictedDamping:
    """Equivalent damping predicted by other means, as N m s or as a ratio; loading or axis None: for any."""

    method: Name
    amplitude_deg: Positive
    damping_n_m_s: Positive | None = None
    damping_ratio: Positive | None = None
    loading: Positive | None = None
    axis: Annotated[str, schema.one_of(AXES, 'axis')] | None = None

    def __post_init__(self) -> None:
        if (self.damping_n_m_s is None) == (self.damping_ratio is None):
            raise InputError('it needs damping_n_m_s or damping_ratio, and only one of them')


@dataclass(frozen=True)
class TrialEntry:
    """One trial of the manifest; what it does not say is None."""

    path: Path
    where: str  #: Its entry: ``trials, 3`` for the third.
    axis: str
    loading: tuple[str, float] | None = None  #: Quantity, one of ``QUANTITIES``, and value.
    initial_angle_deg: float | None = None
    repeat: int | None = None
    start: float | None = None  #: Of the decay, s.
    end: float | None = None
    frame: str | None = None
    mounting_deg: tuple[float, float, float] | None = None  #: Roll, pitch, yaw of the sensor.
    topic: str | None = None
    columns: tuple[tuple[str, str], ...] = ()  #: Quantities with the columns that hold them.
    speed_m_s: float | None = None
    mass_kg: float | None = None
    gm_m: float | None = None
    inertia_kg_m2: float | None = None


@dataclass(frozen=True)
class Manifest:
    """A campaign as it was asked for."""

    title: str
    craft: Craft
    trials: tuple[TrialEntry, ...]
    equations: tuple[str, ...] = ()  #: Names; empty: what the records show of the general hull.
    objectives: tuple[str, ...] = (OBJECTIVES[0],)
    search: SearchSettings = field(default_factory=SearchSettings)
    uncertainty: TypeB = field(default_factory=TypeB)
    predictions: tuple[PredictedDamping, ...] = ()
    title_block: TitleBlock = field(default_factory=TitleBlock)
    faults: tuple[str, ...] = ()  #: What was left out, and why.


def _single(value: Any, where: str) -> Any:
    if isinstance(value, dict | list):
        raise InputError(f'{where}: one value is expected here, not a list or a mapping')
    return shown(value) if isinstance(value, str) else value


def _equation(value: Any, where: str) -> str:
    schema.built(lambda: equation_named(shown(value)), where)
    return str(value)


#: What a manifest may say beside its trials.
_CAMPAIGN = schema.named(
    {
        'title': _NAME,
        'craft': schema.record(Craft),
        'report': schema.record(TitleBlock),
        'axis': schema.one_of(AXES, 'axis'),
        'columns': _columns,
        'mounting_deg': _MOUNTING,
        'speed_m_s': schema.number(0.0, LARGEST),
        'initial_angle_deg': _NUMBER,
        **dict.fromkeys((*QUANTITIES, *OF_CONDITION), _POSITIVE),
        'equations': schema.one_or_more(_equation),
        'objectives': schema.one_or_more(schema.one_of(OBJECTIVES, 'objective')),
        'search': schema.record(SearchSettings, **{each.name: _single for each in fields(SearchSettings)}),
        'trials': schema.anything,
        'uncertainty': schema.record(TypeB, **{each.name: schema.number(0.0, 1.0) for each in fields(TypeB)}),
        'predictions': schema.one_or_more(schema.record(PredictedDamping)),
    }
)


def read_manifest(path: str | Path) -> Manifest:
    """Read a manifest, with the faults of what was left out; paths are relative to its folder."""
    path = Path(path)
    content = schema.plain_content(schema.text_of(path, 'manifest'), str(path))
    if not isinstance(content, dict):
        raise InputError(
            f"{path} is not a manifest: it must hold 'trials:'; begin with one that is made for a folder of trials",
            'not-a-manifest',
        )
    entries = content.pop('trials', None)
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{path}: 'trials:' must list at least one entry with 'file:' or 'pattern:'")
    plain = _CAMPAIGN(content, str(path))
    faults: list[str] = []
    trials: list[TrialEntry] = []
    usual = {key: plain[key] for key in FOR_ALL if key in plain}
    for place, entry in enumerate(entries, 1):
        try:
            trials += _trials_of(entry, f'trials, {place}', path.parent, usual, faults)
        except InputError as error:
            faults.append(str(error))
    if not trials:
        raise InputError(f'{path}: no trial is left to use: {first_of(faults)}')
    craft, block = plain.get('craft', Craft()), plain.get('report', TitleBlock())
    if block.logo is not None:
        block = replace(
            block, logo=existing(path.parent / block.logo, f'the logo {block.logo}, relative to the manifest')
        )
    # ranking, schedule and forecasts rest on the simulation objective, so that it is never left out
    objectives = {OBJECTIVES[0], *plain.get('objectives', ())}
    return Manifest(
        title=plain.get('title', craft.name),
        craft=craft,
        trials=tuple(trials),
        equations=tuple(dict.fromkeys(plain.get('equations', ()))),
        objectives=tuple(o for o in OBJECTIVES if o in objectives),
        search=plain.get('search', SearchSettings()),
        uncertainty=plain.get('uncertainty', TypeB()),
        predictions=tuple(plain.get('predictions', ())),
        title_block=block,
        faults=tuple(faults),
    )


def loading_in_words(quantity: str, value: float) -> str:
    """A loading with its name and unit: ``draft 0.15 m``."""
    name, _, unit = LOADING_NAMES[quantity].partition(' [')
    return f'{name} {value:g} {unit.rstrip("]")}'.rstrip()


def first_of(reasons: Sequence[str]) -> str:
    """The first of several reasons, and how many more there are."""
    return reasons[0] + (f' (and {len(reasons) - 1} more)' if len(reasons) > 1 else '')


def _trials_of(entry: Any, where: str, folder: Path, usual: dict, faults: list[str]) -> list[TrialEntry]:
    """The trials of one entry: one file, or all files of a pattern but those that become faults."""
    given = _TRIAL(entry, where)
    if ('file' in given) == ('pattern' in given):
        raise InputError(f"{where}: a trial is given by either 'file:' or 'pattern:'")
    if 'start_s' in given and 'end_s' in given and not given['start_s'] < given['end_s']:
        raise InputError(f'{where}: start_s must lie before end_s')
    if 'file' in given:
        name = given.pop('file')
        path = schema.built(lambda: existing(folder / name, f'{shown(name)}, relative to the manifest'), where)
        return [_trial(path, usual, given, {}, where)]
    pattern, trials = given.pop('pattern'), []
    for path, matched in schema.built(lambda: _matches(pattern, folder), where):
        try:
            trials.append(_trial(path, usual, given, matched, where))
        except InputError as error:
            faults.append(str(error))
    return trials


def _trial(path: Path, usual: dict, given: dict, matched: dict, where: str) -> TrialEntry:
    twice = sorted(set(given) & set(matched) - {'axis'})
    if twice:
        raise InputError(f"{where}: '{twice[0]}' is given both by the pattern and beside it: leave one out")
    own = given | matched
    # one loading, in whatever quantity
    named = {*own, *(QUANTITIES if set(QUANTITIES) & set(own) else ())}
    own |= {key: value for key, value in usual.items() if key not in named}
    columns, mounting = own.pop('columns', ()), own.pop('mounting_deg', None)
    values = _TRIAL(own, f'{where}, {path.name}')
    loadings = [(quantity, values.pop(quantity)) for quantity in QUANTITIES if quantity in values]
    if len(loadings) > 1:
        raise InputError(f'{where}: give one of {", ".join(QUANTITIES)} for {path.name}, not {len(loadings)}')
    if 'axis' not in values:
        raise InputError(
            f"{where}: no axis is given for {path.name}: write 'axis: pitch' or 'axis: roll' here or for all"
        )
    names = {'start_s': 'start', 'end_s': 'end'}
    return TrialEntry(
        path,
        where,
        loading=loadings[0] if loadings else None,
        columns=columns,
        mounting_deg=mounting,
        **{names.get(key, key): value for key, value in values.items()},
    )


def pattern_expression(pattern: str) -> re.Pattern:
    """Regular expression of a pattern with placeholders and the wildcards ``*`` and ``?``."""
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


def values_in_name(pattern: str, name: str) -> dict[str, Any]:
    """What a file's name says by a pattern that it matches, by the key of an entry."""
    match = pattern_expression(pattern).fullmatch(name)
    return _values_of(match, name) if match else {}


def _values_of(match: re.Match, name: str) -> dict[str, Any]:
    said = match.groupdict().items()
    return {PLACEHOLDERS[key][0]: schema.plain_content(text.replace(',', '.'), name) for key, text in said}


def _matches(pattern: str, folder: Path) -> list[tuple[Path, dict]]:
    """Files that a pattern matches, with what their names say."""
    if '**' in pattern:
        raise InputError(f"the pattern '{shown(pattern)}' holds **: write * for each folder")
    base = Path(pattern).anchor
    root = Path(base) if base else folder
    relative = os.path.normpath(pattern[len(base) :])
    if relative == '.':
        raise InputError(f"the pattern '{shown(pattern)}' names no file: write one such as decay_{{draft}}_*.csv")
    expression = pattern_expression(relative)
    glob = re.sub(r'(\{[^{}]*\}|\*)+', '*', relative)
    try:
        candidates = sorted(root.glob(glob))
    except (ValueError, RecursionError, OSError) as error:
        raise InputError(f"'{shown(pattern)}' is not a pattern: {shown(error)}") from error
    found = []
    for path in candidates:
        if match := expression.fullmatch(Path(os.path.relpath(path, root)).as_posix()):
            found.append((path, _values_of(match, path.name)))
    if not found:
        parent = root / Path(glob).parent
        names = sorted(p.name for p in parent.iterdir() if not p.name.startswith('.')) if parent.is_dir() else []
        there = f'there are {listed_names(names)}' if names else f'the folder {parent} is empty or does not exist'
        raise InputError(f"no file matches '{shown(pattern)}' ({there}): check the folder and the placeholders")
    return found


def trials_in_words(path: str) -> tuple[list[dict[str, Any]], list[str]]:
    """The present trials of a campaign, as rows, and the missing ones, as sentences."""
    try:
        manifest = read_manifest(path)
    except InputError as error:
        return [], [str(error)]
    # a trial that is listed twice is no repeat
    entries = {(entry.path.resolve(), entry.axis, entry.start, entry.end): entry for entry in manifest.trials}
    rows = [
        {
            'file': entry.path.name,
            'axis': entry.axis,
            'loading': '' if entry.loading is None else f'{entry.loading[0]} {entry.loading[1]:g}',
            'angle': '' if entry.initial_angle_deg is None else f'{entry.initial_angle_deg:g} deg',
        }
        for entry in entries.values()
    ]
    repeats = Counter((row['axis'], row['loading'], row['angle']) for row in rows)
    most = max(repeats.values())
    missing = [
        f'{" ".join(filter(None, condition))}: {count} of {most} repeats'
        for condition, count in repeats.items()
        if count < most
    ]
    return rows, [*manifest.faults, *missing]
