"""Which samples are used when they come faster than a processor can handle them."""

from collections import deque
from math import ceil

LONGEST_PASS = 0.25  #: s in which all that waits is handled: the newest forecast is at most about two passes old.
BEGUN_ANEW = 4.0  #: Passes of that length after which one that takes longer than it was thought to ends.
REMEMBERED = 25  #: Samples that tell how long a pass takes.


class Pace:
    """Passes over the samples that wait: each uses every ``stride``-th, evenly, and ends with the newest.

    The stride is the least with which a pass takes no longer than `LONGEST_PASS`, so nothing is left out unless the
    processor is busy all the time. What a sample takes is the time since the one before it was done: also what
    callbacks and other programs took of the processor in between.
    """

    def __init__(self) -> None:
        self.stride = 1
        self.left = 0  #: Samples of this pass after the newest that was asked for.
        self._begun = self._since = 0.0
        self._took: deque[float] = deque([0.0], maxlen=REMEMBERED)

    def is_used(self, waiting: int, now: float) -> bool:
        """Whether to use the next of so many samples that wait, itself among them, at this time, s."""
        if not self.left or now - self._begun > BEGUN_ANEW * LONGEST_PASS:
            self.left, self._begun, self._since = waiting, now, now
            usual = self._usual()
            self.stride = ceil(waiting / max(1, LONGEST_PASS // usual)) if usual else 1
        self.left -= 1
        return self.left % self.stride == 0

    def note(self, now: float) -> None:
        """That a sample which was used is done at this time, s."""
        self._took.append(now - self._since)
        self._since = now

    def _usual(self) -> float:
        """What a sample takes in the mean, s, but for the one that took longest: a single stall is no load."""
        return (sum(self._took) - max(self._took)) / max(1, len(self._took) - 1)
