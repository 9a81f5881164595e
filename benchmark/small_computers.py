"""What the forecasts cost a small computer: processor time a second of motion, memory, and time to start.

    OMP_NUM_THREADS=1 python benchmark/small_computers.py

Each line is a process of its own that plays a simulated sea of the published roll hull through the cores of imu_buffer
and predictor, with the defaults or with `config/small.yaml`; the second half of it counts. ROS comes on top: see
`benchmark/latency.py`.
"""
import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RATES = (50, 100, 200)
PARAMETERS = {'defaults': None, 'small.yaml': str(ROOT / 'config' / 'small.yaml')}


def started(parameters):
    """The cores as `play-through` sets them up, imports included."""
    from swath_sysid.nodes.parameters.files import values_from_file
    from swath_sysid.nodes.parameters.imu_buffer import window_settings
    from swath_sysid.nodes.parameters.predictor import pipeline_settings
    from swath_sysid.pipeline.play_through import PlayThrough, PlayThroughSettings

    return PlayThrough(PlayThroughSettings(
        window_settings(values_from_file(parameters, 'imu_buffer')),
        forecasts=pipeline_settings(values_from_file(parameters, 'predictor')), auto_identify=False,
    ))  # fmt: skip


def readings_of(rate, duration):
    """IMU readings of a sea, at any rate."""
    from sea_forecasts import FINE_RATE, make_sea

    from swath_sysid.attitude.motion.trial import Trial
    from swath_sysid.formats.bags import write_imu_bag
    from swath_sysid.formats.reading import read_readings

    fine, when = np.arange(round(duration * FINE_RATE)) / FINE_RATE, np.arange(round(duration * rate)) / rate
    roll, pitch = (make_sea(seed, duration).seen for seed in (0, 1))
    motion = {
        name: np.interp(when, fine, values[:fine.size])
        for name, values in zip(('roll', 'roll_rate', 'pitch', 'pitch_rate'), (*roll.T, *pitch.T), strict=True)
    }
    force = np.random.default_rng(0).normal(0.0, 0.05, (3, when.size)) + 9.81 * np.array(
        [-np.sin(motion['pitch']), np.sin(motion['roll']), np.ones(when.size)]
    )
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'sea.mcap'
        write_imu_bag(bag, Trial(when, **motion, **dict(zip(('accel_x', 'accel_y', 'accel_z'), force, strict=True))))
        return list(read_readings(bag))


def measured(rate, parameters, with_numba, duration):
    """Figures of one setting, of this process: it must be a fresh one."""
    if not with_numba:
        sys.modules['numba'] = None
    begun = time.process_time()
    cores = started(parameters)
    start = time.process_time() - begun
    readings = readings_of(rate, duration)
    for number, reading in enumerate(readings):
        if number == len(readings) // 2:
            begun = time.process_time()
        cores.add(reading)
    share = (time.process_time() - begun) / (0.5 * duration)
    return {'start': start, 'share': share, 'memory': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0}


def main():
    """Print the table, each line from a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=400.0, help='of simulated sea')
    parser.add_argument('--one', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(measured(*json.loads(arguments.one), arguments.seconds)))
        return
    print('| parameters | numba | rate, Hz | processor, % of one core | memory, MB | to start, s of processor |')
    print('|---|---|---|---|---|---|')
    for name, parameters in PARAMETERS.items():
        for with_numba in (True, False):
            for rate in RATES:
                one = json.dumps([rate, parameters, with_numba])
                words = [__file__, '--seconds', str(arguments.seconds), '--one', one]
                told = subprocess.run(
                    [sys.executable, *words], check=True, capture_output=True, text=True,
                    env={**os.environ, 'OMP_NUM_THREADS': '1'},
                ).stdout  # fmt: skip
                figures = json.loads(told.splitlines()[-1])
                print(
                    f'| {name} | {"yes" if with_numba else "no"} | {rate} | {100 * figures["share"]:.1f} | '
                    f'{figures["memory"]:.0f} | {figures["start"]:.1f} |', flush=True,
                )  # fmt: skip


if __name__ == '__main__':
    main()
