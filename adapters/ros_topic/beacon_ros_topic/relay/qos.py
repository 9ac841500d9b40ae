"""What quality of service a topic has that several publish, and whom a publisher can reach.

The decisions, each with its reason, are data: :data:`DECISIONS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.merging import by_name, durable_depth, type_of_most
from beacon_core.relay.values import Qos, TopicType
from beacon_ros_topic.relay.endpoints import End

__all__ = ["DECISIONS", "merged", "profile", "reaches", "remark"]

DECISIONS: Mapping[str, str] = MappingProxyType(
    {
        "reliability": "reliable if all publishers are: a reliable subscription does not hear "
        "best-effort publishers",
        "durability": "transient local if all publishers are: a transient-local subscription does "
        "not hear volatile publishers",
        "depth, volatile": "as configured: DDS does not tell it",
        "depth, transient local": "one for each publisher there was at a time, rounded up to a "
        "power of two: DDS does not tell it, nearly all have 1, and a change of it makes a new "
        "publisher at the far end",
        "type": "that of most publishers; among equals the one it had, or else the first by name: "
        "a topic has one route, and a route one type",
    }
)
"""How publishers that differ are brought together, and why so."""


def merged(ends: Sequence[End], depth: int, before: SeenTopic | None) -> SeenTopic:
    """What the publishers of one topic make of it, by :data:`DECISIONS`.

    ``depth``: of a volatile topic. ``before``: what was told of it before.
    """
    of = type_of_most((one.type for one in ends), before)
    heard = [one for one in ends if one.type == of]
    durable = all(one.durable for one in heard)
    if durable:
        depth = durable_depth([1] * len(heard), before)
    return SeenTopic(of, Qos(all(one.reliable for one in heard), durable, depth))


def remark(ends: Sequence[End], chosen: SeenTopic) -> str:
    """Who is not heard for its type, in a sentence; ``""`` if all are."""
    others = sorted({one.type for one in ends if one.type != chosen.type}, key=by_name)
    if not others:
        return ""
    told = ", ".join(_told(one) for one in others)
    return f"it has publishers of {told}, which are not heard; heard is {_told(chosen.type)}"


def reaches(offered: Qos, of: TopicType, end: End) -> bool:
    """Can a publisher of this type and quality of service have this subscription?

    The rule is DDS's: it must offer at least what is asked for.
    """
    return (
        end.type.name == of.name
        and offered.reliable >= end.reliable
        and offered.durable >= end.durable
    )


def profile(qos: Qos, queue: int) -> QoSProfile:
    """As rclpy wants it. ``queue``: the depth at least."""
    return QoSProfile(
        depth=max(qos.depth, queue),
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.durable else DurabilityPolicy.VOLATILE,
    )


def _told(of: TopicType) -> str:
    return f"{of.name} ({of.digest[:15] or 'no hash'})"
