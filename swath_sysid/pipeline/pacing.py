"""Which samples are used when they come faster than a processor can handle them."""

from math import ceil

LONGEST_PASS = 0.4  #: s in which all that waits is handled: the newest forecast is at most two passes old.
COST_GAIN = 0.02  #: Of the running mean of what a sample takes.


class Pace:
    """Passes over the samples that wait: each uses every ``stride``-th, evenly, and ends with the newest.

    The stride is the least with which a pass takes no longer than `LONGEST_PASS`, so nothing is left out unless the
    processor is busy all the time.
    """

    def __init__(self) -> None:
        self.stride = 1
        self.left = 0  #: Samples of this pass after the newest that was asked for.
        self._cost = 0.0

    def is_used(self, waiting: int) -> bool:
        """Whether to use the next of so many samples that wait, itself among them."""
        if not self.left:
            self.left = waiting
            self.stride = max(1, ceil(waiting * self._cost / LONGEST_PASS))
        self.left -= 1
        return self.left % self.stride == 0

    def note(self, seconds: float) -> None:
        """What a sample that was used took, s."""
        self._cost += COST_GAIN * (seconds - self._cost)
