"""A sample's way through the house, traced at run time: files entered and changes of room.

From the callback of the node predictor to the publisher of forecast/next, to the end of the callback, and to the end
of a callback in which the leads are due. A room is a folder; a change is a file of another room than the one entered
before, each file where it is first entered. Compiled kernels leave no trace.

    python benchmark/walk.py
    python benchmark/walk.py --files
"""

import argparse
import math
import sys
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy.publisher import Publisher
from sensor_msgs.msg import Imu

import swath_sysid
from swath_sysid.attitude.prediction.forecaster import Forecaster
from swath_sysid.nodes.predictor import Predictor

HOUSE = Path(swath_sysid.__file__).parent
RATE = 100
"""Hz."""

WALKED = 200
"""Callbacks that are traced, after as many seconds as are needed for the sea to be learnt."""

LEARNT = 15
"""s."""


class Walk:
    """The files that one callback enters, in order, and how many calls it makes."""

    def __init__(self):
        self.files, self.calls, self.until_published, self.has_leads = [], 0, None, False

    def __call__(self, frame, event, _):
        """Take note of a call; see sys.setprofile."""
        if event != 'call':
            return
        if frame.f_code is Publisher.publish.__code__ and self.until_published is None:
            self.until_published = list(self.files), self.calls
        self.has_leads |= frame.f_code is Forecaster._issue.__code__
        name = frame.f_code.co_filename
        if name.startswith(str(HOUSE)):
            self.calls += 1
            place = Path(name).relative_to(HOUSE)
            if place not in self.files:
                self.files.append(place)


def message(number):
    """A sample of a craft that rolls and pitches."""
    made, time = Imu(), number / RATE
    made.header.stamp.sec, made.header.stamp.nanosec = divmod(round(time * 1e9), 10**9)
    roll, pitch = 0.05 * math.sin(1.7 * time), 0.03 * math.sin(1.1 * time)
    made.orientation.x, made.orientation.y, made.orientation.w = 0.5 * roll, 0.5 * pitch, 1.0
    made.angular_velocity.x = 0.085 * math.cos(1.7 * time)
    made.angular_velocity.y = 0.033 * math.cos(1.1 * time)
    made.linear_acceleration.z = 9.81
    for covariance in (made.orientation_covariance, made.angular_velocity_covariance):
        covariance[[0, 4, 8]] = 1e-6
    return made


def walks():
    """One walk of each kind: with and without leads."""
    rclpy.init(args=['--ros-args', '-p', 'in_step:=true'])
    node, kinds = Predictor(), {}
    try:
        for number in range(LEARNT * RATE + WALKED):
            sample, walk = message(number), Walk()
            if number >= LEARNT * RATE:
                sys.setprofile(walk)
            node.inbox.put(sample)
            node.work(60.0)
            sys.setprofile(None)
            if walk.until_published is not None:
                kinds.setdefault(walk.has_leads, []).append(walk)
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return {is_due: min(found, key=lambda walk: len(walk.files)) for is_due, found in kinds.items()}


def show(name, files, calls, is_listed):
    """Print one line and, if asked for, the files."""
    rooms = [str(file.parent) for file in files]
    changes = sum(a != b for a, b in pairwise(rooms))
    print(f'{name:32} {len(files):3} files, {changes:2} changes of room, {calls:4} calls')
    for file in files if is_listed else ():
        print(f'    {file}')


def main():
    """Print the ways."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--files', action='store_true', help='list the files in the order in which they are entered')
    is_listed = parser.parse_args().files
    found = walks()
    show('to the publisher', *found[False].until_published, is_listed)
    show('the whole callback', found[False].files, found[False].calls, is_listed)
    show('the whole callback with leads', found[True].files, found[True].calls, is_listed)


if __name__ == '__main__':
    main()
