"""A beacon for one node: three lines in anybody's rclpy program."""

from __future__ import annotations

import atexit
import os
import threading
from collections.abc import Callable
from typing import Any, cast

import attrs
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer

from beacon_core.checks import period_ns
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.validator import require_id
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME, farewell
from beacon_ros.farewell import say_last
from beacon_ros.participant import NO_FORK
from beacon_ros.process import identified
from beacon_ros.rawtype import message_type
from beacon_ros.shutdown import at_shutdown
from beacon_ros_topic.options import DEFAULT_TOPIC

__all__ = ["BEACON_QOS", "TopicBeacon"]

BEACON_QOS = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""Offers the most, so that every listener can hear it; the last word is all that matters."""

_ANEW_AGAIN_S = (0.3, 4.0)
"""A new listener is told again after these: it may not know of the publisher yet, and does not hear
what is said in between. That is 110 ms at the most, measured; or, when an announcement of DDS's was
lost, until the next one, after 3 s."""

_FAREWELL_WITHIN_S = 0.5


class TopicBeacon:
    """Announces one entity from a node, as long as the node is spun.

    ::

        beacon = TopicBeacon(node, BeaconHint("engine_temp", depends_on=("engine",)), period_s=2.0)
        ...
        beacon.update(metadata={"mode": "calibrating"})  # sent at once

    Process id, process name and hostname are this process's unless the hint gives them. The period
    is one of real time, whatever ``use_sim_time`` says. Whoever begins to listen is told at once.

    It says goodbye on ``close``, when the node is destroyed, when ROS is shut down, and at the end
    of the program, whichever comes first; so also on Ctrl-C and SIGTERM, if the program does with
    them what ROS programs do. A beacon is kept, with its node, until then.

    Thread rule: any thread.
    """

    def __init__(
        self,
        node: Node,
        hint: BeaconHint,
        period_s: float = 2.0,
        *,
        topic: str = DEFAULT_TOPIC,
        qos: QoSProfile = BEACON_QOS,
    ) -> None:
        """Raises ``UsageError`` for an id that is none, ``ConfigError`` for a
        period that is not above 0, or where the message type is neither installed nor to be made.
        """
        period_ns(period_s)
        require_id(hint.entity_id)
        self._node = node
        self._hint = identified(hint)
        self._payload = cdr.encode(self._hint)
        self._pid = os.getpid()
        # A program's own signal handler may shut ROS down in the middle of a beat.
        self._lock = threading.RLock()
        self._closed = False
        with self._lock:  # the node may be spun already
            self._publisher = self._make_publisher(topic, qos)
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(period_s, self._say, clock=steady)
            self._again = [self._make_one_shot(after_s, steady) for after_s in _ANEW_AGAIN_S]
        self._publisher.before_destroy = self._last_word
        self._stop_telling = at_shutdown(node.context, self._last_word)
        _open.add(self)
        self._say()

    @property
    def hint(self) -> BeaconHint:
        """What it says."""
        return self._hint

    def update(self, **fields: Any) -> None:
        """Change fields of the hint (not ``entity_id``) and send it at once.

        Raises ``UsageError`` for a field that does not exist, after ``close``, and in a forked
        child.
        """
        unknown = fields.keys() - (attrs.fields_dict(BeaconHint).keys() - {"entity_id"})
        if unknown:
            raise UsageError(f"update: {', '.join(sorted(unknown))} cannot be changed in a hint")
        if self._pid != os.getpid():
            raise UsageError(f"update: made before a fork; {NO_FORK}")
        with self._lock:
            if self._closed:
                raise UsageError("update: this beacon is closed; make a new one")
            hint = attrs.evolve(self._hint, **fields)
            self._payload = cdr.encode(hint)
            self._hint = hint
        self._say()

    def close(self) -> None:
        """Say goodbye and stop. Idempotent, within 1 s; in a forked child it does nothing."""
        if self._pid != os.getpid():
            return
        self._last_word()
        for timer in (self._timer, *self._again):
            self._node.destroy_timer(timer)
        self._node.destroy_publisher(self._publisher)

    def _make_publisher(self, topic: str, qos: QoSProfile) -> _MindfulPublisher:
        made = self._node.create_publisher(
            message_type(TYPE_NAME, TYPE_HASH),
            topic,
            qos,
            event_callbacks=PublisherEventCallbacks(matched=self._on_matched),
            publisher_class=_MindfulPublisher,
        )
        return cast("_MindfulPublisher", made)

    def _make_one_shot(self, after_s: float, clock: Clock) -> Timer:
        """Speaks once, so long after it was reset."""

        def say() -> None:
            timer.cancel()
            self._say()

        timer = self._node.create_timer(after_s, say, clock=clock)
        timer.cancel()
        return timer

    def _on_matched(self, status: Any) -> None:
        if status.current_count_change > 0:
            self._say()
            for timer in self._again:
                timer.reset()

    def _say(self) -> None:
        try:
            with self._lock:
                if not self._closed:
                    self._publisher.publish(self._payload)
        except Exception:  # RCLError, which is not a public name
            # Not asked before, and not under the lock: who shuts the context down holds the
            # context's lock while it waits for ours.
            if self._node.context.ok() and not self._closed:
                raise

    def _last_word(self) -> None:
        """Say goodbye unless that has been done; may be the last moment for it."""
        if self._pid != os.getpid():
            return
        with self._lock:
            if self._closed:
                return
            self._closed = True
        _open.discard(self)
        self._stop_telling()
        say_last(self._publisher, [farewell(self._hint.entity_id)], _FAREWELL_WITHIN_S)


class _MindfulPublisher(Publisher):
    """Lets somebody speak before it is destroyed, as its node does without asking."""

    before_destroy: Callable[[], None]

    def destroy(self) -> None:
        self.before_destroy()
        super().destroy()


_open: set[TopicBeacon] = set()


@atexit.register
def _close_all() -> None:
    for beacon in list(_open):
        beacon._last_word()  # noqa: SLF001 - our own
