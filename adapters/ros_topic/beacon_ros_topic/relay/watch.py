"""Watching the ROS graph: topics that come, change and go, and who publishes them.

Looked at when ROS says that something has changed, and each few seconds anyway. Thousands of topics
take long to look at, so a look is followed by a pause that is some times as long.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Protocol

import attrs
from rclpy.node import Node

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.marks import Mark, is_conduit, mark_of
from beacon_core.relay.values import TopicType
from beacon_ros.waiter import Waiter
from beacon_ros_topic.relay.endpoints import End, publishers_of, topics_of
from beacon_ros_topic.relay.qos import merged, remark

__all__ = ["Speaker", "Watch", "WatchOwner"]

_LEAST_PAUSE_S = 0.02
_PAUSE_PER_LOOK = 9
"""So it takes a tenth of one thread at most."""
_AT_LEAST_EVERY_S = 10.0
"""ROS has told of each change so far. For 500 topics a look takes 20 ms."""
_NAMED_WITHIN_S = 0.5
"""A publisher's node is told some milliseconds after the publisher. Until then nobody knows whether
it is another relay's, and whose; so it has not come yet."""
_CLOSE_WITHIN_S = 0.5


@attrs.frozen
class Speaker:
    """What is known of a publisher when a message of it comes."""

    mark: Mark
    type: TopicType


class WatchOwner(Protocol):
    """Whom a :class:`Watch` tells, in a thread of its own."""

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        """As the port has it."""

    def topic_gone(self, topic: str) -> None:
        """As the port has it."""

    def looked(self) -> None:
        """The graph may have changed, and was looked at."""

    def is_ours(self, node: str) -> bool:
        """Is this the full name of a node of the owner's?"""


class Watch:
    """Thread rule: any thread for ``start``, ``close``, ``speaker`` and ``remarks``."""

    def __init__(self, node: Node, owner: WatchOwner, depth: int) -> None:
        """``node`` must live until ``close`` has returned; ``depth`` is that of a volatile
        topic."""
        self._node, self._owner, self._depth = node, owner, depth
        self._topics: dict[str, SeenTopic] = {}
        self._speakers: dict[bytes, Speaker] = {}
        self._unnamed: dict[bytes, float] = {}
        self._next_s = 0.0
        self.remarks: dict[str, str] = {}
        """By topic: which of its publishers are not heard, and why."""
        self._waiter = Waiter(node.context, self._step, lambda _: None, graph_of=node)

    def start(self) -> None:
        """Begin to look."""
        self._waiter.start()

    def close(self) -> None:
        """Look no more."""
        self._waiter.close(_CLOSE_WITHIN_S)

    def speaker(self, gid: bytes, topic: str) -> Speaker | None:
        """Whose GID that is; asks the graph if it was not known at the last look.

        As long as nobody knows its node, it has no mark.
        """
        found = self._speakers.get(gid)
        if found is not None:
            return found
        end = next((one for one in publishers_of(self._node, topic) if one.gid == gid), None)
        if end is None:
            return None
        if end.named:
            self._speakers[gid] = _speaker(end)
        return _speaker(end)

    def _step(self) -> float:
        began_s = time.monotonic()
        if began_s < self._next_s:
            return self._next_s - began_s
        waits_for_names = self._look(began_s)
        now_s = time.monotonic()
        pause_s = max(_LEAST_PAUSE_S, _PAUSE_PER_LOOK * (now_s - began_s))
        self._next_s = now_s + pause_s
        return pause_s if waits_for_names else _AT_LEAST_EVERY_S

    def _look(self, now_s: float) -> bool:
        """Says whether there are publishers whose nodes are not known."""
        found = {topic: publishers_of(self._node, topic) for topic in topics_of(self._node)}
        self._forget_unnamed(one.gid for some in found.values() for one in some if not one.named)
        speaking = {topic: self._others(some, now_s) for topic, some in found.items()}
        self._speakers = {
            one.gid: _speaker(one) for some in found.values() for one in some if one.named
        }
        for topic in self._topics.keys() - {topic for topic, some in speaking.items() if some}:
            self._gone(topic)
        for topic, some in speaking.items():
            if some:
                self._seen(topic, some)
        self._tell(self._owner.looked)
        return any(now_s < until_s for until_s in self._unnamed.values())

    def _others(self, ends: list[End], now_s: float) -> list[End]:
        """Those that are neither ours nor a conduit's."""
        return [
            one
            for one in ends
            if (not one.named and self._waited_for_name(one.gid, now_s))
            or (one.named and not self._owner.is_ours(one.node) and not is_conduit(one.node))
        ]

    def _waited_for_name(self, gid: bytes, now_s: float) -> bool:
        return now_s >= self._unnamed.setdefault(gid, now_s + _NAMED_WITHIN_S)

    def _forget_unnamed(self, left: Iterable[bytes]) -> None:
        gids = set(left)
        self._unnamed = {gid: until_s for gid, until_s in self._unnamed.items() if gid in gids}

    def _seen(self, topic: str, ends: list[End]) -> None:
        before = self._topics.get(topic)
        seen = merged(ends, self._depth, before)
        self.remarks[topic] = remark(ends, seen)
        if not self.remarks[topic]:
            del self.remarks[topic]
        if seen != before:
            self._topics[topic] = seen
            self._tell(lambda: self._owner.topic_seen(topic, seen))

    def _gone(self, topic: str) -> None:
        del self._topics[topic]
        self.remarks.pop(topic, None)
        self._tell(lambda: self._owner.topic_gone(topic))

    def _tell(self, telling: Callable[[], object]) -> None:
        if not self._waiter.closing:
            telling()


def _speaker(end: End) -> Speaker:
    return Speaker(mark_of(end.node), end.type)
