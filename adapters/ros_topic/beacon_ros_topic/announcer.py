"""The sending half for a program that speaks for any number of entities."""

from __future__ import annotations

import heapq
import os
import random
import threading
import time
from typing import Any

import attrs
from rclpy.event_handler import QoSPublisherEventType
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.publisher import Publisher

from beacon_core.checks import period_ns
from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.validator import require_id
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME, farewell
from beacon_ros.farewell import say_last
from beacon_ros.participant import NO_FORK, OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.waiter import CONTEXT_ENDED, Waiter
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import profile

__all__ = ["RosTopicAnnouncer"]

_JITTER = 0.15
"""Each wait is up to this part shorter than the period, never longer: a fleet that was switched on
together drifts apart, and nobody is late."""

_ANEW_EVERY_NS = 10_000_000
"""A new listener is told everything, but not at once: a gateway hears 100 messages a second of one
publisher, if nothing else is configured."""

_ANEW_AGAIN_NS = (300_000_000, 4_000_000_000)
"""What was said before each of these is said again so much later: a listener that is known may not
know of the publisher yet, and does not hear what is said in between. That is 110 ms at the most,
measured; or, when an announcement of DDS's was lost, until the next one, after 3 s."""

_FAREWELL_WITHIN_S = 0.5
_CLOSE_WITHIN_S = 0.9


_Beat = tuple[int, str, bool]
"""When to say an entity's hint; and whether that is out of turn, for a new listener."""


@attrs.define(eq=False)
class _Voice:
    payload: bytes
    due_ns: int = 0


