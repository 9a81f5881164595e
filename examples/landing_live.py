"""A record replayed over DDS into predictor, and what it published, as a drone would hear it."""

import math
import os
import random
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from craft_in_waves import NOTHING_FORECAST, Voyage, truth_of

import swath_sysid
from swath_sysid import InputError
from swath_sysid.attitude.motion.attitude import euler_angles, up_in_body
from swath_sysid.cli.progress import progress_of
from swath_sysid.cli.ros import ros_needed
from swath_sysid.evaluation.scoring import SENSOR
from swath_sysid.formats.bags import write_imu_bag
from swath_sysid.formats.messages import SECOND_NS, stamp_ns
from swath_sysid.formats.topics import CALM_TOPIC, point_lead_topic

START_NS = 1_700_000_000 * SECOND_NS
START_TIMEOUT_S, SILENCE_S, STOP_TIMEOUT_S = 120.0, 60.0, 30.0
UNKNOWN = math.nan, math.nan


class Listener:
    """Keeps the forecasts of landing by the time of issue.

    Parameters
    ----------
    leads : sequence of float
        s.
    """

    def __init__(self, leads):
        self.leads = leads
        self.at_lead = {lead: {} for lead in leads}
        self.calm = {}

    def on_lead(self, lead, message):
        """Take an Odometry, stamped for its lead: it has no place for the covariance of velocity and attitude."""
        q, linear = message.pose.pose.orientation, message.twist.twist.linear
        roll, pitch, _ = euler_angles(q.x, q.y, q.z, q.w)
        up = np.array(up_in_body(roll, pitch))
        of_pose, of_twist = (np.reshape(each.covariance, (6, 6)) for each in (message.pose, message.twist))
        mean, covariance = np.full(7, np.nan), np.full((7, 7), np.nan)
        mean[[0, 1, 3, 4]] = message.pose.pose.position.z, up @ (linear.x, linear.y, linear.z), roll, pitch
        covariance[1, 3:5] = covariance[3:5, 1] = 0.0
        covariance[1, 1], covariance[3:5, 3:5] = up @ of_twist[:3, :3] @ up, of_pose[3:5, 3:5]
        self.at_lead[lead][stamp_ns(message.header.stamp) - round(lead * SECOND_NS)] = mean, covariance

    def on_calm(self, message):
        """Take the window of calm."""
        ends = [point.time_from_start for point in message.points]
        self.calm[stamp_ns(message.header.stamp)] = tuple(stamp_ns(end) / SECOND_NS for end in ends) or UNKNOWN

    def voyage(self, trial, warmup):
        """What was published at all leads after the warm-up, s, where the truth is known."""
        truth = truth_of(trial)
        issued = np.array(sorted(set.intersection(*(set(heard) for heard in self.at_lead.values()))), dtype=np.int64)
        stamps = trial.time[0] + (issued - START_NS) / SECOND_NS
        known = np.isfinite(truth(stamps[:, None] + np.array([0.0, self.leads[-1]]))).all(axis=(1, 2))
        used = known & (stamps >= trial.time[0] + warmup)
        if not used.any():
            raise InputError(NOTHING_FORECAST)
        heard = [[self.at_lead[lead][stamp] for lead in self.leads] for stamp in issued[used].tolist()]
        mean, covariance = (np.array([[at[part] for at in each] for each in heard]) for part in (0, 1))
        calm = np.array([self.calm.get(stamp, UNKNOWN) for stamp in issued[used].tolist()])
        return Voyage(stamps[used], np.array(self.leads), mean, covariance, truth, calm)


def hear(trial, rate, parameters, leads, domain=None):
    """What predictor publishes of a record replayed at most at this many times real time.

    Parameters
    ----------
    trial : Trial
    rate : float
    parameters : str or Path
        The node's parameter file.
    leads : sequence of float
        Among those in it, s.
    domain : int, optional
        ROS domain, by default a random one.

    Returns
    -------
    Listener
    """
    os.environ |= {
        'ROS_DOMAIN_ID': str(domain or random.SystemRandom().randint(1, 100)),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONPATH': os.pathsep.join([str(Path(swath_sysid.__file__).parents[1]), os.environ.get('PYTHONPATH', '')]),
    }
    with ros_needed('without --live this needs no ROS'):
        import rclpy

        from swath_sysid.nodes.executor_loop import events_executor
    listener = Listener(leads)
    rclpy.init()
    node, executor, running = rclpy.create_node('drone'), events_executor(), []
    try:
        subscribe(node, listener)
        executor.add_node(node)
        with tempfile.TemporaryDirectory() as folder:
            end_ns = START_NS + round(SECOND_NS * (trial.time[-1] - trial.time[0]))
            bag = Path(folder) / 'record.mcap'
            write_imu_bag(bag, trial, start_stamp_ns=START_NS)
            in_step = '--use-sim-time', '--ros-args', '-p', 'in_step:=true'
            running.append(verb('run', '--only', 'predictor', '--params-file', parameters, *in_step))
            wait_for(lambda: node.count_publishers(CALM_TOPIC), executor, running)
            waiting = '--wait-for', 1, '--wait', START_TIMEOUT_S
            running.append(verb('replay', bag, '--clock', '--in-step', '--rate', rate, *waiting))
            with progress_of('replaying') as progress:
                spin_through(executor, listener, running[-1], end_ns, progress)
    finally:
        stop(running)
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return listener


def subscribe(node, listener):
    """Hear what a landing is decided by."""
    from nav_msgs.msg import Odometry
    from rclpy.qos import DurabilityPolicy, QoSProfile
    from trajectory_msgs.msg import JointTrajectory

    for lead in listener.leads:
        topic = point_lead_topic(SENSOR.name, lead)
        node.create_subscription(Odometry, topic, partial(listener.on_lead, lead), QoSProfile(depth=1000))
    latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(JointTrajectory, CALM_TOPIC, listener.on_calm, latched)


def verb(*words):
    """A verb in a process of its own."""
    return subprocess.Popen([sys.executable, '-P', '-m', 'swath_sysid.cli.main', *map(str, words)])


def stop(processes):
    """End processes that still run."""
    for process in processes:
        process.terminate()
        try:
            process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()


def wait_for(done, executor, running):
    """Until something is so, or a process has ended."""
    deadline = time.monotonic() + START_TIMEOUT_S
    while not done():
        if any(process.poll() is not None for process in running) or time.monotonic() > deadline:
            raise InputError('predictor did not start: see what it said above')
        executor.spin_once(timeout_sec=0.05)


def spin_through(executor, listener, replay, end_ns, progress):
    """Until the forecast of the record's last second has come, or none has for long after the replay."""
    newest, heard = START_NS, time.monotonic()
    while newest < end_ns - SECOND_NS and (replay.poll() is None or time.monotonic() < heard + SILENCE_S):
        executor.spin_once(timeout_sec=0.05)
        if newest < (now := max(listener.calm, default=START_NS)):
            newest, heard = now, time.monotonic()
            progress((newest - START_NS) / (end_ns - START_NS))
