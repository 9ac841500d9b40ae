"""What the store gives out: immutable values that stay true of the moment they were taken."""

from __future__ import annotations

import attrs

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition

__all__ = ["Changes", "Claim", "StoreStats", "StoredHint"]


@attrs.frozen
class Claim:
    """One claimant to an entity id, and what it says of itself."""

    hint: BeaconHint
    source: str
    incarnation: str
    last_seen_ns: int
    """On the monotonic clock."""


@attrs.frozen
class StoredHint:
    """A hint with everything the store knows about it."""

    hint: BeaconHint
    """All that its holder has said in this life, newest values."""
    status: Status
    cause: Cause
    """Why it has this status."""
    detail: str
    """More about the cause, such as the carrier's words about a loss."""
    last_seen_ns: int
    """On the monotonic clock: when the newest accepted message was sent, as far as is known."""
    first_seen_ns: int
    """When this life began."""
    source: str
    incarnation: str
    revision: int
    """The store's revision at which this entity last changed; a mere refresh is no change."""
    restarts: int
    """How often another process took over this id since it was first known."""
    claims: tuple[Claim, ...] = ()
    """While in conflict: every living claim, the holder's first; otherwise empty."""
    history: tuple[Transition, ...] = ()
    """The latest transitions, oldest first."""

    @property
    def entity_id(self) -> str:
        return self.hint.entity_id

    @property
    def conflict(self) -> bool:
        """Two claimants speak under one id."""
        return bool(self.claims)

    def age_ns(self, now_ns: int) -> int:
        """Nanoseconds since it was last heard, at ``now_ns`` on the monotonic clock; never < 0."""
        return max(0, now_ns - self.last_seen_ns)


@attrs.frozen
class Changes:
    """What has changed since a revision."""

    revision: int
    """Where the store is now: ask with this next time."""
    hints: tuple[StoredHint, ...]
    """New or changed, oldest change first. LEFT ones are among them."""
    gone: tuple[str, ...]
    """Ids whose records ended (expired, displaced, forgotten) and did not come back."""
    complete: bool
    """``hints`` is everything there is: forget whatever you had."""
    too_old: bool
    """The revision asked for is no longer (or not yet) known, so the answer is complete instead."""


@attrs.frozen
class StoreStats:
    """Counts at one moment; the last five are totals since the store was made."""

    active: int
    stale: int
    left: int
    conflicts: int
    bytes: int
    """What the hints are accounted for, by ``beacon_core.limits.hint_bytes``."""
    revision: int
    expired: int
    displaced: int
    refused: int
    restarts: int
    buried: int