class RosTopicAnnouncer:
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's.

    One publisher for all entities: with the rate that a gateway allows one publisher by default,
    and a period of 2 s, it may speak for 200. A listener that comes later is told everything,
    whatever the period and its QoS. Hints carry no stamp of their own: the middleware says when
    each was published, and a message that is equal to the last one costs the listener least.

    A node that speaks for itself alone uses :class:`beacon_ros_topic.beacon.TopicBeacon`.
    """

    def __init__(self, options: RosTopicOptions, period_s: float | None = None) -> None:
        """Raises ``ConfigError`` for a period that is not above 0, and where ROS refuses."""
        self._period_ns = period_ns(period_s)
        self._pid = os.getpid()
        self._topic = options.topic
        self._lock = threading.Lock()
        self._voices: dict[str, _Voice] = {}
        self._beats: list[_Beat] = []
        self._listeners = self._ever = 0
        self._closed = False
        self._ended = ""
        message = message_type(TYPE_NAME, TYPE_HASH)
        self._own = OwnNode("topic_announcer", options.domain_id)
        self._publisher = self._make_publisher(message, options)
        matched = _rclpy.EventHandle(
            self._publisher.handle, QoSPublisherEventType.RCL_PUBLISHER_MATCHED
        )
        self._waiter = Waiter(
            self._own.context, self._beat, self._on_end, (matched, self._on_matched)
        )
        self._waiter.start()

    def announce(self, hint: BeaconHint) -> None:
        require_id(hint.entity_id, "announce: ")
        if self._pid != os.getpid():
            raise UsageError(f"announce: made before a fork; {NO_FORK}")
        payload = cdr.encode(hint)
        with self._lock:
            if self._closed:
                raise UsageError("announce: this announcer is closed; make a new one")
            voice = self._voices.setdefault(hint.entity_id, _Voice(payload))
            voice.payload = payload
            self._publish(payload)
            sooner = self._schedule_next(hint.entity_id, voice)
        if sooner:
            self._waiter.wake()

    def withdraw(self, entity_id: str) -> None:
        if self._pid != os.getpid():
            return
        with self._lock:
            if not self._closed and self._voices.pop(entity_id, None) is not None:
                self._publish(farewell(entity_id))

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # before the lock: the fork may have left it held for ever
        with self._lock:
            self._closed = True
        self._waiter.close(_CLOSE_WITHIN_S)

    def health(self) -> Health:
        counters = {"entities": len(self._voices), "listeners": self._listeners}
        if self._closed:
            return Health(Condition.CLOSED, counters=counters)
        if self._ended:
            return Health(Condition.DOWN, f"{self._ended}; make a new announcer", counters)
        if self._listeners:
            return Health(Condition.UP, counters=counters)
        nobody = (
            f"nobody listens on {self._topic}; "
            "is the gateway in the same ROS domain? Ask: beacon doctor"
        )
        return Health(Condition.DOWN if self._ever else Condition.STARTING, nobody, counters)

    def _make_publisher(self, message: type[Any], options: RosTopicOptions) -> Publisher:
        try:
            return self._own.node.create_publisher(message, options.topic, profile(options))
        except Exception as error:  # RCLError, which is not a public name
            self._own.close()
            raise ConfigError(
                f"topic: ROS refuses {options.topic!r}: {error}; "
                "does this program have a topic of that name with another type?"
            ) from error

    def _publish(self, payload: bytes) -> None:
        """Under the lock, so that what is said of an entity is said in the order of the calls."""
        if self._ended:
            return
        try:
            self._publisher.publish(payload)
        except Exception:  # RCLError, which is not a public name
            if self._own.context.ok():
                raise
            self._waiter.end_with_context()

    def _schedule_next(self, entity_id: str, voice: _Voice) -> bool:
        """The next turn; says whether the thread must wake earlier than it thinks."""
        if self._period_ns is None:
            return False
        wait_ns = self._period_ns * (1 - _JITTER * random.random())  # noqa: S311
        voice.due_ns = time.monotonic_ns() + round(wait_ns)
        sooner = not self._beats or voice.due_ns < self._beats[0][0]
        heapq.heappush(self._beats, (voice.due_ns, entity_id, False))
        self._clear_void_beats()
        return sooner

    def _clear_void_beats(self) -> None:
        """Who speaks more often than its period leaves one behind each time."""
        if len(self._beats) <= 4 * len(self._voices) + 100:
            return
        turns: list[_Beat] = [
            (one.due_ns, name, False) for name, one in self._voices.items() if one.due_ns
        ]
        self._beats = turns
        heapq.heapify(self._beats)

    # -- in the waiter's thread ------------------------------------------------------------------

    def _on_matched(self, status: object) -> None:
        listeners: int = getattr(status, "current_count", 0)
        more = listeners > self._listeners
        self._listeners = listeners
        self._ever = max(self._ever, listeners)
        if more:
            self._tell_newcomer()

    def _tell_newcomer(self) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            self._clear_void_beats()
            for number, entity_id in enumerate(self._voices):
                after_ns = number * _ANEW_EVERY_NS
                heapq.heappush(self._beats, (now_ns + after_ns, entity_id, True))
                for later_ns in _ANEW_AGAIN_NS:
                    if after_ns < later_ns:
                        again_ns = now_ns + after_ns + later_ns
                        heapq.heappush(self._beats, (again_ns, entity_id, True))

    def _beat(self) -> float | None:
        now_ns = time.monotonic_ns()
        with self._lock:
            while self._beats and self._beats[0][0] <= now_ns:
                due_ns, entity_id, extra = heapq.heappop(self._beats)
                voice = self._voices.get(entity_id)
                if voice is None:
                    continue
                # Whoever has spoken meanwhile is due later.
                if extra or voice.due_ns == due_ns:
                    self._publish(voice.payload)
                if voice.due_ns == due_ns:
                    self._schedule_next(entity_id, voice)
            return max(0, self._beats[0][0] - now_ns) / 1e9 if self._beats else None

    def _on_end(self, error: str) -> None:
        with self._lock:
            self._ended = error or "the program ends"
            departing = list(self._voices) if error in ("", CONTEXT_ENDED) else []
            self._voices.clear()
        say_last(self._publisher, map(farewell, departing), _FAREWELL_WITHIN_S)
        self._own.close()
