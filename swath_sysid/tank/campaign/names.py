"""What the name of a file may mean: numbers beside a unit or a word. Nothing of it is believed unasked."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from swath_sysid.tank.campaign.manifest import PLACEHOLDERS

LENGTHS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}
KNOT = 1852.0 / 3600.0  #: m/s.
SPEEDS = {'m/s': 1.0, 'm_s': 1.0, 'm-s': 1.0, 'ms': 1.0, 'mps': 1.0, 'kn': KNOT, 'kt': KNOT, 'kts': KNOT, 'knots': KNOT}
STEEPEST = 45.0  #: deg; a larger angle is a heading.
DEEPEST = 2.0  #: m; a longer length is of the model or the tank.
FASTEST_FROUDE = 3.0
FROUDE = 'froude_number'  #: Which no manifest takes: a speed is made of it and of the length.

_NUMBER = r'(?P<n>(?<![\d.,])\d+(?:[.,]\d+)?)'
_SIGNED = r'(?P<n>(?:(?<![^ _=(])[-+])?(?<![\d.,])\d+(?:[.,]\d+)?)'  #: No hyphen after a word.
_GAP = r'[ _=-]?'
_ALONE = r'(?<![a-z\d.,])'  #: No word or number goes on to here.
#: Words before a number with a unit that say it is something else.
_OTHERWISE = re.compile(
    r'(?:(?<![a-z\d])(?:heading|hdg|kurs|course|mu|beta|wave|welle|wind|rudder|ruder|drift|trim|h|hs|lambda|depth|wassertiefe|wd|x|y|z|l|b'
    r'|length|beam|gm|kg|kb|gyr\w*|ballast|[lvt]cg|cog|flap|fin|foil|offset|moved|shift|weights?)|keel)[ _=-]*$',
    re.IGNORECASE,
)
_DRAFT = r'(?:draft|draught|tiefgang)'
#: Placeholder, expression and units, in the order in which they are looked for.
_FORMS: tuple[tuple[str, str, dict[str, float]], ...] = (
    ('angle', rf'(?:{_ALONE}|(?<=phi)|(?<=roll)|(?<=pitch)|(?<=angle)|(?<=winkel)|(?<=heel)|(?<=krängung))'
     rf'{_SIGNED}[ _-]?(?:deg|°|grad)(?![a-z])', {}),
    ('angle', rf'(?:phi|angle|winkel|heel|krängung){_GAP}{_NUMBER}(?![\d.,a-z])', {}),
    ('speed', rf'(?:{_ALONE}|(?<![a-z])[vu]{_GAP}|speed{_GAP}){_NUMBER}[ _-]?'
     r'(?P<u>m[_/-]s|mps|kn|kts?|knots)(?![a-z\d])', SPEEDS),
    ('speed', rf'(?:speed|velocity|geschwindigkeit){_GAP}{_NUMBER}(?![\d.,a-z])', {}),
    (FROUDE, rf'(?<![a-z])(?:fn|fr|froude){_GAP}{_NUMBER}(?![\d.,a-z])', {}),
    ('draft', rf'(?<![a-z])(?:[td]|{_DRAFT}){_GAP}{_NUMBER}[ _-]?(?P<u>[mc]?m)(?![a-z\d/]|[_-]s)', LENGTHS),
    ('draft', rf'(?<![a-z]){_DRAFT}{_GAP}{_NUMBER}(?![\d.,a-z])', {}),
    ('draft_factor', rf'{_ALONE}{_NUMBER}[ _-]?(?-i:T)(?![a-z\d])', {}),
    ('draft', rf'{_ALONE}{_NUMBER}[ _-]?(?P<u>[mc]?m)(?![a-z\d/]|[_-]s)', LENGTHS),
    ('displacement', rf'(?:{_ALONE}|(?<=disp)|(?<=displacement)|(?<=masse)|(?<=mass)){_NUMBER}[ _-]?kg(?![a-z\d])', {}),
    ('repeat', r'(?:repeat|rep|run|trial|test|versuch|wiederholung|wdh|nr|no|(?<![a-z])[vr])[ _-]?[vr]?'
     r'(?P<n>\d+)(?![\d.,]*[a-z\d])', {}),
    ('axis', r'(?<![a-z])(?P<n>roll|pitch)(?![a-z])', {}),
)  # fmt: skip


@dataclass(frozen=True)
class Meaning:
    """What a part of a name may mean."""

    placeholder: str
    start: int
    end: int
    value: float | str  #: In the unit of the manifest.
    is_plain: bool  #: Whether the name gives it in that unit.

    @property
    def key(self) -> str:
        """Of an entry."""
        return PLACEHOLDERS[self.placeholder][0] if self.placeholder in PLACEHOLDERS else self.placeholder

    @property
    def is_condition(self) -> bool:
        """Whether a wrong reading of it would change a result."""
        return self.placeholder not in ('repeat', 'axis')


def meanings_of(stem: str) -> tuple[Meaning, ...]:
    """What a name without its ending may mean, each quantity once, from left to right."""
    found: dict[str, Meaning] = {}
    for meaning in _all_meanings(stem):
        apart = all(meaning.end <= other.start or other.end <= meaning.start for other in found.values())
        is_loading = meaning.placeholder.startswith('draft') and {'draft', 'draft_factor'} & set(found)
        if apart and not is_loading:
            found.setdefault(meaning.placeholder, meaning)
    return tuple(sorted(found.values(), key=lambda each: each.start))


def _all_meanings(stem: str) -> Iterator[Meaning]:
    for placeholder, form, units in _FORMS:
        for match in re.finditer(form, stem, re.IGNORECASE):
            start, end = match.span('n')
            unit = match['u'].lower() if units else ''
            value, is_plain = _value(placeholder, match['n'], units.get(unit, 1.0))
            is_other = placeholder in ('angle', 'draft', 'displacement') and _OTHERWISE.search(stem[: match.start()])
            if value is not None and not is_other:
                yield Meaning(placeholder, start, end, value, is_plain)


def _value(placeholder: str, text: str, scale: float) -> tuple[float | str | None, bool]:
    """The value that a text stands for, None where it cannot, and whether it is written in the manifest's unit."""
    if placeholder == 'axis':
        return text.lower(), True
    value = float(text.replace(',', '.')) * scale
    if placeholder == 'draft' and scale == 1.0 and value >= 10.0:
        value, scale = 1e-3 * value, 1e-3  # no model has a draft of ten metres: written in mm
    largest = {'angle': STEEPEST, 'draft': DEEPEST, FROUDE: FASTEST_FROUDE}.get(placeholder, math.inf)
    may_be = abs(value) <= largest and (value != 0.0 or placeholder in ('speed', FROUDE))
    rounded = int(value) if placeholder == 'repeat' else float(f'{value:.6g}')
    return (rounded if may_be else None), scale == 1.0


def pattern_of(stem: str, meanings: tuple[Meaning, ...], is_said: bool) -> str:
    """The pattern of a name, with placeholders for all it may mean, or with ``*`` for the conditions."""
    parts, at = [], 0
    conditions = any(each.is_condition for each in meanings)
    for each in meanings:
        is_named = each.placeholder in PLACEHOLDERS and each.is_plain
        is_named &= is_said or each.placeholder == 'axis' or not (each.is_condition or conditions)
        parts += [stem[at : each.start], f'{{{each.placeholder}}}' if is_named else '*']
        at = each.end
    return ''.join(parts) + stem[at:]
