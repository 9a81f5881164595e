"""The upstream channels of predictor: their topics subscribed, and their values handed to the pipeline."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import isfinite
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import stamp_of
from swath_sysid.formats.upstream_channels import channels_of, field_value, kind_of
from swath_sysid.nodes.qos import message_class, watched_subscription
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.health import DISCOVERY, OK, WARN, Arrivals, Reasons, Report


@dataclass
class UpstreamTopic:
    """A topic, and the fields of it that are channels."""

    topic: str
    kind: str
    fields: dict[str, str] = field(default_factory=dict)
    subscription: Subscription | None = None
    arrivals: Arrivals = field(default_factory=Arrivals)
    left_out: int = 0
    newest_ns: int = 0


class Upstream:
    """The topics of the entries ``topic`` or ``topic:field`` of a parameter.

    Raises:
        InputError: A topic has another type than its field, or none that can be a channel.
    """

    def __init__(self, node: Node, entries: Sequence[str], depth: int) -> None:
        self._node, self._depth = node, depth
        self.sources: dict[str, UpstreamTopic] = {}
        wanted = [entry for entry in entries if entry]
        self._wait_for_types([entry for entry in wanted if ':' not in entry])
        for entry in wanted:
            topic = self._node.resolve_topic_name(entry.partition(':')[0])
            known = self.sources.get(topic)
            kind = kind_of(entry, self._types_of(topic)) if known is None else known.kind
            if kind is None:
                node.get_logger().error(
                    f"nothing publishes {topic} yet, so its type is not known and the upstream channel '{entry}' is "
                    f'left out: start its sensor first, or name the field, as in {entry}:z'
                )
                continue
            source = self.sources.setdefault(topic, UpstreamTopic(topic, kind))
            source.fields |= channels_of(entry, kind)

    def settings(self, settings: PipelineSettings) -> PipelineSettings:
        """Settings of a pipeline with these channels."""
        names = tuple(name for source in self.sources.values() for name in source.fields)
        return replace(settings, forecaster=replace(settings.forecaster, upstream=names))

    def listen(self, pipeline: ForecastPipeline, health: Reasons) -> None:
        """Subscribe, hand all values to a pipeline from now on, and count the messages without one."""
        self._pipeline, self._health = pipeline, health
        qos = QoSProfile(depth=self._depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        for source in self.sources.values():
            kind = message_class(source.kind)
            if kind is None:
                raise InputError(f'the upstream topic {source.topic} needs the package of {source.kind}: install it')
            take = partial(self._take, source)
            source.subscription = watched_subscription(self._node, kind, source.topic, take, qos, health)

    def reports(self) -> list[Report]:
        """How the topics arrive; nothing without channels."""
        if not self.sources:
            return []
        values: dict[str, object] = {}
        problems: dict[str, str] = {}
        for source in self.sources.values():
            values[f'received_{source.topic}'] = source.arrivals.received
            values[f'left_out_{source.topic}'] = source.left_out
            if not source.arrivals.received:
                problems[source.topic] = self._why_silent(source)
            elif silence := source.arrivals.silence(self._pipeline.newest_ns):
                problems[source.topic] = (
                    f'no message on {source.topic} for {silence:.0f} s: check its sensor and the link to it'
                )
        names = ', '.join(name for source in self.sources.values() for name in source.fields)
        message = '; '.join(problems.values()) or f'receiving {names}'
        return [Report('upstream', WARN if problems else OK, message, values, tuple(problems))]

    def _take(self, source: UpstreamTopic, message: Any) -> None:
        source.arrivals.note(self._pipeline.newest_ns)
        stamp_ns = stamp_of(message)
        if stamp_ns is not None:
            if stamp_ns == source.newest_ns:
                self._leave_out(source)
                return
            source.newest_ns = stamp_ns
        for name, of in source.fields.items():
            value = field_value(message, source.kind, of)
            if isfinite(value):
                self._pipeline.add_upstream(name, stamp_ns, value)
            else:
                self._leave_out(source)

    def _leave_out(self, source: UpstreamTopic) -> None:
        source.left_out += 1
        self._health.note('bad-upstream')

    def _types_of(self, topic: str) -> list[str]:
        return next((types for name, types in self._node.get_topic_names_and_types() if name == topic), [])

    def _wait_for_types(self, entries: Sequence[str]) -> None:
        deadline = time.monotonic() + DISCOVERY
        topics = [self._node.resolve_topic_name(entry) for entry in entries]
        while not all(map(self._types_of, topics)) and time.monotonic() < deadline:
            time.sleep(0.05)

    def _why_silent(self, source: UpstreamTopic) -> str:
        others = [kind for kind in self._types_of(source.topic) if kind != source.kind]
        if others:
            return f'{source.topic} is published as {others[0]}, not {source.kind}: correct the field in upstream'
        return f'no message on {source.topic} yet: check that its sensor publishes there'
