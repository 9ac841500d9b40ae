"""The ends of a topic as the ROS graph shows them, read the short way: 18 us for each, not 52.

rclpy makes an object of each part of an end's quality of service; here two numbers of it matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import attrs
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from beacon_core.relay.values import TopicType

__all__ = ["UNKNOWN_NODE", "End", "publishers_of", "subscriptions_of", "topics_of"]

UNKNOWN_NODE = "_NODE_NAME_UNKNOWN_"
"""How ROS calls an end's node until it is told, mostly some milliseconds later."""

_INFRASTRUCTURE = ("/_action/", "/_service_event")
"""What services and actions are made of. A relay of topics alone would break them."""


@attrs.frozen
class End:
    """A publisher, or a subscription."""

    gid: bytes
    node: str
    """Its node's full name."""
    type: TopicType
    """Its hash is empty if it announces none."""
    reliable: bool
    durable: bool

    @property
    def named(self) -> bool:
        """Is its node known?"""
        return not self.node.endswith(UNKNOWN_NODE)


def topics_of(node: Node) -> list[str]:
    """Each topic that somebody publishes or subscribes to, but for those of actions and services.

    Thread rule: any thread, as for the others.
    """
    with node.handle:
        listed = _rclpy.rclpy_get_topic_names_and_types(node.handle, False)
    return [name for name, _ in listed if not any(part in name for part in _INFRASTRUCTURE)]


def publishers_of(node: Node, topic: str) -> list[End]:
    """Who publishes it, as far as discovery has come."""
    return _ends(_rclpy.rclpy_get_publishers_info_by_topic, node, topic)


def subscriptions_of(node: Node, topic: str) -> list[End]:
    """Who has subscribed to it, as far as discovery has come."""
    return _ends(_rclpy.rclpy_get_subscriptions_info_by_topic, node, topic)


def _ends(ask: Callable[..., list[Mapping[str, Any]]], node: Node, topic: str) -> list[End]:
    with node.handle:
        listed = ask(node.handle, topic, False)
    return [_end(one) for one in listed]


def _end(info: Mapping[str, Any]) -> End:
    qos, hashed = info["qos_profile"], info["topic_type_hash"]
    digest = f"RIHS01_{bytes(hashed['value']).hex()}" if hashed["version"] == 1 else ""
    return End(
        gid=bytes(info["endpoint_gid"]),
        node=f"{info['node_namespace'].rstrip('/')}/{info['node_name']}",
        type=TopicType(info["topic_type"], digest),
        reliable=qos["reliability"] == ReliabilityPolicy.RELIABLE,
        durable=qos["durability"] == DurabilityPolicy.TRANSIENT_LOCAL,
    )
