"""Warnings as values: the core returns them, the callers show them."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Advice:
    """A warning with what to do about it.

    Attributes
    ----------
    code : str
        Stable, machine-readable, kebab-case: ``too-few-cycles``.
    message : str
        One sentence that says what was seen and what to do.
    """

    code: str
    message: str
