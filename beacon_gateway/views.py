"""One entity as several sources have it, merged by freshness.

Each source keeps a store of its own, with its own time to live, so they may differ about an entity
they all have heard of. The freshest evidence wins: a message when it was sent; a goodbye or a loss
when it was seen. Silence is no evidence while another source still hears the entity, because each
carrier has its own beat. The winner is taken whole: two sources may speak of two processes, and
their words are never mixed.

An end outlives the store that heard of it. A store forgets a goodbye after its own time to live,
while another source, whose time to live is longer, may still have the entity as ACTIVE from before.
So the newest goodbye or loss of an entity stays in force, as one more view, until the source that
told of it has another, or any source has heard the entity since, or no older view is left for it to
outweigh. What is not heard of again is then unknown, as it is with one source.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

import attrs

from beacon_core.lifecycle import Cause, Status
from beacon_core.stored import Claim, StoredHint

__all__ = ["Beacon", "View", "ended_ns", "with_departure"]

_GONE = frozenset({Cause.GOODBYE, Cause.LOST})


@attrs.frozen
class View:
    """One entity as one source has it."""

    source: str
    """The source's name in the configuration."""
    adapter: str
    stored: StoredHint


@attrs.frozen
class Beacon:
    """One entity as all sources together have it."""

    views: tuple[View, ...]
    """The freshest first; at least one."""

    @classmethod
    def of(cls, views: Iterable[View]) -> Beacon | None:
        """``None`` if there is no view at all."""
        freshest_first = tuple(views)
        # Most have one: a list of all entities sorts none of them.
        if len(freshest_first) > 1:
            freshest_first = tuple(sorted(freshest_first, key=_freshness, reverse=True))
        return cls(freshest_first) if freshest_first else None

    def heard_by(self, adapters: Container[str]) -> Beacon | None:
        """The same as the sources with these adapters have it; ``None`` if none of them has."""
        return Beacon.of(view for view in self.views if view.adapter in adapters)

    @property
    def freshest(self) -> View:
        return self.views[0]

    @property
    def stored(self) -> StoredHint:
        """What the freshest source says."""
        return self.views[0].stored

    @property
    def status(self) -> Status:
        return self.stored.status

    @property
    def online(self) -> bool:
        """It is believed to be running."""
        return self.status is Status.ACTIVE

    @property
    def conflict(self) -> bool:
        return bool(self.claims)

    @property
    def claims(self) -> tuple[Claim, ...]:
        """While two claimants speak under this id, in one source or in two: every living claim."""
        within = tuple(claim for view in self.views for claim in view.stored.claims)
        if within:
            return within
        living = [view.stored for view in self.views if view.stored.status is Status.ACTIVE]
        if any(_another_process(living[0], other) for other in living[1:]):
            return tuple(
                Claim(one.hint, one.source, one.incarnation, one.last_seen_ns) for one in living
            )
        return ()


def ended_ns(stored: StoredHint) -> int | None:
    """When it was seen to go, on the monotonic clock; ``None`` if it was not."""
    if stored.cause not in _GONE or not stored.history:
        return None
    return max(stored.last_seen_ns, stored.history[-1].at_ns)


def with_departure(views: Sequence[View], departure: View | None) -> Sequence[View]:
    """The views the sources have now, and a departure from before if it is still in force."""
    if departure is None or any(view.source == departure.source for view in views):
        return views
    at_ns = ended_ns(departure.stored) or 0
    if not views or any(view.stored.last_seen_ns > at_ns for view in views):
        return views
    return [*views, departure]


def _freshness(view: View) -> tuple[bool, int, bool]:
    """Of a message and an end at the same moment, the end is the fresher."""
    stored = view.stored
    if stored.cause in (Cause.SILENT, Cause.HEARD_LATE):
        return False, stored.last_seen_ns, False
    at_ns = ended_ns(stored)
    return True, stored.last_seen_ns if at_ns is None else at_ns, at_ns is not None


def _another_process(one: StoredHint, other: StoredHint) -> bool:
    """Do both name a host or a process id, and not the same?

    Incarnations and senders are the carrier's words, so two carriers cannot be compared by them.
    """
    ours, theirs = one.hint, other.hint
    if ours.hostname and theirs.hostname and ours.hostname != theirs.hostname:
        return True
    return bool(ours.process_id and theirs.process_id and ours.process_id != theirs.process_id)
