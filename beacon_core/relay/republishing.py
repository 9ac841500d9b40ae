"""What people are told of a republisher."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

import attrs

from beacon_core.relay.lane import Lane, LaneState
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.values import Mode, TopicType

__all__ = ["FrameCounts", "LaneStatus", "RepublisherStats", "stats_of", "status_of"]


@attrs.define
class FrameCounts:
    """Frames that changed nothing, by reason."""

    malformed: int = 0
    own: int = 0
    """This process's own forwarder is heard on the conduit."""
    foreign: int = 0
    """Resets of other republishers."""
    stale: int = 0
    """Of a life of a forwarder that is over, or a control frame overtaken by a newer one."""
    unjoined: int = 0
    """Of a forwarder that has not answered our hello yet."""
    again: int = 0
    """Contents that had come before, or are not wanted any more."""
    no_room: int = 0
    """Contents that the cap left no room for; they can be asked for again."""
    unadvertised: int = 0
    """Contents of a route that nobody would advertise."""
    crowded: int = 0
    """Of a forwarder, or a route, beyond the cap on their number."""


@attrs.frozen
class LaneStatus:
    """One topic of one forwarder."""

    origin: int
    name: str
    state: LaneState
    reason: str
    since_ns: int
    type: TopicType | None
    mode: Mode | None
    waiting: int
    """Contents held."""
    missing: int
    """Contents announced that have not come."""


@attrs.frozen
class RepublisherStats:
    """All routes together, those that are over too."""

    entered: int
    """Contents announced, that are wanted here."""
    held: int
    missing: int
    held_bytes: int
    """Of all that waits, also for its route's advertisement."""
    pending: int
    """Contents that wait for an advertisement; not entered yet."""
    origins: int
    routes: int
    fates: dict[Fate, int]
    frames: FrameCounts


def stats_of(
    past: Ledger,
    lanes: Collection[Lane],
    *,
    held_bytes: int,
    pending: int,
    origins: int,
    routes: int,
    frames: FrameCounts,
) -> RepublisherStats:
    """The books of all lanes together, and of ``past``, the routes that are over."""
    tracks = [track for lane in lanes for track in lane.tracks]
    ledgers = [past, *(track.ledger for track in tracks)]
    fates: Counter[Fate] = Counter()
    for ledger in ledgers:
        fates.update(ledger.fates())
    held = sum(track.held for track in tracks)
    return RepublisherStats(
        entered=sum(ledger.entered for ledger in ledgers),
        held=held,
        missing=sum(track.next - track.cursor for track in tracks) - held,
        held_bytes=held_bytes,
        pending=pending,
        origins=origins,
        routes=routes,
        fates=dict(fates),
        frames=frames,
    )


def status_of(lane: Lane) -> LaneStatus:
    """How one topic is."""
    held = sum(track.held for track in lane.tracks)
    return LaneStatus(
        lane.origin,
        lane.name,
        lane.state,
        lane.reason,
        lane.since_ns,
        lane.offers[0] if lane.offers else None,
        lane.head.mode if lane.head else None,
        held,
        sum(track.next - track.cursor for track in lane.tracks) - held,
    )
