"""Warnings as values: the core returns them, the callers show them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Advice:
    """A warning with what to do about it.

    The sentence names neither flags nor parameters: the command line and the nodes add theirs by the code
    (`swath_sysid.cli.advice_words`).
    """

    code: str  #: Stable, machine-readable, kebab-case: ``too-few-cycles``.
    message: str  #: One sentence that says what was seen and what to do.


def counted(number: int, noun: str) -> str:
    """A number with its noun in the singular or plural: ``1 gap``, ``2 gaps``."""
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'
