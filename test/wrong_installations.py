"""Sensors that sit in the craft in another way than was said: the readings of one that sits right, made wrong."""

from functools import cache

import numpy as np
from imu_stream import diagonal
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import ImuReading, Intake
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.stamps import StampSettings

GRAVITY = 9.80665
OTHER_FRAME = 'other frame'


def turned(roll, pitch, yaw, orientation):
    """Mounted so; `orientation`: whether what it says of its orientation is turned with its vectors."""
    sits = Rotation.from_euler('ZYX', [yaw, pitch, roll], degrees=True)

    def wrong(attitude, rates, force):
        return attitude * sits if orientation else attitude, sits.inv().apply(rates), sits.inv().apply(force)

    return wrong


def frozen_from(sample):
    """The same values again from then on."""

    def wrong(attitude, rates, force):
        rows = np.minimum(np.arange(len(rates)), sample)
        return attitude[rows], rates[rows], force[rows]

    return wrong


def rates_times(factors):
    return lambda attitude, rates, force: (attitude, rates * factors, force)


WRONG = {
    # name: (what is wrong, code, what the sentence must name)
    OTHER_FRAME: (lambda *all_right: all_right, 'axes-of-sensor', 'set frame to {frame}'),
    'upside down': (turned(180, 0, 0, True), 'sensor-turned', 'set mounting_deg to [180, 0, 0]'),
    'upside down, corrected': (turned(180, 0, 0, False), 'axes-of-sensor', 'set mounting_deg to [180, 0, 0]'),
    'turned by 90 deg': (turned(0, 0, 90, False), 'rates-turned', 'set mounting_deg to [0, 0, {quarter}]'),
    'turned by 180 deg': (turned(0, 0, 180, False), 'rates-turned', 'set mounting_deg to [0, 0, 180]'),
    'turned by 270 deg': (turned(0, 0, -90, False), 'rates-turned', 'set mounting_deg to [0, 0, {back}]'),
    'on its side': (turned(90, 0, 0, True), 'sensor-turned', 'set mounting_deg to [90, 0, 0]'),
    'on its side, corrected': (turned(90, 0, 0, False), 'axes-of-sensor', 'set mounting_deg to [90, 0, 0]'),
    'deg/s': (rates_times(180 / np.pi), 'rate-unit', 'the rate is in deg/s where rad/s is expected'),
    'g': (lambda a, r, f: (a, r, f / GRAVITY), 'accelerations-in-g', 'they are in g'),
    'rates reversed': (rates_times(-1.0), 'rate-sign', 'reverse the signs of the rates'),
    'roll rate reversed': (rates_times([-1.0, 1.0, 1.0]), 'rate-sign', 'the roll rate is the derivative'),
    'gyros exchanged': (lambda a, r, f: (a, r[:, [1, 0, 2]], f), 'rates-swapped', 'exchange the x and y gyroscopes'),
    'rates 0.4 s late': (lambda a, r, f: (a[4:], r[:-4], f[4:]), 'rate-late', 'after the'),
    'frozen after 20 s': (frozen_from(200), 'sensor-frozen', 'restart its driver'),
    'gyro 20 deg/s off': (lambda a, r, f: (a, r + np.radians([20, 0, 0]), f), 'rate-offset', 'calibrate the gyroscope'),
    'rates of another sensor': (
        lambda a, r, f: (a, np.random.default_rng(1).normal(0.0, 0.1, r.shape), f),
        'rate-unrelated',
        'does not follow it',
    ),
}
"""All at 10 Hz; corrected is what tells an orientation of the craft, whose rates and forces are the sensor's."""


@cache
def buoy(path):
    """Attitude, rates and specific force of the moored buoy's sensor, FRD in NED, at 10 Hz."""
    table = np.genfromtxt(path, delimiter=',', names=True)
    angles = np.column_stack([table[f'{name}_deg'] for name in ('yaw', 'pitch', 'roll')])
    rates = np.radians(np.column_stack([table[f'gyro_{part}_deg_s'] for part in 'xyz']))
    force = np.column_stack([table[f'accel_{part}_m_s2'] for part in 'xyz'])
    whole = np.isfinite(np.column_stack([angles, rates, force])).all(axis=1) & (np.abs(rates) < 35.0).all(axis=1)
    return Rotation.from_euler('ZYX', angles[whole], degrees=True), rates[whole], force[whole]


def readings_of(attitude, rates, force, interval_ns=100_000_000):
    """The messages of a sensor with these values."""
    known = diagonal(1e-6)
    parts = attitude.as_quat().tolist(), rates.tolist(), force.tolist()
    for k, (turn, rate, push) in enumerate(zip(*parts, strict=True)):
        yield ImuReading(10**18 + k * interval_ns, turn, known, rate, known, push, known)


def named_by(readings, installation, interval=0.1):
    """What a running sensor is found to contradict, judged once a second: code to (s until then, sentence)."""
    intake, check, found = Intake(installation, StampSettings()), InstallationCheck(installation), {}
    once_a_second = round(1.0 / interval)
    for k, reading in enumerate(readings):
        sample = intake.take(reading).sample
        if sample is not None:
            check.add(sample)
        if k % once_a_second == 0:
            for each in check.judge():
                found.setdefault(each.code, (k * interval, each.message))
    return found, check


def declared(frame, name):
    """How a sensor of this frame that is wrong in this way is said to sit."""
    return Installation({'frd': 'flu', 'flu': 'frd'}[frame] if name == OTHER_FRAME else frame)


def sentence(words, frame):
    """What a sentence must name of a sensor of this frame."""
    # a turn to starboard about an axis that points down is one to port about an axis that points up
    quarter = -90 if frame == 'frd' else 90
    return words.format(frame=frame, quarter=quarter, back=-quarter)
