"""How fast a record is played through: times real time, on one core.

    python benchmark/play_through.py                 an hour at 100 Hz, a release every five minutes
    python benchmark/play_through.py --minutes 5 --profile

Beside the whole it prints the parts: forecasts at the leads and over the horizon, fits of the sea, refits of
the hull, and all the rest, which is what every sample costs: reading, intake, window, filters, the forecast
one sample ahead, diagnostics, writing. ``NUMBA_DISABLE_JIT=1`` shows it without numba.
"""

import argparse
import contextlib
import cProfile
import io
import os
import pstats
import tempfile
import time
from math import radians
from pathlib import Path

for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(name, '1')

import numpy as np  # noqa: E402 - after the limits on threads

from swath_sysid.attitude.hull.catalogue import hull_named  # noqa: E402
from swath_sysid.attitude.hull.craft_simulator import CraftSettings, SimulatedCraft  # noqa: E402
from swath_sysid.attitude.motion.trial import Trial  # noqa: E402
from swath_sysid.attitude.prediction.forecaster import Forecaster  # noqa: E402
from swath_sysid.cli.main import main  # noqa: E402
from swath_sysid.formats.bags import write_imu_bag  # noqa: E402
from swath_sysid.pipeline import play_through  # noqa: E402

LIMIT = 15.0


class Stopwatch:
    """Processor time and number of calls of functions, by name."""

    def __init__(self):
        self.spent = {}

    def around(self, name, function):
        """The function, timed."""
        self.spent[name] = [0.0, 0]

        def timed(*arguments, **options):
            begun = time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                self.spent[name][0] += time.process_time() - begun
                self.spent[name][1] += 1

        return timed

    def watch(self):
        """Watch what a play-through spends the most on."""
        Forecaster._issue = self.around('forecasts', Forecaster._issue)
        begin = play_through.PlayThrough.__init__
        fits = {
            'fit': self.around('refits of the hull', play_through.refit),
            'fit_sea': self.around('fits of the sea', play_through.fit_sea),
        }
        play_through.PlayThrough.__init__ = lambda pipeline, *given: begin(pipeline, *given, **fits)


def record(path, minutes, rate, every):
    """A craft released again and again, as a bag."""
    craft = SimulatedCraft(CraftSettings(hull_named('swath-roll').model, radians(6.0), rate_hz=rate))
    count = round(60.0 * minutes * rate)
    rows = []
    for number in range(count):
        if number % round(every * rate) == round(10.0 * rate):
            craft.release()
        reading = craft.next_reading()
        rows.append((reading.roll, reading.pitch, reading.roll_rate, reading.pitch_rate, *reading.force))
    names = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
    write_imu_bag(path, Trial(np.arange(count) / rate, **dict(zip(names, np.array(rows).T, strict=True))))


def played(bag, output):
    """Play the record through, silently."""
    with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.redirect_stderr(io.StringIO()):
        code = main(['play-through', str(bag), '--output', str(output)])
    if code:
        raise SystemExit(code)
    return printed.getvalue()


def run():
    """Measure and print; exit code 1 below the limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--minutes', type=float, default=60.0)
    parser.add_argument('--rate', type=float, default=100.0)
    parser.add_argument('--every', type=float, default=300.0, metavar='S', help='between releases')
    parser.add_argument('--profile', action='store_true', help='print what takes the time')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bag, output = Path(folder) / 'record.mcap', Path(folder) / 'out.mcap'
        record(bag, arguments.minutes, arguments.rate, arguments.every)
        stopwatch = Stopwatch()
        stopwatch.watch()
        profile = cProfile.Profile() if arguments.profile else contextlib.nullcontext()
        wall, processor = time.perf_counter(), time.process_time()
        with profile:
            printed = played(bag, output)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        size = output.stat().st_size
    print(printed.strip().splitlines()[-1])
    speed = 60.0 * arguments.minutes / processor
    print(
        f'{arguments.minutes:g} min at {arguments.rate:g} Hz: {processor:.1f} s of processor time ({wall:.1f} s of '
        f'wall clock), {speed:.0f} times real time, {size / 1e6:.0f} MB written'
    )
    for name, (spent, calls) in stopwatch.spent.items():
        print(f'    {name:20s} {spent:6.1f} s, {calls} of {1e3 * spent / max(calls, 1):.2f} ms')
    rest = processor - sum(spent for spent, _ in stopwatch.spent.values())
    samples = 60.0 * arguments.minutes * arguments.rate
    print(f'    {"all the rest":20s} {rest:6.1f} s, {1e6 * rest / samples:.0f} us a sample (imports included)')
    if arguments.profile:
        pstats.Stats(profile).sort_stats('tottime').print_stats(30)
    return 0 if speed >= LIMIT else 1


if __name__ == '__main__':
    raise SystemExit(run())
