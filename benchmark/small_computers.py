"""What the nodes cost a small computer: memory, processor time a second of motion, and time to start.

    python benchmark/small_computers.py --write docs/small_computers.md

Each row is one run of `swath-sysid run` with its workers, with the defaults or with `config/small.yaml`. The nodes
receive a replayed simulated sea of two axes over ROS. Memory is the proportional set size of all processes at the end,
and its maximum while `identifier/identify` fits the last minute; numba's cache is filled. Processor time is that of the
second half. Starting is the processor time until the first sample arrives. Libraries that other programs have loaded
too are counted in part, so memory is larger where no other program uses them. Processor time rises on a
busy machine.
"""

import argparse
import platform
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from latency import ROOT, environment, processor_seconds
from sea_forecasts import FINE_RATE, make_sea

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.formats.bags import write_imu_bag

RATES = (50, 100, 200)
PARAMETERS = {'small.yaml': ('--params-file', str(ROOT / 'config' / 'small.yaml')), 'defaults': ()}
COLUMNS = (
    'parameters',
    'numba',
    'rate, Hz',
    'memory, MB',
    'of it nodes and workers, MB',
    'while it identifies, MB',
    'processor, % of one core',
    'to start, s of processor',
)
IDENTIFY = """
import rclpy
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node('asks')
client = node.create_client(Trigger, 'identifier/identify')
assert client.wait_for_service(60.0), 'the identifier does not answer'
rclpy.spin_until_future_complete(node, client.call_async(Trigger.Request()))
"""
PATIENCE = 120.0
COMPILING = 25.0


def write_sea(path, rate, duration):
    """A bag of a sea, at any rate."""
    fine, when = np.arange(round(duration * FINE_RATE)) / FINE_RATE, np.arange(round(duration * rate)) / rate
    roll, pitch = (make_sea(seed, duration).seen for seed in (0, 1))
    motion = {
        name: np.interp(when, fine, values[: fine.size])
        for name, values in zip(('roll', 'roll_rate', 'pitch', 'pitch_rate'), (*roll.T, *pitch.T), strict=True)
    }
    force = np.random.default_rng(0).normal(0.0, 0.05, (3, when.size)) + 9.81 * np.array(
        [-np.sin(motion['pitch']), np.sin(motion['roll']), np.ones(when.size)]
    )
    write_imu_bag(path, Trial(when, **motion, **dict(zip(('accel_x', 'accel_y', 'accel_z'), force, strict=True))))


def tree(pid):
    """A process and all that it started."""
    tasks = Path(f'/proc/{pid}/task').iterdir()
    children = [child for task in tasks for child in (task / 'children').read_text().split()]
    return [pid, *(each for child in children for each in tree(int(child)))]


def proportional_mb(pid):
    lines = Path(f'/proc/{pid}/smaps_rollup').read_text().splitlines()
    return next(int(line.split()[1]) / 1024.0 for line in lines if line.startswith('Pss:'))


def spent(pid):
    return sum(processor_seconds(each) for each in tree(pid))


def most_while_identifying(pid, env):
    """Largest memory of all processes, MB, while the last minute is identified."""
    most = 0.0
    asking = subprocess.Popen([sys.executable, '-c', IDENTIFY], env=env)
    while asking.poll() is None:
        try:
            most = max(most, sum(proportional_mb(each) for each in tree(pid)))
        except (FileNotFoundError, ProcessLookupError):
            pass  # a process has just ended
        time.sleep(0.1)
    assert asking.returncode == 0
    return most


def measured(rate, options, with_numba, duration):
    """Memory of each process and the most while identifying, MB, share of a core, and processor time to start, s."""
    with tempfile.TemporaryDirectory() as folder:
        write_sea(Path(folder, 'sea.mcap'), rate, duration + PATIENCE)
        env = environment()
        if not with_numba:
            env['NUMBA_DISABLE_JIT'] = '1'
        verb = [sys.executable, '-m', 'swath_sysid.start']
        run = subprocess.Popen(
            [*verb, 'run', *options], env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT
        )
        sensor = subprocess.Popen(
            [*verb, 'replay', f'{folder}/sea.mcap'],
            env=env,
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            for line in run.stdout:
                if 'receiving' in line or 'forecast:' in line:
                    break
            start = spent(run.pid)
            time.sleep(0.5 * duration)
            half, begun = spent(run.pid), time.monotonic()
            time.sleep(0.4 * duration)
            assert sensor.poll() is None, 'the sensor ended before the measurement'
            share = (spent(run.pid) - half) / (time.monotonic() - begun)
            memory = [proportional_mb(pid) for pid in tree(run.pid)]
            return memory, most_while_identifying(run.pid, env), share, start
        finally:
            for process in (sensor, run):
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=PATIENCE)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=600.0, help='of sea, in real time, a line of the table')
    parser.add_argument('--rates', type=int, nargs='+', default=RATES)
    parser.add_argument('--parameters', choices=PARAMETERS, nargs='+', default=list(PARAMETERS))
    parser.add_argument('--write', metavar='FILE', help='the page with the table, written anew')
    arguments = parser.parse_args()
    lines = ['| ' + ' | '.join(COLUMNS) + ' |', '|' + '---|' * len(COLUMNS)]
    print('\n'.join(lines), flush=True)
    # after an installation numba compiles, once, which takes time and memory
    measured(arguments.rates[0], (), True, COMPILING)
    for name in arguments.parameters:
        for with_numba in (True, False):
            for rate in arguments.rates:
                memory, most, share, start = measured(rate, PARAMETERS[name], with_numba, arguments.seconds)
                cells = (
                    name,
                    'yes' if with_numba else 'no',
                    rate,
                    f'{sum(memory):.0f}',
                    ' + '.join(f'{each:.0f}' for each in memory),
                    f'{most:.0f}',
                    f'{100.0 * share:.1f}',
                    f'{start:.1f}',
                )
                lines.append('| ' + ' | '.join(map(str, cells)) + ' |')
                print(lines[-1], flush=True)
                if arguments.write:
                    Path(arguments.write).write_text(page_with(lines, arguments.seconds), encoding='utf-8')


def page_with(lines, seconds):
    """The page with the lines of the table."""
    return '\n'.join(
        (
            '# What the nodes cost',
            '',
            *__doc__.split('\n\n', 2)[2].strip().splitlines(),
            '',
            f'{seconds:.0f} s of sea for each row, {platform.machine()}, Python {platform.python_version()}, '
            'written by `python benchmark/small_computers.py`.',
            '',
            *lines,
            '',
        )
    )


if __name__ == '__main__':
    main()
