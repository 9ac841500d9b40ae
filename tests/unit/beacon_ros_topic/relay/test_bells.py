"""ROS rings without Python: for each message, for each match, and not after it was told to stop."""

from __future__ import annotations

import select
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING

import attrs
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: nothing rings")

from rclpy.event_handler import QoSPublisherEventType
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.qos import QoSProfile

from beacon_ros_topic.relay.bells import Bell, ring_at_event, ring_at_message
from beacon_ros_topic.relay.harness import BYTES, message
from beacon_ros_topic.relay.rawtypes import type_for

if TYPE_CHECKING:
    from beacon_ros.participant import OwnNode

Eventually = Callable[..., None]


@pytest.fixture
def bell() -> Iterator[Bell]:
    made = Bell()
    yield made
    made.close()


def rings(bell: Bell, within_s: float = 0.0) -> bool:
    return bool(select.select([bell.fd], [], [], within_s)[0])


def test_it_rings_until_it_is_cleared(bell: Bell) -> None:
    assert not rings(bell)
    bell.ring()
    bell.ring()
    assert rings(bell)
    bell.clear()
    assert not rings(bell)
    bell.clear()


def test_it_is_rung_at_a_message_also_at_one_that_has_come_before(own: OwnNode, bell: Bell) -> None:
    node, qos = own.node, QoSProfile(depth=10)
    subscription = node.create_subscription(type_for(BYTES), "/topic", print, qos, raw=True)
    publisher = node.create_publisher(type_for(BYTES), "/topic", qos)
    while not publisher.get_subscription_count():
        pass
    publisher.publish(message(b"before"))
    while subscription.handle.take_message(type_for(BYTES), True) is None:
        pass
    publisher.publish(message(b"before"))
    ring_at_message(subscription.handle, bell)
    assert rings(bell, 5.0)
    bell.clear()
    publisher.publish(message(b"after"))
    assert rings(bell, 5.0)
    ring_at_message(subscription.handle, None)
    bell.clear()
    publisher.publish(message(b"late"))
    assert not rings(bell, 0.1)


def test_it_is_rung_when_a_subscription_matches_and_when_it_goes(own: OwnNode, bell: Bell) -> None:
    node, qos = own.node, QoSProfile(depth=10)
    publisher = node.create_publisher(type_for(BYTES), "/topic", qos)
    event = _rclpy.EventHandle(publisher.handle, QoSPublisherEventType.RCL_PUBLISHER_MATCHED)
    ring_at_event(event, bell)
    subscription = node.create_subscription(type_for(BYTES), "/topic", print, qos, raw=True)
    assert rings(bell, 5.0)
    bell.clear()
    node.destroy_subscription(subscription)
    assert rings(bell, 5.0)
    ring_at_event(event, None)
    event.destroy_when_not_in_use()


@attrs.frozen
class Nobody:
    """Stands for a handle of something that ROS has ended."""

    pointer: int = 0

    def __enter__(self) -> None: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...


def test_what_ros_refuses_is_told(bell: Bell) -> None:
    with pytest.raises(RuntimeError, match="rcl_event_set_callback failed"):
        ring_at_event(Nobody(), bell)
