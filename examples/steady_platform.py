"""A controller that keeps a platform level in roll from `forecast/horizon`, and unlocks its load in windows of calm.

    python examples/steady_platform.py          simulated seas, without ROS: the error with and without the forecast
    python examples/steady_platform.py --live   beside swath-sysid run: subscribes, and publishes platform/angle

The actuator answers after a pure delay, and its speed is limited.  At each step speeds are planned over the horizon
such that the platform is least off level, and the first is sent.  Without a forecast to be trusted the plan is the
present reading, and without a reading that changes it is level.
"""

import argparse
import sys
from collections import deque
from dataclasses import replace

import numpy as np
from craft_in_waves import STEP, simulated_craft
from scipy.optimize import lsq_linear

from swath_sysid import ForecasterSettings, run_through

DELAY = 0.4
"""s; a tenth of the period of the roll in these seas."""
SPEED, STEPS, EFFORT = np.radians(8.0), 10, 0.02
"""rad/s; steps that are planned; weight of a change of speed beside an error, s."""
LAG = DELAY + STEP
SILENT = 1.0
"""s without a new reading, after which there is none."""
SETTINGS = ForecasterSettings(leads=(round(LAG, 3),), horizon=5.0)
SUM, DIFFERENCE = np.tril(np.full((STEPS, STEPS), STEP)), np.eye(STEPS) - np.eye(STEPS, k=-1)


class Platform:
    """The commands on their way to an actuator, and where it will be when they have arrived."""

    def __init__(self):
        self.angle, self.arriving, self.speed = 0.0, deque([0.0] * round(DELAY / STEP)), 0.0

    def ahead(self):
        """Its angle after the delay, rad."""
        return self.angle + STEP * sum(self.arriving)

    def send(self, speed):
        """Command a speed, rad/s, and move on by one step."""
        self.speed = float(np.clip(speed, -SPEED, SPEED))
        self.arriving.append(self.speed)
        self.angle += STEP * self.arriving.popleft()


class Horizon:
    """The newest forecast of roll: times, s, means and how far ahead it is to be trusted."""

    def __init__(self, stamp, leads, roll, valid_lead):
        self.times, self.roll = stamp + leads, roll
        self.is_trusted = valid_lead >= LAG

    def at(self, times):
        """Roll at times, rad; None where it says that it is not to be trusted, or ends before."""
        if not self.is_trusted or times[0] > self.times[-1]:
            return None
        return np.interp(times, self.times, self.roll)


def speed_for(platform, wanted):
    """The first of the speeds, rad/s, that bring a platform nearest to what is wanted after the delay."""
    matrix = np.vstack([SUM, EFFORT * DIFFERENCE])
    before = EFFORT * platform.speed * np.eye(STEPS)[0]
    return lsq_linear(matrix, np.concatenate([wanted - platform.ahead(), before]), (-SPEED, SPEED)).x[0]


def command(platform, time, reading, horizon):
    """The speed to send at a time, s, with the reading of then, rad, and the newest `Horizon`, where there are any."""
    wanted = None if horizon is None else horizon.at(time + DELAY + STEP * np.arange(1, STEPS + 1))
    return ((reading or 0.0) - platform.ahead()) / STEP if wanted is None else speed_for(platform, wanted)


def hold(trial, truth, steps):
    """Times, s, and what is left of the roll, {controlled by: rad}."""
    platforms = {name: Platform() for name in ('reading', 'reading and rate', 'forecast')}
    left, coming, horizon = {name: [] for name in platforms}, deque(steps), None
    changed, before = trial.time[0], None
    for time, reading, rate, roll in zip(trial.time, trial.roll, trial.roll_rate, truth.roll, strict=True):
        while coming and coming[0].stamp <= time + 1e-6:
            step = coming.popleft()
            valid = step.outlook.valid_leads.get('roll', 0.0)
            horizon = Horizon(step.stamp, step.horizon.leads, step.horizon.angle('roll'), valid)
        changed, before = (changed if reading == before else time), reading
        for name, platform in platforms.items():
            left[name].append(roll - platform.angle)
        platforms['reading'].send((reading - platforms['reading'].ahead()) / STEP)
        extrapolated = reading + LAG * rate - platforms['reading and rate'].ahead()
        platforms['reading and rate'].send(extrapolated / STEP)
        platforms['forecast'].send(
            command(platforms['forecast'], time, reading if time - changed < SILENT else None, horizon)
        )
    return trial.time, {name: np.array(values) for name, values in left.items()}


def frozen(trial, begin, end):
    """A record whose sensor repeats itself from one time to another, s."""
    stuck = (trial.time >= begin) & (trial.time < end)
    last = np.flatnonzero(stuck)[0]
    return replace(trial, **{name: np.where(stuck, values[last], values) for name, values in trial.channels.items()})


