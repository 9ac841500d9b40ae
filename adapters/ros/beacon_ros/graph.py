"""What the ROS graph shows: publishers of a topic with their QoS and type, and nodes."""

from __future__ import annotations

import attrs
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

__all__ = ["Endpoint", "node_names", "publishers"]

_UNNAMED = ("_NODE_NAME_UNKNOWN_", "_CREATED_BY_BARE_DDS_APP_")
"""How ROS calls an endpoint whose node is not known (yet), or that is no ROS node's."""


@attrs.frozen
class Endpoint:
    """One publisher."""

    gid: bytes
    node: str
    """Its node's full name; ``""`` if that is not known (yet)."""
    type_name: str
    type_hash: str
    """``RIHS01_...``; ``""`` if it announces none."""
    reliability: str
    """``reliable`` or ``best_effort``."""
    durability: str
    """``volatile`` or ``transient_local``."""


def publishers(node: Node, topic: str) -> list[Endpoint]:
    """Who publishes the topic, as far as discovery has come. Thread rule: any thread."""
    return [_endpoint(info) for info in node.get_publishers_info_by_topic(topic)]


def node_names(node: Node) -> list[str]:
    """The full names of all nodes, in order; a name that several nodes have is there once."""
    named = node.get_node_names_and_namespaces()
    return sorted({f"{space.rstrip('/')}/{name}" for name, space in named})


def _endpoint(info: TopicEndpointInfo) -> Endpoint:
    name, space = info.node_name, info.node_namespace
    hashed = str(info.topic_type_hash)
    return Endpoint(
        gid=bytes(info.endpoint_gid),
        node="" if name in _UNNAMED else f"{space.rstrip('/')}/{name}",
        type_name=info.topic_type,
        type_hash=hashed if hashed.startswith("RIHS01_") else "",
        reliability=info.qos_profile.reliability.name.lower(),
        durability=info.qos_profile.durability.name.lower(),
    )
