"""Neural networks as a yardstick for the forecast: perceptron, causal convolutions and LSTM on two records.

    OMP_NUM_THREADS=1 python benchmark/networks.py                  # half an hour of one core
    OMP_NUM_THREADS=1 python benchmark/networks.py morro

Each network learns from the first half of a record and stays as it is; everything is scored on the second half. It
reads three periods of every channel that the forecast reads and gives both angles at all leads. The last fifth of the
first half decides when training stops and which width is used. The package's own forecast runs through the whole
record, as on board, and goes on learning; in the simulated sea also with the hull, as known from decays. Records are
read from the folder that SWATH_SYSID_DATA names. Needs ``pip install swath_sysid[benchmark-networks]``.
"""

import argparse
import importlib.util
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from record_forecasts import BUOY_LEADS, buoy
from sea_forecasts import ANGLE_NOISE, FINE_RATE, RATE_NOISE, make_sea

from records import WITH_HULL, axes_of, issued, persistence, steps_of, swath_sysid, vector_autoregression
from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.motion.turning_points import find_turning_points, mean_period
from swath_sysid.attitude.prediction.variate_analysis import useful_channels
from swath_sysid.evaluation.baselines import Record
from swath_sysid.evaluation.scoring import FORECAST, score_forecasts

MISSING = 2
PERIODS = 3.0
"""Past that a network reads, in mean periods of the slower axis."""

HELD_OUT = 0.2
"""Share of the first half that is for validation."""

WIDTHS, SEEDS = (8, 16, 32, 64), (0, 1, 2)
RIDGES = tuple(10.0**power for power in range(-9, 0))
DURATION, RATE, SEED = 3600.0, 10.0, 1
"""Of the simulated sea: s, Hz."""

OURS = 'swath_sysid'
ROWS = {'persistence': persistence, 'VAR(40)': vector_autoregression, OURS: swath_sysid}


HULLS = {axis: hull_named(f'swath-{axis}').model for axis in AXES}
"""Published, of the simulated craft."""


def simulated_sea(duration=DURATION):
    """The published roll and pitch hulls in the same long-crested sea; pitch follows a quarter of a wave later."""
    rng, every = np.random.default_rng(SEED), round(FINE_RATE / RATE)
    motion = {}
    for axis, lag in (('roll', 0.0), ('pitch', 0.5 * math.pi)):
        sea = make_sea(SEED, duration, HULLS[axis], lag)
        for name, values, noise in ((axis, sea.angle, ANGLE_NOISE), (f'{axis}_rate', sea.rate, RATE_NOISE)):
            motion[name] = values[::every] + rng.normal(0.0, noise, values[::every].size)
    return Trial(np.arange(motion['roll'].size) / RATE, **motion, source='simulation')


RECORDS = {
    'morro': ('Moored buoy off Morro Bay', buoy, {}),
    'simulated': ('Simulated sea of an hour', simulated_sea, HULLS),
}


# -- samples to learn from


class Samples(NamedTuple):
    """What a network is given at stamps (N,), s, and what it is to give."""

    stamps: np.ndarray
    inputs: np.ndarray  #: (N, past, channels); the sample of the stamp last.
    now: np.ndarray  #: (N, 1, axes); angles at the stamp, rad.
    targets: np.ndarray  #: (N, leads, axes); angles at the leads, rad; NaN where the record does not hold them.

    def complete(self):
        """Those that a network can learn from."""
        known = [np.isfinite(values).all(axis=(1, 2)) for values in (self.inputs, self.targets)]
        return Samples(*(part[known[0] & known[1]] for part in self))


def samples_of(record, stamps, past, channels, axes, leads):
    """Cut a record at stamps that are those of samples: so many lags of the channels, and the angles at the leads, s.

    Lags within a gap are linear between the samples beside it, of which none is later than the stamp.
    """
    wanted = stamps[:, None] - record.interval * np.arange(past - 1, -1, -1)
    inputs = [np.interp(wanted, record.time, record.column(name), left=np.nan) for name in channels]
    angles = [record.names.index(axis) for axis in axes]
    now, targets = (record.at(stamps[:, None] + ahead, angles) for ahead in (np.zeros(1), leads))
    return Samples(stamps, np.stack(inputs, axis=-1), now, targets)


@dataclass(frozen=True)
class Task:
    """The three parts of a record, and the scales that its first half gives."""

    axes: list[str]
    leads: np.ndarray
    training: Samples
    validation: Samples
    test: Samples
    centre: np.ndarray  #: (channels,)
    scale: np.ndarray

    def scaled(self, samples):
        """Inputs as a network reads them, shape (N, past, channels)."""
        return (samples.inputs - self.centre) / self.scale


