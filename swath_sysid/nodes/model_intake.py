"""Model texts from the network: read in a thread of their own, so that no callback waits for one."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.schema import LARGEST_TEXT

MAX_WAITING = 16  #: Texts or requests; of a flood the oldest are dropped, as they are superseded anyway.
MAX_ENDINGS = 1000  #: Models and rejections, more than are read between two diagnostics.


class ModelIntake:
    """Reads texts one after the other in a thread and keeps what they hold until the node asks for it."""

    def __init__(self, read: Callable, on_refused: Callable[[str], None]):
        self._read = read
        self._on_refused = on_refused
        self._waiting: deque[str] = deque(maxlen=MAX_WAITING)
        #: Content, or why it was rejected, of each text that was read and not taken yet.
        self.endings: deque[tuple[Any, str | None]] = deque(maxlen=MAX_ENDINGS)
        self._come = threading.Semaphore(0)
        self._closing = False
        self._thread = threading.Thread(target=self._serve, name='model intake', daemon=True)
        self._thread.start()

    def submit(self, text: str) -> None:
        """Have a text read."""
        # enough of a larger one to be rejected as too large
        self._waiting.append(text[: LARGEST_TEXT + 1])
        self._come.release()

    def finished(self) -> Iterator[Any]:
        """The contents of the texts read since the last call, in order; rejected ones are reported."""
        while self.endings:
            content, refusal = self.endings.popleft()
            if refusal is None:
                yield content
            else:
                self._on_refused(refusal)

    def close(self) -> None:
        """End the thread."""
        self._closing = True
        self._come.release()
        self._thread.join()

    def _serve(self) -> None:
        while True:
            self._come.acquire()
            if self._closing:
                return
            # of a flood there are more releases than texts
            if self._waiting:
                self.endings.append(self._ending(self._waiting.popleft()))

    def _ending(self, text: str):
        try:
            return self._read(text), None
        except InputError as error:
            return None, str(error)
        except Exception as error:  # whatever a text causes, the node reports it and goes on
            return None, shown(f'{type(error).__name__}: {error}')
