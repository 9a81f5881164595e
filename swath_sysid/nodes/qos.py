"""Publishers and subscriptions of the contract: their QoS, and the count of those that do not fit."""
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from swath_sysid.formats.topics import IMU_TOPIC
from swath_sysid.nodes.diagnostics import publisher_events, subscription_events
from swath_sysid.nodes.health import QOS_MISMATCH

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Reliable, transient local, depth 1: who comes late gets the last one."""

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
"""Reliable, depth 1: who is slow gets the newest forecast only."""

SERVICES = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""Of the ten requests that the stock profile keeps, those of fifty callers at once would push out forty."""


def imu_subscription(node, kind, callback, depth, health):
    """Subscribe to the sensor with sensor data QoS (best effort, volatile), but a longer queue.

    Best effort and volatile connect with any publisher. The depth is the subscriber's own matter:
    with the five of the stock profile, 2 % of the samples at 1000 Hz were lost when the machine
    paused for 5 ms.
    """
    qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    return node.create_subscription(
        kind, IMU_TOPIC, callback, qos, event_callbacks=subscription_events(lambda: health.note(QOS_MISMATCH))
    )


def waiting(subscription, most):
    """The messages that a subscription has received and that wait to be handled, at most so many, oldest first."""
    messages = []
    # as rclpy's own executors and wait_for_message take them
    with subscription.handle:
        while len(messages) < most:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                break
            messages.append(taken[0])
    return messages


def watched_publisher(node, kind, topic, qos, health):
    """A publisher whose refused subscriptions are counted."""
    return node.create_publisher(kind, topic, qos, event_callbacks=publisher_events(lambda: health.note(QOS_MISMATCH)))


def watched_subscription(node, kind, topic, callback, qos, health):
    """A subscription whose refused publishers are counted."""
    return node.create_subscription(
        kind, topic, callback, qos, event_callbacks=subscription_events(lambda: health.note(QOS_MISMATCH))
    )
