"""What was not read of a record, by reason, and the one place that turns it into words."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from swath_sysid.common.advice import REFUSALS, Advice, counted
from swath_sysid.common.conventions import LOST_SHARE, MIN_ROWS
from swath_sysid.common.errors import InputError


@dataclass(frozen=True)
class Loss:
    """What was left out for one reason, or could not be read."""

    code: str  #: Of its sentence, and of the refusal of a large share.
    number: int = 0
    of: int = 0  #: How many there are, as counted or as the file claims; zero: unknown.
    what: str = 'rows'  #: Or ``values of roll``.
    said: dict[str, object] = field(default_factory=dict)  #: What else the sentence names.

    @property
    def share(self) -> float:
        """Of all that there are."""
        return self.number / max(self.of, 1)


def shortage(claimed: int, read: int, counter: str, what: str = 'rows') -> tuple[Loss, ...]:
    """What a file lacks of what its own index or header claims to be there."""
    missing = Loss('incomplete-record', claimed - read, claimed, what, {'counter': counter})
    return (missing,) if missing.number > 0 else ()


def described(time: np.ndarray, values: np.ndarray) -> str:
    """Range, first value, rate and missing share of a channel (N,) in its unit, by its times, s."""
    known = np.isfinite(values) & np.isfinite(time)
    if not known.any():
        return 'no values'
    there, span, missing = values[known], np.ptp(time[known]), 1.0 - np.mean(known)
    rate = f'{(there.size - 1) / span:.4g} Hz' if span > 0.0 else 'no rate'
    return f'{there.min():.4g} to {there.max():.4g}, first {there[0]:.4g}, {rate}, {missing:.2%} missing'


def in_words(losses: Iterable[Loss], source: object) -> tuple[Advice, ...]:
    """A sentence for each reason. A record that loses more than `LOST_SHARE` for one is refused where the catalogue has
    a refusal.
    """
    found = [loss for loss in losses if loss.number or not loss.of]
    for loss in found:
        refusal = REFUSALS.get(loss.code)
        if refusal and LOST_SHARE < loss.share < 1.0 and loss.number >= MIN_ROWS:
            raise InputError(
                f'{source}: {loss.number} of {loss.of} {loss.what} ({loss.share:.0%}) {refusal.format(**loss.said)}'
            )
    advice = []
    for (code, _), alike in groupby(found, key=lambda loss: (loss.code, ' of ' in loss.what or str(loss))):
        first, *others = alike  # of columns: those of all in one sentence
        number = sum(loss.number for loss in (first, *others))
        channels = ', '.join(f'{loss.what.split()[-1]}: {loss.number} of {loss.of}' for loss in (first, *others))
        values = {
            'source': source,
            'number': number,
            'rows': counted(number, 'row'),
            'of': first.of,
            'what': first.what,
        }
        advice.append(Advice.of(code, **values | {'share': first.share, 'channels': channels} | first.said))
    return tuple(advice)
