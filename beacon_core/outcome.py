"""What became of a message: every message ends in exactly one verdict, and each is counted."""

from __future__ import annotations

import enum

import attrs

__all__ = ["ACCEPTED", "Outcome", "Refusal", "Verdict"]


class Verdict(enum.StrEnum):
    """The names are the counters' names."""

    NEW = "new"
    """A hint about an entity that was not known: a life begins."""
    CHANGED = "changed"
    """A known entity said something new."""
    REFRESHED = "refreshed"
    """A known entity said the same again."""
    CONTENDED = "contended"
    """A rival claim to a known id: kept beside the holder's, not mixed into it."""
    LEFT = "left"
    """A goodbye was taken."""
    LOST = "lost"
    """The carrier saw the sender vanish; the hint is STALE at once."""

    OLDER = "older"
    """A late, repeated or superseded message: it changed nothing."""
    BURIED = "buried"
    """It came after the goodbye and does not prove a new life: it changed nothing."""
    UNKNOWN = "unknown"
    """A goodbye or a loss of somebody who is not known, or not the holder of the id."""

    SOURCE_RATE = "source-rate"
    """Dropped: its source speaks faster than the per-source rate."""
    GLOBAL_RATE = "global-rate"
    """Dropped: all sources together speak faster than the global rate."""
    STORE_FULL = "store-full"
    """Dropped: a new id, and no room by count or bytes among the living."""

    TOO_LARGE = "too-large"
    """Rejected unread: more bytes than a hint may have."""
    MALFORMED = "malformed"
    """Rejected: the bytes are not a hint in this wire format."""
    INVALID = "invalid"
    """Rejected by the validator: the entity id is not one."""
    FAULT = "fault"
    """Rejected: the decoder itself failed. A defect to report; the input is not to blame."""


ACCEPTED = frozenset(
    {
        Verdict.NEW,
        Verdict.CHANGED,
        Verdict.REFRESHED,
        Verdict.CONTENDED,
        Verdict.LEFT,
        Verdict.LOST,
    }
)
"""The verdicts after which the store knows more than before."""


@attrs.frozen
class Outcome:
    """A verdict with what a person would want to know about it."""

    verdict: Verdict
    entity_id: str = ""
    repairs: tuple[str, ...] = ()
    """Each as ``$.path: what was done``; only for accepted hints."""
    detail: str = ""
    """Why, for a rejection; already escaped and short, fit for a log."""

    @property
    def accepted(self) -> bool:
        return self.verdict in ACCEPTED


@attrs.frozen
class Refusal:
    """How many messages ended in one verdict that turns them away, and the latest of them."""

    count: int
    source: str
    """Who sent the latest, as the carrier knows it."""
    detail: str
    """Why, as in :class:`Outcome`."""
