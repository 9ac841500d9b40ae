"""One topic of one forwarder, as it is published: its publisher, and the routes that feed it.

Theory. A publisher is made as soon as a route's type is known, and then the first messages wait for
those who are to hear them; nobody waits for nobody, and nobody waits for ever::

    IDLE        no publisher
    WAIT_MATCH  made; what comes is held until all subscriptions that there are have matched, or
                until it has waited long enough
    LIVE        what is in order is published at once
    REFUSED     it could not be made, and is tried again now and then; meanwhile nothing is held but
                what a STATE route must keep

Routes of one topic follow each other: when the type changes, or when the forwarder is restarted.
They feed the lane one after the other, each when the one before is done. A publisher stays while
type and quality of service do; another type has another publisher, so it cannot be mistaken.
"""

from __future__ import annotations

import bisect
import enum
from collections.abc import Mapping
from types import MappingProxyType

from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType

__all__ = ["TRANSITIONS", "Cause", "Lane", "LaneState"]


class LaneState(enum.StrEnum):
    """The theory is above."""

    IDLE = "idle"
    WAIT_MATCH = "wait-match"
    LIVE = "live"
    REFUSED = "refused"


class Cause(enum.StrEnum):
    """What moves a lane from one state to another."""

    MADE = "a publisher is made"
    MATCHED = "all subscriptions have matched"
    WAITED = "it has waited long enough"
    FAILED = "the publisher could not be made"
    ENDED = "nothing feeds it any more"


_S = LaneState

TRANSITIONS: Mapping[tuple[LaneState, Cause], LaneState] = MappingProxyType(
    {
        (_S.IDLE, Cause.MADE): _S.WAIT_MATCH,
        (_S.WAIT_MATCH, Cause.MADE): _S.WAIT_MATCH,
        (_S.WAIT_MATCH, Cause.MATCHED): _S.LIVE,
        (_S.WAIT_MATCH, Cause.WAITED): _S.LIVE,
        (_S.WAIT_MATCH, Cause.FAILED): _S.REFUSED,
        (_S.WAIT_MATCH, Cause.ENDED): _S.IDLE,
        (_S.LIVE, Cause.MADE): _S.WAIT_MATCH,
        (_S.LIVE, Cause.FAILED): _S.REFUSED,
        (_S.LIVE, Cause.ENDED): _S.IDLE,
        (_S.REFUSED, Cause.MADE): _S.WAIT_MATCH,
        (_S.REFUSED, Cause.ENDED): _S.IDLE,
    }
)
"""All that can happen."""


class Lane:
    """Thread rule: none of its own."""

    def __init__(self, number: int, origin: int, name: str, now_ns: int) -> None:
        self.number, self.origin, self.name = number, origin, name
        self.state, self.reason, self.since_ns = LaneState.IDLE, "", now_ns
        self.handle: int | None = None
        self.offers: tuple[TopicType, Qos] | None = None
        self.tracks: list[Track] = []

    @property
    def head(self) -> Track | None:
        """The route whose turn it is."""
        return self.tracks[0] if self.tracks else None

    def add(self, track: Track) -> None:
        """Let a route follow those before it."""
        bisect.insort(self.tracks, track, key=_turn)

    def move(self, cause: Cause, now_ns: int, reason: str = "") -> None:
        """Go where the table says; ``LookupError`` for what cannot happen."""
        self.state = TRANSITIONS[self.state, cause]
        self.reason, self.since_ns = reason or cause.value, now_ns

    def lets_pass(self, track: Track) -> bool:
        """What is in order may leave the track now, to be published or refused."""
        if track is not self.head:
            return False
        if self.state is LaneState.REFUSED:
            return track.mode is not Mode.STATE or track.ended is not None
        return self.state is LaneState.LIVE


def _turn(track: Track) -> tuple[int, int]:
    return track.advertised.epoch, track.advertised.route
