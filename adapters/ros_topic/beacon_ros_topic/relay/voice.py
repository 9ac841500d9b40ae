"""One ROS publisher of raw bytes, which are not copied on their way to DDS."""

from __future__ import annotations

import ctypes as c
from typing import Any

from rclpy.duration import Duration
from rclpy.event_handler import QoSPublisherEventType
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support
from rclpy.utilities import get_rmw_implementation_identifier

from beacon_ros.errors import said_by_ros
from beacon_ros_topic.relay.bells import Bell, ring_at_event

__all__ = ["Voice"]

_AT_ONCE = Duration(seconds=0)


class Voice:
    """Thread rule: any thread, but nothing during or after ``close``."""

    def __init__(
        self, node: Node, of: type[Any], topic: str, qos: QoSProfile, bell: Bell | None = None
    ) -> None:
        """``bell`` is rung when a subscription has matched or gone. Raises what ROS says is wrong
        with the topic or the type."""
        check_for_type_support(of)
        with node.handle:
            self._handle = _rclpy.Publisher(node.handle, of, topic, qos.get_c_qos_profile())
        self._event = _rclpy.EventHandle(self._handle, QoSPublisherEventType.RCL_PUBLISHER_MATCHED)
        self._at = self._handle.pointer
        self._publish = c.CDLL("librcl.so").rcl_publish_serialized_message
        self._publish.argtypes, self._publish.restype = [c.c_void_p] * 3, c.c_int
        self.gid = _gid(self._at)
        if bell is not None:
            ring_at_event(self._event, bell)

    def send(self, payload: bytes) -> None:
        """Publish, without Python's lock. Raises ``RuntimeError`` with ROS's words."""
        message = _Message(payload, len(payload), len(payload))
        if self._publish(self._at, c.addressof(message), None):
            raise RuntimeError(f"publishing failed: {said_by_ros()}")

    def count(self) -> int:
        """How many subscriptions have matched."""
        found: int = self._handle.get_subscription_count()
        return found

    def acknowledged(self) -> bool:
        """Do all matched reliable subscriptions have all that was sent?"""
        done: bool = self._handle.wait_for_all_acked(_AT_ONCE._duration_handle)  # noqa: SLF001
        return done

    def close(self) -> None:
        """End it at once."""
        ring_at_event(self._event, None)
        self._event.destroy_when_not_in_use()
        self._handle.destroy_when_not_in_use()


class _Message(c.Structure):
    """``rcl_serialized_message_t``; its allocator is left empty, since nothing is allocated."""

    _fields_ = (
        ("data", c.c_char_p),
        ("length", c.c_size_t),
        ("capacity", c.c_size_t),
        ("allocator", c.c_void_p * 5),
    )


class _Gid(c.Structure):
    """``rmw_gid_t``."""

    _fields_ = (("implementation", c.c_char_p), ("data", c.c_uint8 * 16), ("spare", c.c_uint8 * 16))


def _gid(publisher: int) -> bytes:
    handle_of = c.CDLL("librcl.so").rcl_publisher_get_rmw_handle
    handle_of.argtypes, handle_of.restype = [c.c_void_p], c.c_void_p
    gid_of = c.CDLL(f"lib{get_rmw_implementation_identifier()}.so").rmw_get_gid_for_publisher
    gid_of.argtypes, gid_of.restype = [c.c_void_p] * 2, c.c_int
    found = _Gid()
    if gid_of(handle_of(publisher), c.addressof(found)):
        raise RuntimeError(f"a publisher has no GID: {said_by_ros()}")
    return bytes(found.data)
