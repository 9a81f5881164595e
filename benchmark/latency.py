"""The live pipeline against its figures, over real DDS with simulated IMU messages.

    python benchmark/latency.py                      delay, 1000 Hz, refit: about four minutes
    python benchmark/latency.py delay --rates 100 400 --seconds 20
    python benchmark/latency.py throughput --seconds 60
    python benchmark/latency.py refit
    python benchmark/latency.py memory --minutes 12

delay:      IMU publish to forecast/next at a subscriber, the three nodes in processes of their own,
            against a bare relay (subscribe, republish) in the same run
throughput: the three nodes in one process at 1000 Hz: loss and load
refit:      longest gap in forecast/next while windows of 60 s at 100 Hz are refitted
memory:     resident memory of the one process at 200 Hz, with a refit every half minute
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
TICKS = os.sysconf('SC_CLK_TCK')
RELEASE_S = 4.0
DECAY_S = 30.0
PERIOD_S, DAMPING, AMPLITUDE = 2.6, 0.06, 0.1


def environment():
    """The environment of every process: a domain of its own, this machine only."""
    return {
        **os.environ,
        'PYTHONPATH': os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH')])),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': os.environ.get('ROS_DOMAIN_ID') or str(random.SystemRandom().randint(1, 100)),
        'OMP_NUM_THREADS': '1',
    }


@contextmanager
def process(*words, environment):
    """A process of ours, ended like by Ctrl-C; its exit code must be 0."""
    child = subprocess.Popen([sys.executable, *words], env=environment, cwd=ROOT)
    try:
        yield child
    finally:
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
        if child.wait(10) != 0:
            print(f'{" ".join(words)} ended with code {child.returncode}', file=sys.stderr)


def background(words, env):
    """A process of ours that ends by itself."""
    return subprocess.Popen([sys.executable, *words], env=env, cwd=ROOT)


def role(name, **options):
    """Words that start this file in a role."""
    return [__file__, '--role', name, '--options', json.dumps(options)]


def all_in_one():
    return ['-m', 'swath_sysid.cli.main', 'run']


def node(name):
    return ['-m', 'swath_sysid.nodes', name]


def processor_seconds(pid):
    """Processor time of a process so far, s."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def resident_mb(pid):
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1]) / 1024


# --- roles: what the other processes do


def imu_values(time_s):
    """Pitch, its rate: held, released, decaying, over and over; rad, rad/s."""
    t = time_s % DECAY_S - RELEASE_S
    if t < 0.0:
        return AMPLITUDE * min(1.0, (t + RELEASE_S) / 2.0), AMPLITUDE / 2.0 if t < -2.0 else 0.0
    w = 2.0 * np.pi / PERIOD_S
    fall = AMPLITUDE * np.exp(-DAMPING * w * t)
    return fall * np.cos(w * t), -w * fall * (DAMPING * np.cos(w * t) + np.sin(w * t))


def serve_source(rate, seconds, subscribers, output):
    """Publishes simulated IMU messages on even stamps and notes when; ends early at SIGTERM."""
    import rclpy
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu

    rclpy.init()
    ended = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(True))
    node = rclpy.create_node('source')
    publisher = node.create_publisher(Imu, 'imu/data', qos_profile_sensor_data)
    while publisher.get_subscription_count() < subscribers and not ended:
        time.sleep(0.05)
    time.sleep(1.5)  # the nodes' own connections
    count, period = int(rate * seconds), round(1e9 / rate)
    noise = np.random.default_rng(1).normal(0.0, 1.0, (count, 2)) * (1e-3, 5e-3)
    message = Imu()
    message.orientation_covariance[:] = [1e-6, 0, 0, 0, 1e-6, 0, 0, 0, 1e-6]
    message.angular_velocity_covariance[:] = [2.5e-5, 0, 0, 0, 2.5e-5, 0, 0, 0, 2.5e-5]
    message.linear_acceleration.z = 9.81
    sent = np.zeros((count, 2), dtype=np.int64)
    first_stamp, begun = time.time_ns(), time.monotonic_ns()
    for k in range(count):
        pitch, pitch_rate = imu_values(k / rate)
        half = 0.5 * (pitch + noise[k, 0])
        message.orientation.y, message.orientation.w = float(np.sin(half)), float(np.cos(half))
        message.angular_velocity.y = float(pitch_rate + noise[k, 1])
        stamp = first_stamp + k * period
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        wait = begun + k * period - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)
        if ended:
            sent = sent[:k]
            break
        sent[k] = stamp, time.monotonic_ns()
        publisher.publish(message)
    np.save(output, sent)
    time.sleep(1.0)
    node.destroy_node()
    rclpy.shutdown()


def serve_relay():
    """A bare relay: subscribe, republish."""
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu

    from swath_sysid.nodes.executor_loop import events_executor, run
    from swath_sysid.nodes.qos import NEWEST

    class Relay(Node):
        def __init__(self):
            super().__init__('relay')
            publisher = self.create_publisher(Imu, 'relayed', NEWEST)
            self.create_subscription(Imu, 'imu/data', publisher.publish, qos_profile_sensor_data)

    return run([(events_executor, [Relay])])


