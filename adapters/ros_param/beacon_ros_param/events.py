"""What nodes tell of their parameters, and which run of a node is which: ``/parameter_events``.

Every node publishes there whenever its parameters change, and its publisher has a GID, which is
another one after a restart. So the topic serves twice: to be told of changes without asking, and to
tell two runs of a node apart.
"""

from __future__ import annotations

import attrs
from rcl_interfaces.msg import ParameterEvent
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_ros.graph import node_names

__all__ = ["EVENTS_TOPIC", "Change", "change_in", "runs"]

EVENTS_TOPIC = "/parameter_events"

_PREFIX = PREFIX.encode()


@attrs.frozen
class Change:
    """An event about parameters that belong to a hint."""

    node: str
    """The full name of the node, as the event gives it: anybody could give any."""
    leaving: bool | None
    """The hint was taken back; it was not (the entity id has a value); ``None``: not told."""


def change_in(payload: bytes) -> Change | None:
    """What the event says of a hint; ``None``: nothing. Any bytes in, a value out."""
    if _PREFIX not in payload:
        return None
    try:
        event = deserialize_message(payload, ParameterEvent)
    except Exception:  # noqa: BLE001 - whatever the type support raises for bytes that are none
        return None
    return Change(event.node, _leaving(event))


def runs(node: Node) -> dict[str, set[str]]:
    """All nodes of the graph by full name, with the GIDs by which their runs are told apart.

    A GID is not known for the first 100 ms, and never of a node that publishes no such events. Two
    GIDs under one name are two nodes of that name.
    """
    found: dict[str, set[str]] = {name: set() for name in node_names(node)}
    # The node's own method takes three times as long, for all that it tells besides.
    with node.handle:
        publishers = _rclpy.rclpy_get_publishers_info_by_topic(node.handle, EVENTS_TOPIC, False)
    for one in publishers:
        name = f"{one['node_namespace'].rstrip('/')}/{one['node_name']}"
        if name in found:
            found[name].add(bytes(one["endpoint_gid"]).hex())
    return found


def _leaving(event: ParameterEvent) -> bool | None:
    for parameter in (*event.new_parameters, *event.changed_parameters):
        if parameter.name == ENTITY_ID:
            return not parameter.value.string_value
    deleted = any(parameter.name == ENTITY_ID for parameter in event.deleted_parameters)
    return True if deleted else None
