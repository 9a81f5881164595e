"""A bench for tests over DDS: it runs the nodes in processes of their own, is their sensor, and hears them."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from contextlib import contextmanager, suppress
from pathlib import Path

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from package_process import PATIENCE, environment, wait_for
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import Float32, Float64MultiArray, String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from swath_sysid.nodes.executor_loop import events_executor

SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
SEND_RATE = 600.0
"""Messages a second of wall clock, whatever their stamps say."""

PORTION = 250
"""Messages that are sent at once: what waits beyond 500 at a process that gets no time is lost, as with any sensor."""

# read by every participant, here and in the processes started
os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(Path(__file__).with_name('fast_discovery.xml')))

HEARD = {
    'forecast/next': (Imu, RELIABLE),
    'forecast/lead_0_5s': (Imu, RELIABLE),
    'forecast/horizon': (JointTrajectory, RELIABLE),
    'motion/window': (PointCloud2, LATCHED),
    'model/description': (String, LATCHED),
    'model/coefficients': (Float64MultiArray, LATCHED),
    'identifier/progress': (Float32, RELIABLE),
}


def start(*words, ros_args=()):
    given = '--ros-args', '-p', 'diagnostics_period_s:=0.1', *ros_args
    pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT, 'text': True}
    return subprocess.Popen([sys.executable, *words, *given], env=environment(), **pipes)


def settings(*values):
    return [word for value in values for word in ('-p', value)]


def start_together(*ros_args):
    return start('-m', 'swath_sysid.cli.main', 'run', ros_args=ros_args)


def start_node(name, *ros_args):
    return start('-m', 'swath_sysid.nodes', name, ros_args=ros_args)


def children(pid):
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            state, parent = stat.read_text().rpartition(')')[2].split()[:2]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(parent) == pid and state != 'Z':
            found.append(int(stat.parent.name))
    return found


def stop(process, number=signal.SIGINT, times=1):
    """Stop a process by signals, a tenth of a second apart; its exit code and output."""
    for _ in range(times):
        if process.poll() is None:
            process.send_signal(number)
        time.sleep(0.1)
    output, _ = process.communicate(timeout=PATIENCE)
    return process.returncode, output


class Spinning:
    """A node spun in a thread of its own until it is closed, or paused for good."""

    def __init__(self, node, context=None):
        self._node, self._executor = node, events_executor(context=context)
        self._executor.add_node(node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        while not self._stop.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def pause(self):
        self._stop.set()
        self._thread.join()

    def close(self):
        self.pause()
        self._executor.shutdown()
        self._node.destroy_node()


def take(node, message):
    """Have a node handle a message at once."""
    node.inbox.put(message)
    node.work(60.0)


class Bench:
    """A node that publishes IMU messages and keeps what the nodes publish."""

    def __init__(self, namespace='', imu_topic='imu/data'):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('bench', context=self.context, namespace=namespace)
        self.heard = defaultdict(list)
        self.statuses = {}
        self.reports = 0
        self.imu = self.publisher(Imu, imu_topic)
        for topic, (kind, qos) in HEARD.items():
            self.node.create_subscription(kind, topic, self.heard[topic].append, qos)
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, RELIABLE)
        self._clients = {}
        self._spinning = Spinning(self.node, self.context)

    def close(self):
        self._spinning.close()
        rclpy.shutdown(context=self.context)

    def publisher(self, kind, topic, qos=SENSOR):
        return self.node.create_publisher(kind, topic, qos)

    @contextmanager
    def another_node(self):
        """One that comes and goes; nobody spins it: what ends while it is spun can end the thread that spins."""
        node = rclpy.create_node('another', context=self.context, namespace=self.node.get_namespace())
        try:
            yield node
        finally:
            node.destroy_node()

    def _on_diagnostics(self, message):
        for status in message.status:
            self.statuses[status.name] = status.level[0], status.message, {v.key: v.value for v in status.values}
        self.reports += 1

    # --- the sensor

    def status_name(self, node, status='imu'):
        """The name of a node's status in the namespace of the bench."""
        return f'{self.node.get_namespace()}/{node}: {status}'.lstrip('/')

    def connect(self, listeners=2):
        """Wait until the nodes hear the sensor and are heard."""
        wait_for(lambda: self.imu.get_subscription_count() >= listeners, 'subscriptions to the IMU')
        names = {self.status_name(name) for name in ('imu_buffer', 'predictor')}
        wait_for(lambda: names <= set(self.statuses), 'diagnostics')
        topic = self.node.resolve_topic_name('forecast/next')
        wait_for(lambda: self.node.count_publishers(topic) and self.node.count_subscribers(topic), 'forecast/next')

    def send(self, readings, publisher=None):
        begun, count, before = time.monotonic(), 0, self._received()
        for count, reading in enumerate(readings, 1):
            (publisher or self.imu).publish(imu_message(reading))
            wait = begun + count / SEND_RATE - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            if count % PORTION == 0:
                wait_for(
                    lambda count=count: all(now - before[name] >= count for name, now in self._received().items()),
                    f'{count} messages at the nodes',
                )
        return count

    def _received(self):
        """How many messages the nodes have received, by those that hear the sensor."""
        nodes = [name for name in ('imu_buffer', 'predictor') if self.status_name(name) in self.statuses]
        return {name: self.counts(name)['received'] for name in nodes}

    def counts(self, node, status='imu'):
        """The values of a status as numbers, those that are."""
        found = {}
        for key, value in self.statuses[self.status_name(node, status)][2].items():
            with suppress(ValueError):
                found[key] = float(value)
        return found

    def newest_stamp(self):
        heard = self.heard['forecast/next']
        return stamp_ns(heard[-1]) if heard else 0

    def wait_for_forecast_after(self, stamp, seconds=PATIENCE):
        """Wait until the newest forecast is that for the time just after a stamp, ns."""
        wait_for(lambda: 0 < self.newest_stamp() - stamp < 200_000_000, 'forecast from the newest sample', seconds)

    def settle(self, node, received):
        wait_for(lambda: self.counts(node)['received'] >= received, f'{received} messages at {node}')

    # --- services

    def call(self, name, kind=Trigger, request=None, seconds=PATIENCE):
        return self.wait_for_answer(self.call_async(name, kind, request), name, seconds)

    def call_async(self, name, kind=Trigger, request=None):
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
            wait_for(self._clients[name].service_is_ready, f'service {name}')
        return self._clients[name].call_async(request or kind.Request())

    def wait_for_answer(self, future, name, seconds=PATIENCE):
        wait_for(future.done, f'answer from {name}', seconds)
        return future.result()

    def set_parameters(self, node, **values):
        """Set parameters one by one; the reasons for which they were refused."""
        parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParameters.Request(parameters=parameters)
        answer = self.call(f'{node}/set_parameters', SetParameters, request)
        return [result.reason for result in answer.results if not result.successful]

    def describe_parameters(self, node, names):
        request = DescribeParameters.Request(names=list(names))
        return self.call(f'{node}/describe_parameters', DescribeParameters, request).descriptors


@contextmanager
def running(bench, process, listeners=2):
    """A process whose nodes hear the bench; ended by Ctrl-C, with exit code 0."""
    try:
        bench.connect(listeners)
        yield process
    except BaseException:
        process.kill()
        print(process.communicate()[0])
        raise
    code, output = stop(process)
    assert code == 0, output


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def imu_message(reading):
    message = Imu()
    message.header.frame_id = 'imu_link'
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(reading.stamp_ns, 10**9)
    turn, rates, force = message.orientation, message.angular_velocity, message.linear_acceleration
    turn.x, turn.y, turn.z, turn.w = reading.orientation
    rates.x, rates.y, rates.z = reading.rates
    force.x, force.y, force.z = reading.force
    message.orientation_covariance[:] = reading.orientation_covariance
    message.angular_velocity_covariance[:] = reading.rates_covariance
    message.linear_acceleration_covariance[:] = reading.force_covariance
    return message