def errors(seed, fault=None, duration=300.0, warmup=120.0):
    """RMS of what is left, deg, {controlled by: deg}: after the warm-up, or over a fault and 20 s after it."""
    truth = simulated_craft(duration, seed)
    trial = truth if fault is None else frozen(truth, *fault)
    time, left = hold(trial, truth, [step for step in run_through(trial, SETTINGS).steps if step.horizon is not None])
    begin, end = (warmup, duration) if fault is None else (fault[0], fault[1] + 20.0)
    counted = (time >= begin) & (time < end)
    return {name: float(np.degrees(np.sqrt(np.mean(values[counted] ** 2)))) for name, values in left.items()}


def live(args=None):
    """Hold the platform from what the nodes publish, until Ctrl-C."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from sensor_msgs.msg import Imu, JointState
    from std_msgs.msg import Bool, Float64
    from trajectory_msgs.msg import JointTrajectory

    from swath_sysid.attitude.motion.attitude import euler_angles
    from swath_sysid.formats.messages import SECOND_NS, stamp_ns

    rclpy.init(args=args)
    node, platform = rclpy.create_node('steady_platform'), Platform()
    heard = {'reading': None, 'at': -np.inf, 'valid': 0.0, 'horizon': None, 'calm': (np.inf, np.inf)}
    angle, unlocked = (
        node.create_publisher(Float64, 'platform/angle', 1),
        node.create_publisher(Bool, 'platform/unlocked', 1),
    )

    def seconds(time):
        return stamp_ns(time) / SECOND_NS

    def on_next(message):
        turn = message.orientation
        heard['reading'], heard['at'] = euler_angles(turn.x, turn.y, turn.z, turn.w)[0], seconds(message.header.stamp)

    def on_outlook(message):
        heard['valid'] = dict(zip(message.name, message.position, strict=True)).get('valid_lead.roll', 0.0)

    def on_horizon(message):
        # no roll in it where none is measured
        places = [place for place, name in enumerate(message.joint_names) if name == 'roll']
        leads = np.array([seconds(point.time_from_start) for point in message.points])
        rolls = [[point.positions[place] for point in message.points] for place in places]
        new = [Horizon(seconds(message.header.stamp), leads, np.array(roll), heard['valid']) for roll in rolls]
        heard['horizon'] = new[0] if new else None

    def on_calm(message):
        ends = [seconds(message.header.stamp) + seconds(point.time_from_start) for point in message.points]
        heard['calm'] = tuple(ends) or (np.inf, np.inf)

    def on_step():
        now = node.get_clock().now().nanoseconds / SECOND_NS
        reading = heard['reading'] if now - heard['at'] < SILENT else None
        platform.send(command(platform, now, reading, heard['horizon']))
        angle.publish(Float64(data=float(platform.angle)))
        unlocked.publish(Bool(data=bool(heard['calm'][0] <= now <= heard['calm'][1])))

    for kind, topic, take in (
        (Imu, 'forecast/next', on_next),
        (JointState, 'forecast/outlook', on_outlook),
        (JointTrajectory, 'forecast/horizon', on_horizon),
    ):
        node.create_subscription(kind, topic, take, 1)
    latched = rclpy.qos.QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(JointTrajectory, 'forecast/calm', on_calm, latched)
    node.create_timer(STEP, on_step)
    try:
        print('following forecast/horizon; Ctrl-C ends it', flush=True)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0


def main():
    """Print the errors in simulated seas, or hold the platform live."""
    parser = argparse.ArgumentParser(description='A platform that is kept level by the forecast.')
    parser.add_argument('--live', action='store_true', help='subscribe to the nodes, until Ctrl-C')
    parser.add_argument('--seeds', type=int, nargs='+', default=[1], help='of the simulated seas (default: 1)')
    parser.add_argument('--duration', type=float, default=200.0, metavar='S', help='default: %(default)s')
    arguments, others = parser.parse_known_args()
    if arguments.live:
        return live(others)
    print(f'{"error, deg RMS":16}' + ''.join(f'{name:>18}' for name in ('reading', 'reading and rate', 'forecast')))
    half = 0.5 * arguments.duration
    for fault, words in ((None, ''), ((half, half + 20.0), ', frozen for 20 s')):
        for seed in arguments.seeds:
            found = errors(seed, fault, arguments.duration, 0.4 * arguments.duration)
            print(f'{f"seed {seed}{words}":16}' + ''.join(f'{value:18.2f}' for value in found.values()))
    return 0


if __name__ == '__main__':
    sys.exit(main())
