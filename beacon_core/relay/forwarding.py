"""What people, and the surroundings, are told of a forwarder and tell it."""

from __future__ import annotations

import enum

import attrs

from beacon_core.relay.ledger import Fate
from beacon_core.relay.values import Mode, Qos, TopicType

__all__ = ["ForwarderStats", "RouteState", "RouteStatus", "SeenTopic"]


@attrs.frozen
class SeenTopic:
    """What the topic side knows of a topic that has a publisher."""

    type: TopicType
    qos: Qos = attrs.field(factory=Qos)
    definition: bytes | None = None
    """The text of the type, if it is known."""


class RouteState(enum.StrEnum):
    """How far a route is; the theory is in :mod:`.forwarder`."""

    OPEN = "open"
    CLOSED = "closed"
    REFUSED = "refused"


@attrs.frozen
class RouteStatus:
    """One topic, as people are told of it."""

    topic: str
    name: str
    """On the other side; empty if refused."""
    state: RouteState
    reason: str
    route: int | None = None
    mode: Mode | None = None
    next: int = 0
    held: int = 0
    held_bytes: int = 0
    fates: dict[Fate, int] = attrs.field(factory=dict)


@attrs.frozen
class ForwarderStats:
    """All routes together, those removed too."""

    entered: int
    held: int
    held_bytes: int
    routes: int
    fates: dict[Fate, int]
    malformed: int
    """What came in and is no frame."""
    foreign: int
    """Frames that are for another forwarder, or for another life of this one."""
