"""Settings of an identification, and the windows that it cuts runs into."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.manoeuvring.hull.terms import INDEX
from swath_sysid.manoeuvring.motion.trial import CraftRun

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


def cut(runs: Sequence[CraftRun], length: float = LENGTH) -> Windows:
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


AUTO, SHARED, NONE = 'auto', 'shared', 'none'
CURRENT_CHOICES = (AUTO, SHARED, NONE)


@checked
@dataclass(frozen=True)
class ManoeuvringSettings:
    """Settings of `identify_manoeuvring`.

    Raises:
        InputError: A value is not positive, or there is no such parameter or choice; the sentence names it.

    Example:
        >>> settings = ManoeuvringSettings(mass=180.0, lever=1.03, fixed={'Xu_dot': -18.0})
        >>> settings.window
        20.0
    """

    mass: float | None = None  #: kg, cargo included.
    inertia: float | None = None  #: Yaw inertia without added inertia, kg m^2.
    thrust_per_command: float | None = None  #: Thrust of one thruster at full command ahead, N.
    lever: float | None = None  #: Half the distance between the thrusters, m.
    length: float | None = None  #: Of the hulls, m.
    terms: tuple[str, ...] | None = None  #: Exactly these derivatives; None: the simplest adequate set.
    fixed: dict[str, float] = field(default_factory=dict)  #: Known parameters.
    #: Parameter to value and standard deviation of its regularisation.
    towards: dict[str, tuple[float, float]] = field(default_factory=dict)
    current: str = AUTO  #: ``auto`` (one for each of several runs with heading), ``shared`` (one for all), ``none``.
    window: float = LENGTH  #: Length of the windows, s.
    generations: int = 15  #: Of the genetic search for a start; 0: regression alone.
    population: int = 24  #: Of the genetic search.
    seed: int = 1

    def __post_init__(self):
        for name in ('mass', 'inertia', 'thrust_per_command', 'lever', 'length', 'window'):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < 1e9:
                raise InputError(f'{name} must be a positive number, not {value}')
        for name in (*(self.terms or ()), *self.fixed, *self.towards):
            check_choice(name, INDEX, 'manoeuvring parameter')
        check_choice(self.current, CURRENT_CHOICES, 'choice of the current')
        if self.generations < 0:
            raise InputError('generations must not be negative')
        if self.population < 8:
            raise InputError('population must be at least 8')
