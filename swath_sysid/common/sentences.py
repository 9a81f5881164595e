"""The catalogue of sentences (sentences.yaml): every warning by its code, and what flags and diagnostics add to it."""

from pathlib import Path

import yaml

_TEXT = Path(__file__).with_suffix('.yaml').read_text(encoding='utf-8')
_TABLES: dict[str, dict[str, str]] = yaml.load(_TEXT, getattr(yaml, 'CSafeLoader', yaml.SafeLoader))

SENTENCES = _TABLES['sentences']
FLAGS = _TABLES['flags']
REASONS = _TABLES['reasons']
CURES = {**REASONS, **_TABLES['states']}


def with_flags(code: str, message: str) -> str:
    """A sentence with the flags, by its code, that do on the command line what it advises."""
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message
