"""The verdict on a fit: the frame that every verdict shares, and how a model that was judged carries it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Self

from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import ADEQUATE, LEVELS

#: A warning of a fit, after the level to which it lowers the verdict; `ADEQUATE`: it leaves the verdict as it is.
Finding = tuple[str, Advice]


@dataclass(frozen=True)
class Judgement:
    """A verdict."""

    level: str  #: ``adequate``, ``doubtful`` or ``rejected``.
    code: str  #: The cause, kebab-case.
    sentence: str  #: Cause and remedy.

    @classmethod
    def by_gravest(cls, findings: Iterable[Finding], *more: Any) -> Self:
        """The verdict by the first of the gravest findings, and what else the verdict holds."""
        level, cause = min(findings, key=lambda each: LEVELS.index(each[0]))
        return cls(level, cause.code, cause.message, *more)

    def __str__(self):
        return f'{self.level}: {self.sentence}'

    @property
    def warnings(self) -> tuple[Advice, ...]:
        """The verdict as a warning; empty where the fit is adequate."""
        return () if self.level == ADEQUATE else (Advice(self.code, str(self)),)

    @property
    def metrics(self) -> dict[str, Any]:
        """As model files hold it."""
        return {'verdict': self.level, 'verdict_code': self.code, 'verdict_sentence': self.sentence}


class Judged:
    """A model whose metrics hold the verdict on its fit."""

    metrics: dict

    @property
    def verdict(self) -> str:
        """``adequate``, ``doubtful`` or ``rejected``; empty where it is not known."""
        return str(self.metrics.get('verdict', ''))

    @property
    def verdict_sentence(self) -> str:
        """Cause and remedy; empty where they are not known."""
        return str(self.metrics.get('verdict_sentence', ''))
