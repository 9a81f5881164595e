"""Two craft in one sea, the leader one wavelength ahead: a bag of what both IMUs measure.

    python examples/leader_and_follower.py both.mcap
    swath-sysid forecast both.mcap --topic /imu/data --leads 1,2,5 --upstream /leader/imu/data

The sea is a JONSWAP spectrum of 5 s peak period, spread by cos^2s with s = 10.  The waves reach the leader, on
`/leader/imu/data`, before the follower, on `/imu/data`.  Both have the same hull.
"""

import argparse
import sys

import numpy as np

from swath_sysid import Trial
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.formats.bags import imu_values, writing_bag
from swath_sysid.formats.messages import SECOND_NS, ImuMessage
from swath_sysid.formats.topics import IMU

STEP, PERIOD, HEIGHT, SPREAD, NOISE = 0.2, 5.0, 0.5, 10.0, 0.02
"""s, s, m, exponent s, and share of each quantity's standard deviation."""

START_NS = 1_700_000_000 * SECOND_NS
LEADER, FOLLOWER = '/leader/imu/data', '/imu/data'
WAVES, AT_ONCE = 2000, 250
QUARTER = 0.25 * np.pi
"""rad; the waves come from the quarter, so that they roll and pitch the craft."""


def two_craft(duration, seed=1):
    """Follower and leader as their IMUs measure them: two trials."""
    rng, peak = np.random.default_rng(seed), 2.0 * np.pi / PERIOD
    w = np.sort(rng.uniform(0.4 * peak, 4.0 * peak, WAVES))
    bump = np.exp(-0.5 * ((w / peak - 1.0) / np.where(w < peak, 0.07, 0.09)) ** 2)
    density = w**-5.0 * np.exp(-1.25 * (peak / w) ** 4) * 3.3**bump
    lines = np.sqrt(density * np.gradient(w)) * np.exp(2j * np.pi * rng.random(WAVES))
    lines *= HEIGHT / 4.0 * np.sqrt(2.0 / np.sum(np.abs(lines) ** 2))
    direction = rng.normal(0.0, 1.0 / np.sqrt(2.0 * SPREAD), WAVES)
    number, ratio = w**2 / STANDARD_GRAVITY, w / peak
    roll = 1j * number * np.sin(direction + QUARTER) / (1.0 - ratio**2 + 0.2j * ratio)
    pitch = -1j * number * np.cos(direction + QUARTER) / (1.0 - (ratio / 1.6) ** 2 + 0.6j * ratio / 1.6)
    upwards = -(w**2) / (1.0 + (ratio / 2.0) ** 2)
    responses = np.array([roll, pitch, 1j * w * roll, 1j * w * pitch, upwards])
    time = np.arange(0.0, duration, STEP)
    length = 2.0 * np.pi * STANDARD_GRAVITY / peak**2
    return [
        measured(time, motion_of(time, w, responses * lines * np.exp(1j * number * np.cos(direction) * ahead)), rng)
        for ahead in (0.0, length)
    ]


def motion_of(time, w, lines):
    """The sums of the waves (5, W) at the times (N,), shape (5, N)."""
    parts = [slice(k, k + AT_ONCE) for k in range(0, w.size, AT_ONCE)]
    return sum((lines[:, part] @ np.exp(1j * np.outer(w[part], time))).real for part in parts)


def measured(time, motion, rng):
    """The trial of a motion: roll, pitch, their rates and the upward acceleration, with noise."""
    roll, pitch, roll_rate, pitch_rate, upwards = motion + NOISE * motion.std(axis=1, keepdims=True) * rng.normal(
        size=motion.shape
    )
    up = STANDARD_GRAVITY + upwards
    return Trial(
        time,
        roll=roll,
        pitch=pitch,
        roll_rate=roll_rate,
        pitch_rate=pitch_rate,
        accel_x=-np.sin(pitch) * up,
        accel_y=np.sin(roll) * np.cos(pitch) * up,
        accel_z=np.cos(roll) * np.cos(pitch) * up,
        source='simulated',
    )


def write_both(path, follower, leader):
    """Write a bag of both IMUs."""
    sender = ImuMessage('imu_link')
    rows = {LEADER: imu_values(leader), FOLLOWER: imu_values(follower)}
    with writing_bag(path) as add:
        for place, seconds in enumerate(follower.time.tolist()):
            stamp_ns = START_NS + round(SECOND_NS * seconds)
            for topic, values in rows.items():
                add(topic, IMU, stamp_ns, sender.of_values(stamp_ns, values[place]))


def main():
    """Write the bag."""
    parser = argparse.ArgumentParser(description='Two craft in one sea, the leader one wavelength ahead.')
    parser.add_argument('bag', help='NAME.mcap')
    parser.add_argument('--duration', type=float, default=1200.0, metavar='S', help='default: %(default)s')
    arguments = parser.parse_args()
    write_both(arguments.bag, *two_craft(arguments.duration))
    return 0


if __name__ == '__main__':
    sys.exit(main())