def task_of(trial, leads):
    """Training, validation and test; the first two from records that end with them."""
    leads, axes = np.asarray(leads), axes_of(trial)
    begin, end = float(trial.time[0]), float(trial.time[-1])
    half = begin + 0.5 * (end - begin)
    held_out = half - HELD_OUT * (half - begin)
    learnt, first = trial.between(None, held_out), trial.between(None, half)
    known = Record.of(first)
    period = max(mean_period(find_turning_points(first.axis(axis))) for axis in axes)
    past = math.ceil(PERIODS * period / known.interval)
    places = useful_channels(known.values)
    how = past, [known.names[place] for place in places], axes, leads
    return Task(
        axes,
        leads,
        samples_of(Record.of(learnt), learnt.time, *how).complete(),
        samples_of(known, first.time[first.time > held_out], *how).complete(),
        samples_of(Record.of(trial), trial.time[trial.time > half], *how),
        np.nanmean(known.values[:, places], axis=0),
        np.nanstd(known.values[:, places], axis=0),
    )


# -- forecasts


def last_angle(task):
    """Persistence, as what a network starts from: a function from samples to angles (N, leads, axes)."""
    return lambda samples: np.broadcast_to(samples.now, samples.targets.shape)


def regression(task):
    """Ridge regression on the same lags, its ridge for each lead and axis chosen by validation."""
    (rows, targets), (others, expected) = (
        (_with_constant(task.scaled(part)), part.targets.reshape(part.stamps.size, -1))
        for part in (task.training, task.validation)
    )
    values, vectors = np.linalg.eigh(rows.T @ rows / rows.shape[0])
    projected = vectors.T @ (rows.T @ targets) / rows.shape[0]
    tried = np.array([vectors @ (projected / (values[:, None] + ridge)) for ridge in RIDGES])
    errors = np.mean((others @ tried - expected) ** 2, axis=1)
    coefficients = tried[errors.argmin(axis=0), :, np.arange(targets.shape[1])].T
    return lambda samples: (_with_constant(task.scaled(samples)) @ coefficients).reshape(samples.targets.shape)


def _with_constant(inputs):
    return np.column_stack([np.ones(inputs.shape[0]), inputs.reshape(inputs.shape[0], -1)])


REGRESSION = 'regression'
STARTS = {'': last_angle, f'{REGRESSION} + ': regression}
"""What a network adds to, by the prefix of its name."""


@dataclass(frozen=True)
class Forecaster:
    """A trained network, and what it adds to."""

    start: Callable[[Samples], np.ndarray]
    unit: np.ndarray  #: (leads, axes); rad of an output of one.
    trained: Any
    task: Task

    def angles(self, samples):
        """At the leads, shape (N, leads, axes)."""
        outputs = self.trained.outputs(self.task.scaled(samples)).reshape(samples.targets.shape)
        return self.start(samples) + self.unit * outputs

    @property
    def validation_error(self):
        """Geometric mean over leads and axes, so that each counts the same."""
        return float(np.exp(np.log(_size(self.angles(self.task.validation) - self.task.validation.targets)).mean()))


def _size(errors):
    """Root mean square over samples."""
    return np.sqrt(np.mean(errors**2, axis=0))


def trained_on(task, start, train, kind, width, seed):
    """A network that learns what is left of each target, in units of the size of that."""
    left = [part.targets - start(part) for part in (task.training, task.validation)]
    unit = _size(left[0])
    training, validation = (
        (task.scaled(part), (rest / unit).reshape(part.stamps.size, -1))
        for part, rest in zip((task.training, task.validation), left, strict=True)
    )
    return Forecaster(start, unit, train(kind, width, seed, training, validation), task)


# -- scores


@dataclass(frozen=True)
class Row:
    """A method's errors over the standard deviation of the motion, by axis and lead, and what they cost."""

    nrmse: dict[str, np.ndarray]
    cost: str = ''


def nrmse_of(record, task, angles):
    """Scores by axis of forecasts (N, leads, axes) at the stamps of the test; persistence replaces what is missing."""
    test = task.test
    resting = np.broadcast_to(test.now, test.targets.shape)
    return {
        axis: score_forecasts(record, axis, test.stamps, task.leads, angles[..., place], resting[..., place]).nrmse[
            FORECAST
        ]
        for place, axis in enumerate(task.axes)
    }


