"""What contradicts itself in the data of a sensor, as a value: the code, the sentence with the cure, the axis."""

from dataclasses import dataclass

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

FROZEN_CODES = frozenset({'sensor-frozen', 'angles-frozen'})

#: Found at rest also.
GRAVITY_CODES = frozenset(
    {'axes-of-sensor', 'accelerations-in-g', 'accelerations-scaled', 'gravity-missing', 'sensor-turned'}
)

OFFSET_CODES = frozenset({'rate-offset'})  #: The same, where there are angles and rates.

#: Found only while the craft moves.
RATE_CODES = frozenset(
    {
        'rates-turned',
        'rates-swapped',
        'rate-sign',
        'rate-unit',
        'rate-scale',
        'rate-late',
        'angle-late',
        'rate-unrelated',
    }
)

#: The rest of the data is as good without what these are about.
DOUBTFUL_CODES = FROZEN_CODES | {'accelerations-scaled', 'gravity-missing'}


@dataclass(frozen=True)
class Contradiction(Advice):
    """A record or a sensor that contradicts itself, with what would mend it; the axis where only one is concerned."""

    axis: str | None = None

    @property
    def is_plain(self) -> bool:
        """Whether nothing should be identified or forecast from such data before it is mended."""
        return self.code not in DOUBTFUL_CODES


def refuse_contradictions(trial: Trial, axis: str | None = None) -> None:
    """Refuse a record whose angles, rates and accelerations contradict each other plainly.

    Contradictions that concern only another axis than the one given are ignored.

    Raises:
        InputError: What contradicts itself, and what mends it.
    """
    for advice in trial.advice:
        if isinstance(advice, Contradiction) and advice.is_plain and (axis is None or advice.axis in (None, axis)):
            raise InputError(f'{trial.source}: {advice.message}' if trial.source else advice.message)
