"""Replaying a bag: its messages as they are, with their own stamps, and /clock."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from swath_sysid.common.account import in_words
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bag_replay import ReplaySettings, Timeline, chosen_topics, merged_messages, recorded_topics
from swath_sysid.formats.bags import opened_bag
from swath_sysid.formats.messages import SECOND_NS, raw_stamp_ns, stamp_ns
from swath_sysid.formats.topics import NEXT_TOPIC, is_within
from swath_sysid.nodes.qos import BAG_DEPTH, NEWEST, bag_qos, message_class, time_message
from swath_sysid.pipeline.health import DISCOVERY

CLOCK_PERIOD = 0.01  #: s of wall clock between /clock messages.
SETTLING = 0.5  #: s from the last connection to the first message: the other side may still be making it.
AHEAD_NS = 2 * SECOND_NS  #: By which samples may be ahead of the forecasts: few enough to wait at the node.
PATIENCE = 5.0  #: s from one forecast to the next (rejected samples bring none), and for the last messages to arrive.


class Replay(Node):
    """Publishes the topics of a bag whose types are installed."""

    def __init__(self, path: str | Path, settings: ReplaySettings, should_stop: Callable[[], bool]):
        super().__init__('replay')
        self._path, self._replaying = path, settings
        self._should_stop = should_stop
        self._open = ExitStack()
        self.sent = 0
        self._clock_published = -CLOCK_PERIOD
        try:
            self._readers, self._losses = self._open.enter_context(opened_bag(path))
            recorded = recorded_topics(self._readers)
            self._recorded = chosen_topics(recorded, settings.topics)
            self.left_out = sorted(recorded.keys() - self._recorded.keys())
            classes = {topic: message_class(recorded.kind) for topic, recorded in self._recorded.items()}
            self.unknown_types = {self._recorded[topic].kind for topic, found in classes.items() if found is None}
            self.outlets = {topic: self._outlet(topic, found) for topic, found in classes.items() if found is not None}
            if not self.outlets:
                types = ', '.join(sorted(self.unknown_types)) or 'none'
                raise InputError(f'{path} holds no topic of an installed type ({types}): install their packages')
        except BaseException:
            self.destroy_node()
            raise
        self._forecast_ns = 0
        if settings.in_step:
            self.create_subscription(Imu, NEXT_TOPIC, self._on_forecast, NEWEST)
        self._clock_outlet = self.create_publisher(Clock, '/clock', 10) if settings.clock else None

    @property
    def advice(self) -> tuple[Advice, ...]:
        """What could not be read of the bag so far."""
        return in_words(self._losses, self._path)

    def destroy_node(self) -> None:
        """Also close the bag."""
        self._open.close()
        super().destroy_node()

    def _outlet(self, topic: str, kind: type) -> Publisher:
        is_latched, namespace = self._recorded[topic].is_latched, self.get_namespace()
        name = topic if is_within(namespace, topic) else f'{namespace.rstrip("/")}/{topic.lstrip("/")}'
        return self.create_publisher(kind, name, bag_qos(is_latched, depth=1 if is_latched else BAG_DEPTH))

    def wait_for_listeners(self) -> int:
        """Wait for as many subscribers as were set (else all): how many there are on the IMU or busiest topic."""
        deadline = time.monotonic() + self._replaying.wait
        settling = SETTLING if self._replaying.listeners else DISCOVERY
        before, changed = None, time.monotonic()
        while not self._should_stop():
            now = time.monotonic()
            # connected and known subscriptions of every topic
            connections = [
                (outlet.get_subscription_count(), self.count_subscribers(outlet.topic_name))
                for outlet in self.outlets.values()
            ]
            if connections != before:
                before, changed = connections, now
            listening = self._listening()
            complete = listening >= max(self._replaying.listeners, 1) and all(c == known for c, known in connections)
            if (complete and now >= changed + settling) or now >= deadline:
                return listening
            time.sleep(0.02)
        return self._listening()

    def _listening(self):
        imus = [topic for topic in self.outlets if self._recorded[topic].is_imu]
        return max(self.outlets[topic].get_subscription_count() for topic in imus or self.outlets)

    def play(self) -> None:
        """Publish everything at its time, once or over and over."""
        while not self._should_stop():
            self._play_once()
            if not self._replaying.loop:
                return

    def wait_until_received(self) -> None:
        """Wait, at most `PATIENCE`, until reliable subscriptions have the last messages: these end with the node."""
        deadline = time.monotonic() + PATIENCE
        for outlet in self.outlets.values():
            outlet.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))

    def _play_once(self) -> None:
        timeline: Timeline | None = None
        for time_ns, topic, raw in merged_messages(self._path, self._readers, self.outlets, self._losses):
            timeline = timeline or Timeline(time.monotonic(), time_ns, self._replaying.rate)
            if not self._wait_for(time_ns, timeline):
                return
            self._publish_clock(time_ns)
            self.outlets[topic].publish(raw)
            self.sent += 1
            if self._replaying.in_step and self._recorded[topic].is_imu:
                self._wait_for_forecast(raw)

    def _wait_for(self, time_ns: int, timeline: Timeline) -> bool:
        """Sleep until a message is due, publishing /clock meanwhile; False: stop."""
        due = timeline.wall_time(time_ns)
        while not self._should_stop() and (now := time.monotonic()) < due:
            self._publish_clock(timeline.bag_time(now))
            time.sleep(min(due - now, CLOCK_PERIOD))
        return not self._should_stop()

    def _publish_clock(self, time_ns: int) -> None:
        now = time.monotonic()
        if self._clock_outlet is not None and now >= self._clock_published + CLOCK_PERIOD:
            self._clock_published = now
            self._clock_outlet.publish(Clock(clock=time_message(time_ns)))

    def _on_forecast(self, message: Imu) -> None:
        self._forecast_ns = stamp_ns(message.header.stamp)

    def _wait_for_forecast(self, raw: bytes) -> None:
        """Wait until the forecasts are near the stamp of a serialised sample."""
        least_ns, deadline = raw_stamp_ns(raw) - AHEAD_NS, time.monotonic() + PATIENCE
        while self._forecast_ns < least_ns and time.monotonic() < deadline and not self._should_stop():
            before = self._forecast_ns
            rclpy.spin_once(self, timeout_sec=0.05)
            if self._forecast_ns > before:
                deadline = time.monotonic() + PATIENCE
