"""What was in use before, for a rollback."""

from collections import deque
from collections.abc import Iterable
from typing import TypeVar

LONGEST = 20

T = TypeVar('T')


def past_of(earlier: Iterable[T] = ()) -> deque[T]:
    """The last of some earlier states, oldest first; appending to it forgets the oldest beyond `LONGEST`."""
    return deque(earlier, LONGEST)
