"""The catalogue of sentences: every warning by its code, and what flags and diagnostics add to it.

Those of the core are in sentences.yaml beside this module, those of a wing in its own.
"""

from pathlib import Path

from swath_sysid.common.wings import tables_of_wings, yaml_table

_TABLES: dict[str, dict[str, str]] = yaml_table(Path(__file__).with_suffix('.yaml'))
for _, _wing in tables_of_wings('sentences.yaml'):
    for _name, _sentences in _wing.items():
        _TABLES[_name] |= _sentences

SENTENCES = _TABLES['sentences']
FLAGS = _TABLES['flags']
REASONS = _TABLES['reasons']
CURES = {**REASONS, **_TABLES['states']}


def with_flags(code: str, message: str) -> str:
    """A sentence with the flags, by its code, that do on the command line what it advises."""
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message
