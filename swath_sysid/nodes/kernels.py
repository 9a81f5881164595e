"""The kernels of a node: loaded while it already answers and, where the cache lacks them, compiled beside it."""

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from swath_sysid.common.accelerator import answer_at_once, compile_kernels, has_numba, load_kernels, why_slower
from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import WorkerError, WorkerProcess
from swath_sysid.nodes.diagnostics import report_slower

LONGEST_END = 1.0  #: s; loading is not waited for longer when the node ends.


class KernelLoading:
    """Loads the kernels that ``warm_up`` calls in a thread; until then they run uncompiled, with the same results."""

    def __init__(self, warm_up: Callable[[], None], node: Node, health: Any):
        answer_at_once()
        self._warm_up, self._node, self._health = warm_up, node, health
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._load, name='kernels', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End what is under way."""
        self._closing.set()
        self._thread.join(LONGEST_END)
        answer_at_once(False)

    def _load(self) -> None:
        why = None
        if has_numba() and not load_kernels(self._warm_up) and not self._closing.is_set():
            why = self._compile()
        if not self._closing.is_set():
            report_slower(self._node, self._health, why or why_slower())

    def _compile(self) -> Advice | None:
        """Fill the cache in a process of its own, and load from it; why that cannot be."""
        process = WorkerProcess(has_numba, time.monotonic, niceness=0)
        self._note_progress(0.0)
        try:
            process.run((compile_kernels, ([self._warm_up],), True), self._closing.is_set, self._note_progress)
            load_kernels(self._warm_up)
            self._node.get_logger().info('compiled')
        except (InputError, WorkerError, EOFError, OSError) as error:
            return Advice.of('kernels-uncompiled', error=error or 'the process that compiles ended')
        except Cancelled:
            return None
        finally:
            self._health.compiled_share = None
            process.end()
        return None

    def _note_progress(self, share: float) -> None:
        if self._health.compiled_share is None:
            self._node.get_logger().info('compiling, once after an installation; meanwhile forecasts take more time')
        self._health.compiled_share = share
