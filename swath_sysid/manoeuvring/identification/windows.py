"""Runs cut into windows, each of which is simulated from its own initial state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.motion.trial import Run

LEADS = (5.0, 10.0, 20.0)  #: s, at which errors of position and heading are reported.
LENGTH = max(LEADS)
SETTLING = 5.0  #: s; the shortest window, and simulations and filters run so long before they count.
SETTLED = 2.0  #: s after which acting thrust no longer depends on inputs before the record.


@dataclass(frozen=True)
class Windows:
    """Windows of equal step, side by side; shorter ones are padded with NaN."""

    step: float  #: s.
    runs: tuple
    run_index: np.ndarray  #: int, (W,)
    start: np.ndarray  #: int, (W,); First sample.
    steps: np.ndarray  #: int, (W,)
    measured: np.ndarray  #: (3, S + 1, W); Surge, sway, yaw rate over ground.
    heading: np.ndarray  #: (S + 1, W); rad; zero where not measured.
    initial: np.ndarray  #: (3, W); Smoothed state at the start, NaN where not measured.

    @property
    def count(self) -> int:
        """Number of windows."""
        return self.start.size

    def gather(self, series: Sequence[np.ndarray], parts: int = 1) -> np.ndarray:
        """One series per run over the parts of the steps of each window, (S parts, W); the last value is held."""
        longest = parts * int(self.steps.max())
        found = np.zeros((longest, self.count))
        places = zip(self.run_index, parts * self.start, parts * self.steps, strict=True)
        for w, (run, start, steps) in enumerate(places):
            found[:steps, w] = series[run][start : start + steps]
            found[steps:, w] = found[steps - 1, w]
        return found


def cut(runs: Sequence[Run], length: float = LENGTH) -> Windows:
    """Windows of `SETTLING` s up to ``length``, none across a gap in the thrust or within `SETTLED` s after one."""
    step = runs[0].step
    if any(abs(run.step - step) > 1e-9 for run in runs):
        raise InputError('the runs differ in sample interval: prepare them with one step')
    long, short, settled = (round(duration / step) for duration in (length, SETTLING, SETTLED))
    places = []
    for index, run in enumerate(runs):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], run.driven.astype(int), [0]])))
        for begin, end in edges.reshape(-1, 2) + [settled, 0]:
            while end - 1 - begin >= short:
                steps = min(long, end - 1 - begin)
                places.append((index, begin, steps))
                begin += steps
    if not places:
        raise InputError(f'no run holds {SETTLING:.0f} s of motion with known thrust: record longer runs')
    run_index, start, steps = np.array(places).T
    shape = int(steps.max()) + 1, len(places)
    measured, heading, initial = np.full((3, *shape), np.nan), np.zeros(shape), np.empty((3, len(places)))
    for w, (index, begin, count) in enumerate(places):
        run = runs[index]
        span = slice(begin, begin + count + 1)
        measured[:, : count + 1, w] = run.channels[:, span]
        if run.heading is not None:
            heading[: count + 1, w] = run.heading[span]
        initial[:, w] = run.smooth[:, begin]
    return Windows(step, tuple(runs), run_index, start, steps, measured, heading, initial)
