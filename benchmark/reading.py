"""Times the readers: a CSV of 10^7 rows, bags of an hour at 100 Hz, and what a node pays for one IMU message.

Run it as ``python benchmark/reading.py [--rows 10000000]``.
"""

import resource
import tempfile
from pathlib import Path
from time import perf_counter
from timeit import timeit
from typing import Annotated

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.intake import ImuReading, convert
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.reading import read_trial

CALLS = 20_000


def rolling(rows, rate):
    """A trial of a number of rows."""
    time = np.arange(rows) / rate
    noise = np.random.default_rng(1).normal(0, 1e-3, rows)
    return Trial(time=time, roll=0.1 * np.sin(time) + noise, roll_rate=0.1 * np.cos(time) + noise)


def line_of(what, begun, rows):
    """One line: how long it took, and the most memory used so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return f'{what:<28} {rows:>9} rows {perf_counter() - begun:7.2f} s   peak memory {peak:.2f} GB'


def lines(*, rows: Annotated[int, 'of the CSV file (default: %(default)s)'] = 10_000_000):
    """Writing and reading of each file, then a message."""
    with tempfile.TemporaryDirectory() as folder:
        for name, trial, write in (
            ('hour.mcap', rolling(360_000, 100), write_imu_bag),
            ('hour.db3', rolling(360_000, 100), write_imu_bag),
            ('large.csv', rolling(rows, 1e4), write_csv),
        ):
            path = Path(folder) / name
            begun = perf_counter()
            write(path, trial)
            yield line_of(f'write {name}', begun, trial.time.size)
            begun = perf_counter()
            read = read_trial(path)
            yield line_of(f'read {name}', begun, read.time.size)
    known = (1e-4, 0.0, 0.0) * 3
    message = ImuReading(0, (0.1, 0.0, 0.0, 0.995), known, (0.1, 0.2, 0.3), known, (0.0, 0.0, 9.81), known)
    for name, installation in (('as the craft', Installation()), ('frd, turned', Installation('frd', (0.1, 0.2, 0.3)))):
        seconds = timeit(lambda installation=installation: convert(message, installation), number=CALLS)
        yield f'one message, {name:<15} {seconds / CALLS * 1e6:22.1f} us'


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
