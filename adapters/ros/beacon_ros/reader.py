"""Reads one topic as raw bytes in a thread of its own: no executor, nothing to spin.

An executor is for many callbacks of many kinds; a source has one subscription and wants its
messages cheaply and with their publisher. So the subscription is made on the node but not
registered with it (no executor takes from it), and a :class:`~beacon_ros.waiter.Waiter` waits for
it. Per message rclpy's ``SingleThreadedExecutor`` takes 51 microseconds, the ``MultiThreaded`` one
2,900, and ``EventsExecutor.spin()`` hangs in some builds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support

from beacon_ros.taking import taker
from beacon_ros.waiter import Event, Waiter

__all__ = ["Reader", "ReaderOwner"]

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
        """See :class:`beacon_ros.waiter.Waiter`; called after each batch, too."""

    def on_end(self, error: str) -> None:
        """See :class:`beacon_ros.waiter.Waiter`."""


class Reader(Waiter):
    """Thread rule: as the waiter's. The node must live until ``on_end``."""

    def __init__(
        self, node: Node, message_type: type[Any], topic: str, qos: QoSProfile, owner: ReaderOwner
    ) -> None:
        check_for_type_support(message_type)
        with node.handle:
            subscription = _rclpy.Subscription(
                node.handle,
                message_type,
                topic,
                qos.get_c_qos_profile(),
            )
        self._take = taker(subscription)
        self._deliver: Callable[[bytes, bytes, int, int], None] = owner.on_message
        super().__init__(
            node.context,
            owner.step,
            owner.on_end,
            *_events(subscription, owner),
            subscription=subscription,
            drain=self._take_some,
        )

    def _take_some(self) -> bool:
        take, deliver = self._take, self._deliver
        for _ in range(_MAX_BATCH):
            taken = take()
            if taken is None or self._closing:
                return False
            deliver(*taken)
        return True


def _events(subscription: Any, owner: ReaderOwner) -> tuple[Event, Event]:
    kinds = QoSSubscriptionEventType
    matched = _rclpy.EventHandle(subscription, kinds.RCL_SUBSCRIPTION_MATCHED)
    incompatible = _rclpy.EventHandle(
        subscription, kinds.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS
    )
    return (
        (matched, lambda status: owner.on_matched(status.current_count)),
        (incompatible, lambda status: owner.on_incompatible(status.total_count)),
    )