def serve_sink(topics, output):
    """Notes stamp and arrival of every message on some Imu topics, and the last diagnostics."""
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Imu

    from swath_sysid.nodes.executor_loop import events_executor, run

    arrivals, statuses = {topic: [] for topic in topics}, {}

    class Sink(Node):
        def __init__(self):
            super().__init__('sink')
            for topic in topics:
                self.create_subscription(Imu, topic, self.noting(arrivals[topic]), QoSProfile(depth=2000))
            self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)

        def noting(self, into):
            def on_message(message):
                now = time.monotonic_ns()
                into.append((message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec, now))

            return on_message

        def on_diagnostics(self, message):
            for status in message.status:
                statuses[status.name] = {value.key: value.value for value in status.values}

    code = run([(events_executor, [Sink])])
    np.savez(output, **{t.replace('/', '_'): np.array(a, np.int64).reshape(-1, 2) for t, a in arrivals.items()})
    Path(output).with_suffix('.json').write_text(json.dumps(statuses))
    return code


def serve_refits(every, seconds):
    """Calls identifier's ~/identify again and again and prints its answers."""
    import rclpy
    from std_srvs.srv import Trigger

    rclpy.init()
    node = rclpy.create_node('caller')
    client = node.create_client(Trigger, 'identifier/identify')
    client.wait_for_service(20.0)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(max(0.0, min(every, end - time.monotonic())))
        begun = time.monotonic()
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, future, timeout_sec=20.0)
        if future.result() is not None:
            print(f'  refit took {time.monotonic() - begun:.2f} s: {future.result().message}', flush=True)
    node.destroy_node()
    rclpy.shutdown()


# --- what is measured


def delays(sent, arrived, ahead_ns):
    """Delay of each message from its source, ms; those lost are left out."""
    sent_at = dict(sent.tolist())
    found = [(at - sent_at[stamp]) * 1e-6 for stamp, at in shifted(arrived, sent, ahead_ns) if stamp in sent_at]
    return np.array(found)


def shifted(arrived, sent, ahead_ns):
    """Stamps of arrivals brought back to the grid of the source's."""
    first, period = int(sent[0, 0]), int(sent[1, 0] - sent[0, 0])
    for stamp, at in arrived.tolist():
        yield first + round((stamp - ahead_ns - first) / period) * period, at


def percentiles(values):
    return f'median {np.median(values):6.3f}  p99 {np.percentile(values, 99):7.3f}  max {values.max():7.3f} ms'


def measure_delay(rates, seconds):
    """Forecast and relay side by side."""
    for rate in rates:
        env = environment()
        with tempfile.TemporaryDirectory() as folder:
            sent_file, sink_file = f'{folder}/sent.npy', f'{folder}/sink.npz'
            with (
                process(*node('imu_buffer'), environment=env),
                process(*node('identifier'), environment=env),
                process(*node('predictor'), environment=env) as predictor,
                process(*role('relay'), environment=env) as relay,
            ):
                with process(*role('sink', topics=['forecast/next', 'relayed'], output=sink_file), environment=env):
                    used = [processor_seconds(p.pid) for p in (predictor, relay)]
                    source = role('source', rate=rate, seconds=seconds, subscribers=3, output=sent_file)
                    subprocess.run([sys.executable, *source], env=env, check=True)
                    used = [processor_seconds(p.pid) - u for p, u in zip((predictor, relay), used, strict=True)]
            sent, arrived = np.load(sent_file), np.load(sink_file)
        skip = int(2 * rate)
        ours = delays(sent, arrived['forecast_next'], sent[1, 0] - sent[0, 0])[skip:]
        bare = delays(sent, arrived['relayed'], 0)[skip:]
        ratio, worse = np.median(ours) / np.median(bare), np.percentile(ours, 99) - np.percentile(bare, 99)
        print(
            f'{rate} Hz, {len(sent)} samples: arrived {len(arrived["forecast_next"])} forecasts, '
            f'{len(arrived["relayed"])} relayed'
        )
        print(f'  forecast/next  {percentiles(ours)}   processor {100 * used[0] / seconds:.0f} %')
        print(f'  bare relay     {percentiles(bare)}   processor {100 * used[1] / seconds:.0f} %')
        print(f'  median {ratio:.2f} times the relay (at most 2), p99 {worse:+.2f} ms of it (at most +2)', flush=True)


