"""Which samples are used when they come faster than a processor can handle them."""

from collections import deque
from math import ceil
from statistics import median

LONGEST_PASS = 0.25  #: s in which all that waits is handled: the newest forecast is at most about two passes old.
REMEMBERED = 25  #: Samples whose usual cost tells how long a pass takes.


class Pace:
    """Passes over the samples that wait: each uses every ``stride``-th, evenly, and ends with the newest.

    The stride is the least with which a pass takes no longer than `LONGEST_PASS`, so nothing is left out unless the
    processor is busy all the time.
    """

    def __init__(self) -> None:
        self.stride = 1
        self.left = 0  #: Samples of this pass after the newest that was asked for.
        self._costs: deque[float] = deque([0.0], maxlen=REMEMBERED)

    def is_used(self, waiting: int) -> bool:
        """Whether to use the next of so many samples that wait, itself among them."""
        if not self.left:
            self.left = waiting
            self.stride = max(1, ceil(waiting * median(self._costs) / LONGEST_PASS))
        self.left -= 1
        return self.left % self.stride == 0

    def note(self, seconds: float) -> None:
        """What a sample that was used took, s."""
        self._costs.append(seconds)
