"""Publishers and subscriptions with their QoS, the count of incompatible ones, and message classes by name."""

import importlib
import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from math import nan
from pathlib import Path
from time import perf_counter
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from swath_sysid.attitude.motion.stamps import NANOSECOND
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.formats.topics import IMU_TOPIC
from swath_sysid.pipeline.health import Reasons, StreamHealth

#: Reliable, transient local, depth 1: a late subscriber gets the last one.
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: Reliable, depth 1: a slow subscriber gets the newest forecast only.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)

#: The stock profile keeps ten requests only.
SERVICES = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)

SENSOR = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)  #: Connects with any publisher.

OVERRIDABLE = QoSOverridingOptions.with_default_policies()  #: By the parameters ``qos_overrides./TOPIC...``.

BAG_DEPTH = 1000  #: So long a queue that a bag loses nothing.

IMU_TYPE = 'sensor_msgs/msg/Imu'

THRUSTERS = {'port': 'thrusters/left/thrust', 'starboard': 'thrusters/right/thrust'}


def imu_subscription(node: Node, kind: type, callback: Callable, depth: int, health: Reasons) -> Subscription:
    """Subscribe to the sensor with sensor data QoS (best effort, volatile: fits any publisher) but a longer queue.
    With the stock depth of five, 2 % of the samples at 1000 Hz were lost when the machine paused for 5 ms.
    """
    qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    return watched_subscription(node, kind, IMU_TOPIC, callback, qos, health)


def note_publishers(node: Node, subscription: Subscription, health: StreamHealth) -> None:
    """Tell the health of the IMU's stream how many nodes publish its topic, and what else is published there."""
    types = [each.topic_type for each in node.get_publishers_info_by_topic(subscription.topic_name)]
    health.note_publishers(types.count(IMU_TYPE), sorted({*types} - {IMU_TYPE}))


def waiting(subscription: Subscription) -> Iterator[Any]:
    """The received messages of a subscription that wait for its callback, oldest first."""
    # as rclpy's own executors and wait_for_message take them
    with subscription.handle:
        while (received := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
            yield received[0]


def arrival_time(node: Node) -> float:
    """Now, s, by a clock that is never set or, where time is simulated, by that; NaN before there is any."""
    if node.get_parameter('use_sim_time').value:
        return node.get_clock().now().nanoseconds * NANOSECOND or nan
    return perf_counter()


def bag_qos(is_latched: bool, is_reliable: bool = True, depth: int = BAG_DEPTH) -> QoSProfile:
    """The QoS of topics from and to bags; a reliable publisher connects with every subscription."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
    )


def watched_publisher(node: Node, kind: Any, topic: str, qos: QoSProfile | int, health: Reasons) -> Publisher:
    """A publisher whose incompatible subscriptions are counted."""
    resolved = node.resolve_topic_name(topic)
    events = PublisherEventCallbacks(incompatible_qos=lambda event: health.note_mismatch(resolved))
    return node.create_publisher(kind, topic, qos, event_callbacks=events, qos_overriding_options=OVERRIDABLE)


def watched_subscription(
    node: Node, kind: type, topic: str, callback: Callable, qos: QoSProfile, health: Reasons
) -> Subscription:
    """A subscription whose incompatible publishers are counted."""
    resolved = node.resolve_topic_name(topic)
    events = SubscriptionEventCallbacks(incompatible_qos=lambda event: health.note_mismatch(resolved))
    return node.create_subscription(
        kind, topic, callback, qos, event_callbacks=events, qos_overriding_options=OVERRIDABLE
    )


def message_class(name: str) -> type | None:
    """The class of a message type such as sensor_msgs/msg/Imu, None where its package is not installed."""
    # whoever publishes, or wrote a bag, chooses the name: nothing but a package of messages is imported for it
    if not re.fullmatch(r'[a-z]\w*/msg/[A-Z]\w*', name, re.ASCII):
        return None
    package, _, kind = name.partition('/msg/')
    found = find_spec(package)
    if not any((Path(folder) / 'msg').is_dir() for folder in (found and found.submodule_search_locations) or ()):
        return None
    try:
        return getattr(importlib.import_module(f'{package}.msg'), kind, None)
    except ImportError:
        return None


def time_message(nanoseconds: int) -> Time:
    """A builtin_interfaces/Time of nanoseconds."""
    seconds, rest = divmod(int(nanoseconds), SECOND_NS)
    return Time(sec=seconds, nanosec=rest)
