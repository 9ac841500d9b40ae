"""One ROS subscription of raw bytes, whose messages come with their publisher's GID."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support

from beacon_ros.taking import Buffer, taker
from beacon_ros_topic.relay.bells import ring_at_message
from beacon_ros_topic.relay.hub import Hub

__all__ = ["Intake"]

_MAX_BATCH = 64
"""Messages of one topic taken before other topics get their turn."""


class Intake:
    """Thread rule: the hub's thread."""

    def __init__(
        self,
        node: Node,
        of: type[Any],
        topic: str,
        qos: QoSProfile,
        buffer: Buffer,
        tell: Callable[[bytes, bytes, int], object],
    ) -> None:
        """``tell`` is called with payload, GID and the publisher's stamp. Raises what ROS says is
        wrong with the topic or the type."""
        check_for_type_support(of)
        with node.handle:
            self._handle = _rclpy.Subscription(node.handle, of, topic, qos.get_c_qos_profile())
        self._take = taker(self._handle, buffer)
        self._tell = tell
        self._closed = False

    def open(self, hub: Hub) -> None:
        """Have the hub take what comes from now on."""
        self._hub = hub
        ring_at_message(self._handle, hub.add(self.drain))

    def drain(self) -> bool:
        """Take some messages, and say whether there may be more."""
        for _ in range(_MAX_BATCH):
            taken = self._take()
            if taken is None:
                return False
            payload, gid, _, stamp_ns = taken
            self._tell(payload, gid, stamp_ns)
            if self._closed or self._hub.closing:
                return False
        return True

    def close(self) -> None:
        """Nothing is told any more."""
        self._closed = True
        ring_at_message(self._handle, None)
        self._hub.remove(self.drain)
        self._handle.destroy_when_not_in_use()
