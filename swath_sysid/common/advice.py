"""Warnings as values: the core returns them, the callers show them; and the catalogue of their sentences.

Those of the core are in sentences.yaml beside this module, those of a wing in its own; flags add to them.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from swath_sysid.common.wings import tables_of_wings, yaml_table

_TABLES: dict[str, dict[str, str]] = yaml_table(Path(__file__).with_name('sentences.yaml'))
for _, _wing in tables_of_wings('sentences.yaml'):
    for _name, _sentences in _wing.items():
        _TABLES[_name] |= _sentences

SENTENCES = _TABLES['sentences']
REFUSALS, FLAGS = _TABLES['refusals'], _TABLES['flags']


@dataclass(frozen=True)
class Advice:
    """A warning with what to do about it.

    The sentence names neither flags nor parameters: the command line adds its own by the code (`FLAGS`).

    Example:
        >>> settings = IdentificationSettings(equation='odd-cubic', objective='one-step')
        >>> found = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')], settings)
        >>> 'one-step-biased' in [advice.code for advice in found.advice]
        True
    """

    code: str  #: Stable, machine-readable, kebab-case: ``too-few-cycles``.
    message: str  #: One sentence that says what was seen and what to do.

    @classmethod
    def of(cls, key: str, **values: object) -> 'Advice':
        """The sentence of the catalogue with this key, its values filled in."""
        return cls(key.partition(':')[0], SENTENCES[key].format(**values))


def with_flags(code: str, message: str) -> str:
    """A sentence with the flags, by its code, that do on the command line what it advises; ``{}`` in a flag stands for
    the list that the sentence gives.
    """
    listed = re.search(r'\[([-\d., ]+)\]', message)
    flag = FLAGS.get(code, '').format(listed[1].replace(' ', '') if listed else '')
    return f'{message} ({flag})' if flag and ('{}' not in FLAGS[code] or listed) else message


def counted(number: int, noun: str) -> str:
    """A number with its noun in the singular or plural: ``1 gap``, ``2 gaps``."""
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`` (did you mean roll?)``, or nothing where no known word is near."""
    near = get_close_matches(word, list(known), 1)
    return f' (did you mean {near[0]}?)' if near else ''
