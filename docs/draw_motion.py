"""Draws the moving pictures of the README, light and dark, from a live run: `python docs/draw_motion.py`.

It needs rclpy, as the nodes do, and takes about two minutes. Pushed, the craft decays without a known hull; the nodes
identify the hull; pushed again, its forecasts follow the motion. The picture begins there.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

os.environ |= {'ROS_DOMAIN_ID': str(random.randint(1, 100)), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}

import rclpy  # noqa: E402
from matplotlib.animation import FuncAnimation, PillowWriter  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, qos_profile_sensor_data  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

from swath_sysid.attitude.motion.attitude import euler_angles  # noqa: E402
from swath_sysid.common.processes import verb_command  # noqa: E402
from swath_sysid.formats.messages import stamp_ns  # noqa: E402
from swath_sysid.formats.model_file import model_from_yaml  # noqa: E402
from swath_sysid.report.figures import (  # noqa: E402
    BAND,
    MEASURED,
    MODEL,
    loaded_matplotlib,
    new_figure,
    quiet,
    use_plain_style,
)

#: Picture to the colours of its ground and ink.
PICTURES = {'motion.gif': ('#ffffff', MEASURED), 'motion_dark.gif': ('#0d1117', '#e6edf3')}
GROUNDS = 'figure.facecolor', 'axes.facecolor'
INKS = 'text.color', 'axes.labelcolor', 'axes.edgecolor', 'xtick.color', 'ytick.color'
RELEASED = 3.0  #: s after a push, when the craft swings freely.
PAST, AHEAD = 8.0, 5.0
FRAMES_PER_SECOND, SPEED = 10, 1.5
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


class Watcher(Node):
    """Keeps the measured roll, the horizons and the first model, with stamps in seconds."""

    def __init__(self):
        super().__init__('watcher')
        self.roll, self.horizons, self.model, self.lifted = [], [], None, []
        self.create_subscription(Imu, 'imu/data', self._on_imu, qos_profile_sensor_data)
        self.create_subscription(JointTrajectory, 'forecast/horizon', self._on_horizon, 10)
        self.create_subscription(String, 'model/description', self._on_model, LATCHED)
        self.client = self.create_client(Trigger, 'simulated_craft/release')

    def _on_imu(self, message):
        turn = message.orientation
        angle = euler_angles(turn.x, turn.y, turn.z, turn.w)[0]
        self.roll.append((stamp_ns(message.header.stamp) / 1e9, np.degrees(angle)))

    def _on_horizon(self, message):
        if {'roll', 'roll_std'} <= set(message.joint_names):
            columns = [message.joint_names.index(name) for name in ('roll', 'roll_std')]
            rows = [(stamp_ns(p.time_from_start) / 1e9, *(p.positions[c] for c in columns)) for p in message.points]
            ahead, *values = np.array(rows).T
            self.horizons.append((stamp_ns(message.header.stamp) / 1e9, ahead, *np.degrees(values)))

    def _on_model(self, message):
        known = model_from_yaml(message.data) if message.data else {}
        if 'roll' in known and self.model is None:
            self.model = self.roll[-1][0], known['roll']

    def until(self, is_done, patience=120.0):
        """Spin until something is so."""
        deadline = time.monotonic() + patience
        while not is_done():
            rclpy.spin_once(self, timeout_sec=0.05)
            if time.monotonic() > deadline:
                raise SystemExit('the nodes did not do what the picture is to show; see above')

    def after(self, seconds):
        """Spin for seconds of the sensor's stamps."""
        end = self.roll[-1][0] + seconds
        self.until(lambda: self.roll[-1][0] >= end)

    def push(self):
        """Have the craft lifted and let go."""
        self.lifted.append(self.roll[-1][0])
        self.client.call_async(Trigger.Request())


def recorded():
    """What the nodes published from shortly before the first push to ten seconds after the second release."""
    rclpy.init()
    nodes = subprocess.Popen(verb_command('run', '--simulate', 'swath-roll'), stdout=sys.stderr)
    watcher = Watcher()
    try:
        watcher.until(lambda: len(watcher.horizons) > 20 and watcher.client.service_is_ready())
        watcher.after(4.0)
        watcher.push()
        watcher.until(lambda: watcher.model is not None)
        watcher.after(3.0)
        watcher.push()
        watcher.after(12.0)
    finally:
        nodes.send_signal(signal.SIGINT)
        nodes.wait()
        rclpy.shutdown()  # gives Ctrl-C back to the drawing
    return watcher


def caption(seen, now):
    """What happens at a time."""
    first, second = seen.lifted
    model_time, known = seen.model
    if now >= second:
        return '4  Pushed again: the forecast now knows the hull'
    if now >= model_time:
        return f'3  Hull identified: natural period {known.model.natural_period:.2f} s, {known.verdict}'
    if now >= first:
        return '2  Pushed and released: the decay is recorded' if now >= first + RELEASED else '1  Pushed'
    return '0  At rest, hull unknown'


def draw(seen, path, ground, ink):
    """A moving picture in two colours, beside those of the forecast."""
    figure = new_figure(6.4, 3.2)
    axes = quiet(figure.subplots())
    time_, roll = np.array(seen.roll).T
    stamps = np.array([horizon[0] for horizon in seen.horizons])
    reach = 1.3 * np.abs(roll).max()
    start, end = seen.lifted[0] - 2.0, time_[-1]
    moments = np.arange(start, end, SPEED / FRAMES_PER_SECOND)
    moments = np.roll(moments, -np.searchsorted(moments, seen.lifted[1] + RELEASED))

    def frame(now):
        axes.clear()
        quiet(axes)
        past = (time_ <= now) & (time_ >= now - PAST)
        ahead = (time_ > now) & (time_ <= now + AHEAD)
        _, leads, middle, std = seen.horizons[max(0, np.searchsorted(stamps, now, side='right') - 1)]
        axes.fill_between(
            leads,
            middle - 1.645 * std,
            middle + 1.645 * std,
            color=BAND,
            alpha=0.6 if ground == '#ffffff' else 0.3,
            linewidth=0,
        )
        axes.plot(time_[past] - now, roll[past], color=ink, linewidth=1.6, label='measured')
        axes.plot(time_[ahead] - now, roll[ahead], color=ink, linewidth=1.0, linestyle=':', label='what came')
        axes.plot(leads, middle, color=MODEL, linewidth=2.0, label='forecast and its 90 % interval')
        axes.axvline(0.0, color=ink, linewidth=0.8)
        axes.set(xlim=(-PAST, AHEAD), ylim=(-reach, reach), xlabel='time from now [s]', ylabel='roll [deg]')
        axes.set_title(caption(seen, now), loc='left')
        axes.legend(loc='lower left', fontsize=9, frameon=False, ncols=3)
        return ()

    FuncAnimation(figure, frame, moments).save(path, PillowWriter(fps=FRAMES_PER_SECOND), dpi=110)


if __name__ == '__main__':
    run = recorded()
    use_plain_style()
    for name, (ground, ink) in PICTURES.items():
        path = Path(__file__).with_name(name)
        colours = {**dict.fromkeys(GROUNDS, ground), **dict.fromkeys(INKS, ink)}
        with loaded_matplotlib().rc_context(colours):
            draw(run, path, ground, ink)
        print(f'wrote {path}, {path.stat().st_size / 1e6:.1f} MB')