def measure_throughput(rate, seconds):
    """All in one process."""
    env = environment()
    with tempfile.TemporaryDirectory() as folder:
        sent_file, sink_file = f'{folder}/sent.npy', f'{folder}/sink.npz'
        with process(*all_in_one(), environment=env) as nodes:
            with process(*role('sink', topics=['forecast/next'], output=sink_file), environment=env):
                time.sleep(4.0)
                begun, used = time.monotonic(), processor_seconds(nodes.pid)
                source = role('source', rate=rate, seconds=seconds, subscribers=2, output=sent_file)
                subprocess.run([sys.executable, *source], env=env, check=True)
                used, wall = processor_seconds(nodes.pid) - used, time.monotonic() - begun
                time.sleep(1.5)
        sent, arrived = np.load(sent_file), np.load(sink_file)['forecast_next']
        statuses = json.loads(Path(sink_file).with_suffix('.json').read_text())
    span = (sent[-1, 1] - sent[0, 1]) * 1e-9
    print(
        f'{rate} Hz for {span:.1f} s in one process, {len(sent)} samples: predictor used '
        f'{statuses["predictor: imu"]["used"]}, buffer used {statuses["imu_buffer: imu"]["used"]}, '
        f'forecasts at the subscriber {len(arrived)} (one less than samples: the first has no interval yet)'
    )
    print(f'  {percentiles(delays(sent, arrived, sent[1, 0] - sent[0, 0]))}')
    print(f'  processor {100 * used / span:.0f} % of one core (at most 90) over {wall:.0f} s', flush=True)


def measure_refit(rate, seconds, every, together):
    """Gaps in forecast/next while refits run."""
    env = environment()
    programs = [all_in_one()] if together else [node(name) for name in ('imu_buffer', 'identifier', 'predictor')]
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        sent_file, sink_file = f'{folder}/sent.npy', f'{folder}/sink.npz'
        for program in programs:
            stack.enter_context(process(*program, environment=env))
        sink = role('sink', topics=['forecast/next'], output=sink_file)
        with process(*sink, environment=env):
            source = background(role('source', rate=rate, seconds=seconds, subscribers=2, output=sent_file), env)
            time.sleep(62.0)
            subprocess.run([sys.executable, *role('refits', every=every, seconds=seconds - 64.0)], env=env, check=True)
            source.wait()
        sent, arrived = np.load(sent_file), np.load(sink_file)['forecast_next']
    late = arrived[arrived[:, 1] > sent[0, 1] + 60e9]
    gaps, source_gaps = np.diff(late[:, 1]) * 1e-6, np.diff(sent[:, 1]) * 1e-6
    delay = delays(sent, late, sent[1, 0] - sent[0, 0])
    where = 'one process' if together else 'three processes'
    print(
        f'{rate} Hz, refits of 60 s every {every} s, {where}: longest gap in forecast/next {gaps.max():.1f} ms '
        f'(at most 30), p99.9 {np.percentile(gaps, 99.9):.1f}; of the source itself {source_gaps.max():.1f} ms, '
        f'longest delay of a forecast behind its sample {delay.max():.1f} ms'
    )


def measure_memory(rate, minutes):
    """Resident memory of the one process, a refit every half minute."""
    env = environment()
    seconds, held = 60.0 * minutes, []
    with tempfile.TemporaryDirectory() as folder, process(*all_in_one(), environment=env) as nodes:
        output = f'{folder}/sent.npy'
        source = background(role('source', rate=rate, seconds=seconds, subscribers=2, output=output), env)
        caller = background(role('refits', every=30.0, seconds=seconds), env)
        begun = time.monotonic()
        for minute in range(1, minutes + 1):
            time.sleep(max(0.0, begun + 60.0 * minute - time.monotonic()))
            held.append(resident_mb(nodes.pid))
            print(f'  minute {minute}: {held[-1]:.1f} MB', flush=True)
        source.wait()
        caller.wait()
    steady = np.array(held[1:])
    print(
        f'memory at {rate} Hz from minute 2 on: {steady.min():.1f} to {steady.max():.1f} MB, '
        f'{100 * (steady.max() / steady[0] - 1):+.1f} % of minute 2 (at most 2)'
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('what', nargs='*', default=['delay', 'throughput', 'refit'])
    parser.add_argument('--rates', type=int, nargs='+', default=[100, 400])
    parser.add_argument('--seconds', type=float)
    parser.add_argument('--minutes', type=int, default=12)
    parser.add_argument('--separate', action='store_true', help='refit: three processes instead of one')
    parser.add_argument('--role', help=argparse.SUPPRESS)
    parser.add_argument('--options', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.role:
        return globals()[f'serve_{arguments.role}'](**json.loads(arguments.options or '{}'))
    if 'delay' in arguments.what:
        measure_delay(arguments.rates, arguments.seconds or 20.0)
    if 'throughput' in arguments.what:
        measure_throughput(1000, arguments.seconds or 60.0)
    if 'refit' in arguments.what:
        measure_refit(100, max(arguments.seconds or 0.0, 90.0), 5.0, not arguments.separate)
    if 'memory' in arguments.what:
        measure_memory(200, arguments.minutes)
    return 0


if __name__ == '__main__':
    sys.exit(main())
