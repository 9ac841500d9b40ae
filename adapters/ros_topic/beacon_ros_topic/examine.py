"""What can be seen of the topic: who publishes it, and whether a source would hear them."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

from rclpy.node import Node

from beacon_core.ports.examination import Finding, Level
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.environment import why_no_raw_types
from beacon_ros.examine import (
    Look,
    common_findings,
    elsewhere,
    listed,
    looking,
    node_findings,
    visible_nodes,
)
from beacon_ros.graph import Endpoint, publishers
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import misfit

__all__ = ["examine"]

_HASH_SHOWN = 15
"""Characters that tell a type hash from another: ``RIHS01_`` and 8 digits."""

_SHOWN = 5
"""Publishers with a fault that are told one by one."""


def examine(options: RosTopicOptions, seconds: float) -> Iterator[Finding]:
    """Look with a node of our own, which does not subscribe: announcers greet who does.

    Raises ``ConfigError`` for a domain that cannot be joined.
    """
    with looking(options.domain_id, seconds) as look:
        yield from common_findings(look, options.domain_id)
        yield _type()
        found = look.until_settled(lambda: tuple(publishers(look.node, options.topic)))
        if found:
            yield from _heard(options, found)
        else:
            yield from _nobody(options.topic, look)


def _type() -> Finding:
    package = TYPE_NAME.partition("/")[0]
    if find_spec(package) is not None:
        return Finding(Level.OK, f"the message type is that of the installed {package}")
    if why := why_no_raw_types():
        what, _, advice = why.partition("; ")
        return Finding(Level.PROBLEM, what, advice)
    return Finding(Level.OK, f"the message type is made at run time: {package} is not needed")


def _heard(options: RosTopicOptions, found: tuple[Endpoint, ...]) -> Iterator[Finding]:
    faults = {one: fault for one in found if (fault := _fault(options, one)) is not None}
    deaf = {one for one, fault in faults.items() if fault.level is Level.PROBLEM}
    if well := [_name(one) for one in found if one not in deaf]:
        yield Finding(Level.OK, f"published on {options.topic} by {listed(well)}")
    yield from list(faults.values())[:_SHOWN]
    if len(faults) > _SHOWN:
        rest = len(faults) - _SHOWN
        yield Finding(Level.PROBLEM, f"of {rest} more publishers something of the kind is true")


def _fault(options: RosTopicOptions, publisher: Endpoint) -> Finding | None:
    name = _name(publisher)
    if publisher.type_name != TYPE_NAME:
        what = f"{name} is not heard: it publishes {publisher.type_name}, not {TYPE_NAME}"
        return Finding(Level.PROBLEM, what, "let it publish elsewhere, or set another topic here")
    if why := misfit(options, publisher):
        what, _, advice = why.partition("; ")
        return Finding(Level.PROBLEM, what, advice)
    if not publisher.type_hash:
        what = f"{name} announces no type hash: a plain DDS program, or ROS before Iron"
        return Finding(Level.NOTE, what, "it is heard if its message has the same fields")
    if publisher.type_hash != TYPE_HASH:
        return Finding(
            Level.PROBLEM,
            f"{name} has another definition of the message: {publisher.type_hash[:_HASH_SHOWN]}, "
            f"here it is {TYPE_HASH[:_HASH_SHOWN]}",
            "build it with the ros2_medkit_msgs of this project or of ros2_medkit",
        )
    return None


def _nobody(topic: str, look: Look) -> Iterator[Finding]:
    nodes = visible_nodes(look.node)
    yield from node_findings(look, nodes)
    if not nodes:
        return
    yield Finding(
        Level.PROBLEM,
        f"nobody publishes {topic}",
        f"to try: beacon announce --adapter ros_topic --entity-id test --option topic={topic}",
    )
    for other in _same_type(look.node, topic):
        by = listed(_publisher_names(look.node, other))
        what = f"hints are published on another topic, {other}, by {by}"
        yield Finding(Level.NOTE, what, f"to hear them: topic: {other}")
    yield from elsewhere(
        look, lambda node: _publisher_names(node, topic), f" with a publisher of {topic}"
    )


def _same_type(node: Node, topic: str) -> list[str]:
    """The other topics on which somebody publishes hints."""
    return [
        name
        for name, types in node.get_topic_names_and_types()
        if TYPE_NAME in types and name != topic and node.count_publishers(name)
    ]


def _publisher_names(node: Node, topic: str) -> list[str]:
    return [_name(one) for one in publishers(node, topic)]


def _name(publisher: Endpoint) -> str:
    return publisher.node or f"the publisher {publisher.gid.hex()}"
