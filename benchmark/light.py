"""What it costs to load: processor time to import the verb identify, and the memory of imu_buffer.

    python benchmark/light.py

identify:   over the time to import numpy, scipy.optimize and yaml, in turns, each in a process of its own
imu_buffer: proportional set size of the node alone, after it has seen a sensor at rest and the end of a free decay
"""

import argparse
import resource
import subprocess
import sys
from math import cos, exp, pi, sin
from statistics import median

LIBRARIES, VERB = 'import numpy, scipy.optimize, yaml', 'import swath_sysid.cli.identify'
ROUNDS = 9
RATE, PERIOD_S, DAMPING = 100, 1.5, 0.05


def processor_time(code):
    """Seconds that a fresh interpreter takes for the code."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, '-c', code], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def proportional_set_size():
    """Of this process, MB."""
    with open('/proc/self/smaps_rollup') as lines:
        return next(int(line.split()[1]) for line in lines if line.startswith('Pss:')) / 1024.0


def reading(number):
    """Of an IMU on a craft at rest that is released from 6 deg every 30 s."""
    from swath_sysid.attitude.motion.intake import ImuReading

    time = number / RATE
    since = time % 30.0 - 10.0
    swing = 2.0 * pi / PERIOD_S
    roll = 0.1 * (1.0 if since < 0.0 else exp(-DAMPING * swing * since) * cos(swing * since))
    roll += 1e-4 * sin(1e4 * time)
    force = 0.0, 9.81 * sin(roll), 9.81 * cos(roll)
    return ImuReading(
        number * (1_000_000_000 // RATE),
        (sin(0.5 * roll), 0.0, 0.0, cos(0.5 * roll)),
        [1e-6] * 9,
        (0.0,) * 3,
        [-1.0] * 9,
        force,
        [1e-4] * 9,
    )


def memory():
    """Of this process as the node imu_buffer after two minutes: it must be a fresh one."""
    import rclpy

    from swath_sysid.nodes.imu_buffer import ImuBuffer

    rclpy.init()
    node = ImuBuffer()
    decays = sum(node.window.add(reading(number)).finished is not None for number in range(1, 120 * RATE))
    node.health.reports(0.0, 120_000_000_000)
    print(f'imu_buffer: {proportional_set_size():.0f} MB after {decays} decays')


def main():
    """Print both figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--memory-of-this-process', action='store_true', help=argparse.SUPPRESS)
    if parser.parse_args().memory_of_this_process:
        memory()
        return
    processor_time(VERB)
    pairs = [(processor_time(LIBRARIES), processor_time(VERB)) for _ in range(ROUNDS)]
    ratios = sorted(verb / libraries for libraries, verb in pairs)
    print(
        f'identify: {median(verb for _, verb in pairs):.2f} s of processor time, {median(ratios):.2f} times that of '
        f'its libraries ({ratios[0]:.2f} to {ratios[-1]:.2f})'
    )
    subprocess.run([sys.executable, __file__, '--memory-of-this-process'], check=True)


if __name__ == '__main__':
    main()
