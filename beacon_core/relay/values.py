"""What both sides of the relay mean by a topic, its type, its quality of service and its mode."""

from __future__ import annotations

import enum

import attrs

__all__ = ["Mode", "Qos", "TopicType"]


class Mode(enum.IntEnum):
    """What is promised about the messages of a route. The numbers are those on the wire."""

    ORDERED = 0
    """In order, without a gap while the forwarder still holds what is missing."""
    LATEST = 1
    """The newest only, and never an older one after a newer one."""
    BEST_EFFORT = 2
    """What is lost stays lost; in order and without repeats all the same, and nobody waits."""
    STATE = 3
    """Like ORDERED, and whoever joins late first gets the last ``Qos.depth`` messages."""


@attrs.frozen
class Qos:
    """What of a topic's quality of service the far end must offer as well."""

    reliable: bool = True
    durable: bool = False
    """Transient local: the original called it latching."""
    depth: int = 10


@attrs.frozen
class TopicType:
    """A type's name and what tells it from others of that name. Neither is empty."""

    name: str
    digest: str
    """The RIHS01 hash, for a ROS 2 type."""
