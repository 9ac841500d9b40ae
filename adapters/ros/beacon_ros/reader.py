"""Reads one topic as raw bytes in a thread of its own: no executor, nothing to spin.

Theory. An executor is for many callbacks of many kinds; a source has one subscription and wants its
messages with the publisher's identity, cheaply. So the subscription is made on the node but not
registered with it (no executor will take from it), and this thread waits on a wait set of its own:
the subscription, its two events (matched, incompatible QoS) and a guard condition that wakes it.
Everything the owner gets called with is called in this thread, so there is no lock, and after the
thread has ended no call can follow.

A large rclpy executor would cost more: ``SingleThreadedExecutor`` 51 microseconds a message,
``MultiThreadedExecutor`` 2,900; ``EventsExecutor.spin()`` hangs in some builds.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any, Protocol

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile

from beacon_ros.taking import taker

__all__ = ["Reader", "ReaderOwner"]

_log = logging.getLogger(__name__)

_MAX_BATCH = 256
"""Messages taken before events and the owner's own work get their turn."""


class ReaderOwner(Protocol):
    """What a :class:`Reader` calls, always in its own thread."""

    def on_message(self, payload: bytes, gid: bytes, sequence: int, stamp_ns: int) -> None:
        """One message: the publisher's GID, its number for the message, and its wall clock when it
        was published (0 if unknown)."""

    def on_matched(self, publishers: int) -> None:
        """A publisher came or went; so many are matched now."""

    def on_incompatible(self, total: int) -> None:
        """A publisher was found whose QoS does not fit; so many so far."""

    def step(self) -> float | None:
        """The owner's own work, after each batch; returns after how many seconds it wants to be
        called again at the latest (``None``: no need)."""

    def on_end(self, error: str) -> None:
        """The last call. ``error``: why it ended by itself, ``""`` if it was closed."""


class Reader:
    """Thread rule: ``start`` once; ``wake`` and ``close`` from any thread.

    The node must live until ``close`` has returned.
    """

    def __init__(
        self, node: Node, message_type: type[Any], topic: str, qos: QoSProfile, owner: ReaderOwner
    ) -> None:
        self._owner = owner
        self._context = node.context
        with node.handle:
            self._subscription = _rclpy.Subscription(
                node.handle, message_type, topic, qos.get_c_qos_profile()
            )
        kinds = QoSSubscriptionEventType
        self._matched = _rclpy.EventHandle(self._subscription, kinds.RCL_SUBSCRIPTION_MATCHED)
        self._incompatible = _rclpy.EventHandle(
            self._subscription, kinds.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS
        )
        self._guard = _rclpy.GuardCondition(self._context.handle)
        self._thread = threading.Thread(target=self._run, name="beacon-ros-reader", daemon=True)
        self._closing = False

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def wake(self) -> None:
        """Let ``step`` be called soon."""
        if self._context.ok():
            self._guard.trigger_guard_condition()

    def close(self, within_s: float) -> bool:
        """End it, and say whether it has ended; from within one of the owner's methods it ends
        when that returns."""
        self._closing = True
        self.wake()
        if self._thread is threading.current_thread() or not self._thread.is_alive():
            return True
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        error = ""
        try:
            self._read()
        except Exception as failure:  # noqa: BLE001 - whatever rclpy raises when a context ends
            error = str(failure) if self._context.ok() else "the ROS context was shut down"
            _log.debug("reading ended", exc_info=True)
        for handle in (self._matched, self._incompatible, self._subscription, self._guard):
            handle.destroy_when_not_in_use()
        self._owner.on_end("" if self._closing else error)

    def _read(self) -> None:
        waits = _rclpy.WaitSet(1, 1, 0, 0, 0, 2, self._context.handle)
        take, deliver, step = taker(self._subscription), self._owner.on_message, self._owner.step
        more = False
        while not self._closing:
            wait_s = step()
            wait_ns = 0 if more else -1 if wait_s is None else max(0, round(wait_s * 1e9))
            waits.clear_entities()
            waits.add_subscription(self._subscription)
            waits.add_guard_condition(self._guard)
            matched = waits.add_event(self._matched)
            incompatible = waits.add_event(self._incompatible)
            waits.wait(wait_ns)
            for _ in range(_MAX_BATCH):
                taken = take()
                if taken is None or self._closing:
                    more = False
                    break
                deliver(*taken)
            else:
                more = True
            if waits.is_ready("event", matched):
                self._owner.on_matched(self._matched.take_event().current_count)
            if waits.is_ready("event", incompatible):
                self._owner.on_incompatible(self._incompatible.take_event().total_count)
        waits.destroy_when_not_in_use()