def package_rows(record, task, trial, hulls):
    """Rows of what runs through the whole record, with the hulls by axis if there are any."""
    methods = ROWS | ({WITH_HULL: partial(with_hull, hulls)} if hulls else {})
    rows = {}
    for name, method in methods.items():
        begun = time.process_time()
        found = method(trial, task.axes, task.test.stamps, task.leads)
        spent = time.process_time() - begun
        angles = np.stack([found[axis] for axis in task.axes], axis=-1)
        rows[name] = Row(nrmse_of(record, task, angles), f'{spent:.0f} s')
    return rows


def with_hull(hulls, trial, axes, stamps, leads):
    """The package's own forecasts with decay models by axis, known exactly."""
    models = {axis: IdentifiedModel.exactly(hull) for axis, hull in hulls.items()}
    return issued(steps_of(trial, leads, models), axes, stamps, leads, 'mean')


def rows_of(trial, leads, kinds, train, hulls=None):
    """Rows by name: those of the package, then the median seed and the best by validation of each kind of network.

    Parameters
    ----------
    trial : Trial
    leads : sequence of float
        s.
    kinds : iterable of str
    train : callable
        `network_training.train`.
    hulls : dict of str to DecayModel, optional
        Of the axes, for a forecast that knows them.
    """
    task, record, best = task_of(trial, leads), Record.of(trial), []
    rows = package_rows(record, task, trial, hulls)
    for prefix, made in STARTS.items():
        begun = time.process_time()
        start = made(task)
        if prefix:
            spent = time.process_time() - begun
            rows[REGRESSION] = Row(nrmse_of(record, task, start(task.test)), f'{spent:.0f} s')
        for kind in kinds:
            found = network_rows(record, task, start, train, kind, best)
            rows |= {f'{prefix}{kind}, {which}': row for which, row in found.items()}
    rows['mean of the best'] = Row(nrmse_of(record, task, np.mean(best, axis=0)))
    return rows


def network_rows(record, task, start, train, kind, best_angles):
    """Search the width with one seed, then train the others; appends the angles of the best seed to a list."""
    tried = {width: trained_on(task, start, train, kind, width, SEEDS[0]) for width in WIDTHS}
    width = min(tried, key=lambda width: tried[width].validation_error)
    seeds = [tried[width], *(trained_on(task, start, train, kind, width, seed) for seed in SEEDS[1:])]
    angles = [each.angles(task.test) for each in seeds]
    scores = [nrmse_of(record, task, each) for each in angles]
    median = {axis: np.median([score[axis] for score in scores], axis=0) for axis in task.axes}
    spent = sum(each.trained.seconds for each in (*tried.values(), *seeds[1:]))
    best = min(range(len(seeds)), key=lambda place: seeds[place].validation_error)
    best_angles.append(angles[best])
    trained = seeds[best].trained
    cost = f'{trained.seconds:.0f} s, width {width}, {trained.parameters} parameters'
    return {'median': Row(median, f'{spent:.0f} s in all'), 'best': Row(scores[best], cost)}


def table_of(title, leads, rows):
    """Markdown: errors over the standard deviation, and the worst ratio of the forecast to the best network."""
    lines = [
        f'### {title}',
        '',
        f'| axis | method | {" | ".join(f"{lead:g} s" for lead in leads)} | processor time |',
        '|' + '---|' * (3 + len(leads)),
    ]
    for axis in next(iter(rows.values())).nrmse:
        for name, row in rows.items():
            lines.append(f'| {axis} | {name} | {_cells(row.nrmse[axis])} | {row.cost} |')
    for ours in (name for name in (OURS, WITH_HULL) if name in rows):
        lines.append(f'| worst | {ours} over the best network | {_cells(ratios_of(rows, ours))} | |')
    return '\n'.join([*lines, ''])


def ratios_of(rows, ours=OURS):
    """Error of a forecast over that of the network that is best at a lead, of the worse axis, shape (leads,)."""
    networks = [row for name, row in rows.items() if name not in (*ROWS, WITH_HULL, REGRESSION)]
    nrmse = rows[ours].nrmse
    return np.max([nrmse[axis] / np.min([row.nrmse[axis] for row in networks], axis=0) for axis in nrmse], axis=0)


def _cells(values):
    return ' | '.join(f'{value:.3f}' for value in values)


def main():
    """Print the tables of the records asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('records', nargs='*', choices=[[], *RECORDS], metavar='RECORD', help=f'of {", ".join(RECORDS)}')
    chosen = parser.parse_args().records or RECORDS
    if importlib.util.find_spec('torch') is None:
        print('The networks need torch: pip install swath_sysid[benchmark-networks]', file=sys.stderr)
        return MISSING
    from network_training import KINDS, train

    for name in chosen:
        title, trial, hulls = RECORDS[name]
        print(table_of(title, BUOY_LEADS, rows_of(trial(), BUOY_LEADS, KINDS, train, hulls)), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
