"""Whether a hull's model is valid for the present motion: its verdict, and the amplitudes it was identified at."""

from collections import deque
from collections.abc import Mapping
from math import degrees, inf

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.common.advice import Advice

BLOCKS = 16  #: The past is kept as the extremes of this many parts.
PERIODS = 2.0  #: Natural periods over which a motion's amplitude is measured.
BEYOND = 1.1  #: Factor beyond the largest amplitude of the record from which the model is not valid.


class Reach:
    """Half the width of an angle's motion, over the last two of its natural periods, s."""

    def __init__(self, period: float) -> None:
        self._block = PERIODS * period / BLOCKS
        self._lows, self._highs = deque([inf], BLOCKS), deque([-inf], BLOCKS)
        self._end = -inf

    def add(self, time: float, angle: float) -> None:
        """Add an angle, rad; NaN: not measured."""
        if not self._end - self._block <= time < self._end:
            self._end = time + self._block
            self._lows.append(inf)
            self._highs.append(-inf)
        self._lows[-1] = min(self._lows[-1], angle if angle == angle else inf)
        self._highs[-1] = max(self._highs[-1], angle if angle == angle else -inf)

    @property
    def amplitude(self) -> float:
        """rad; zero where no angle was measured."""
        return max(0.5 * (max(self._highs) - min(self._lows)), 0.0)


class ModelValidity:
    """The models in use, and the amplitudes of the craft."""

    def __init__(self) -> None:
        self._models: dict[str, IdentifiedModel] = {}
        self._reaches: dict[str, Reach] = {}

    def set_model(self, axis: str, model: IdentifiedModel | None) -> None:
        """Use this one from now on."""
        self._models.pop(axis, None)
        self._reaches.pop(axis, None)
        if model is not None:
            self._models[axis], self._reaches[axis] = model, Reach(model.model.natural_period)

    def add(self, time: float, angles: Mapping[str, float]) -> None:
        """Add the angles of a sample, rad, by axis, at a time, s."""
        for axis, reach in self._reaches.items():
            reach.add(time, angles[axis])

    @property
    def verdicts(self) -> dict[str, object]:
        """Verdict and sentence of each model, for diagnostics."""
        return verdict_values(self._models)

    def advice(self) -> tuple[Advice, ...]:
        """What is wrong with the models now."""
        found = []
        for axis, identified in self._models.items():
            if identified.verdict not in ('', 'adequate'):
                sentence = identified.verdict_sentence or 'release the craft again, and identify it'
                found.append(Advice.of('model-doubtful', axis=axis, verdict=identified.verdict, sentence=sentence))
            (smallest, largest), reached = identified.amplitude_range, self._reaches[axis].amplitude
            # a single amplitude is that of an equivalent linear model in waves, not of their crests
            if smallest < largest and reached > BEYOND * largest:
                found.append(
                    Advice.of('outside-valid-amplitude', axis=axis, reached=degrees(reached), largest=degrees(largest))
                )
        return tuple(found)


def verdict_values(models: Mapping[str, IdentifiedModel]) -> dict[str, object]:
    """Verdict and sentence of models by axis, for diagnostics."""
    found: dict[str, object] = {}
    for axis, identified in models.items():
        found[f'verdict_{axis}'] = identified.verdict or 'not known'
        found[f'verdict_sentence_{axis}'] = identified.verdict_sentence
    return found
