"""What has changed in the view that all sources have together, as a row of numbered events.

Theory. The feed keeps what it has *told*: the merged beacon of each entity as it was when it was
last in an event. ``advance`` looks at those entities of which a store says that they have changed,
compares each with what was told, and tells the difference. So

* what was told, with all later events applied, is what is told then: nothing depends on when, or
  how often, the feed is advanced, nor on whether a store still remembers what has changed;
* what came and went between two looks is not told. A restart is, because stores count them;
* a refresh is no change, and neither is which of two living sources spoke last. Only where a mere
  refresh would change the merged status or make or end a conflict (one source still hears an entity
  that another saw go) no store says so: such entities are *watched*, some at each look.

One difference may be several events (an app that comes back as another process has recovered and
restarted); each carries the whole entity, so applying one of them is enough.

What was refused is told too, as sums: at most once per second and source, so that a flood of bad
messages is one line per second here, whatever it is on the wire.
"""

from __future__ import annotations

import enum
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import attrs

from beacon_core.lifecycle import Status
from beacon_core.outcome import Refusal, Verdict
from beacon_gateway.listener import Listener
from beacon_gateway.views import Beacon

__all__ = ["Event", "EventType", "Feed", "gist"]

_LOOKS = 500
"""Entities looked at in one go. A fleet that starts at once is told in portions, which each client
can take before the next; more would only make the first one later."""

_WATCHED_LOOKS = 200
"""Of the watched ones: two thousand per second at ten looks, 2 % of a core."""

_REFUSALS_EVERY_NS = 1_000_000_000


class EventType(enum.StrEnum):
    """What happened."""

    APPEARED = "appeared"
    """It was not told before."""
    UPDATED = "updated"
    """It says something else, a source's view of it has changed, a conflict is over, or the tree
    has it elsewhere."""
    STALE = "stale"
    RECOVERED = "recovered"
    """It is ACTIVE again."""
    RESTARTED = "restarted"
    """Another process took over the id."""
    CONFLICT = "conflict"
    """Two claimants speak under its id from now on."""
    LEFT = "left"
    """It said goodbye."""
    EXPIRED = "expired"
    """Nobody holds it any more: its expiry has passed, or its tombstone's time; or it gave way in a
    full store."""
    REJECTED = "rejected"
    """A source has refused messages."""
    EXPECTED = "expected"
    """Others are known beforehand: the manifest or the configuration was read again."""


_OF_STATUS = {
    Status.ACTIVE: EventType.RECOVERED,
    Status.STALE: EventType.STALE,
    Status.LEFT: EventType.LEFT,
}


@attrs.frozen
class Event:
    """One event."""

    number: int
    """One above that of the event before."""
    type: EventType
    name: str
    """The entity's id; of a ``REJECTED`` the source's name, of an ``EXPECTED`` empty."""
    beacon: Beacon | None = None
    """As it is now; as it was last if it is ``EXPIRED``; ``None`` if it is about none."""
    refusals: Mapping[Verdict, Refusal] = attrs.field(factory=dict)
    """Since the last such event of this source; only of a ``REJECTED``."""


class Feed:
    """Thread rule: one thread at a time; ``behind`` from any."""

    def __init__(
        self, listeners: Sequence[Listener], look: Callable[[str], Beacon | None], now_ns: int
    ) -> None:
        """``look`` gives an entity as all sources have it now.

        What is there already counts as told.
        """
        self.number = 0
        """That of the latest event."""
        self.told: dict[str, Beacon] = {}
        """By the entity's id, in the order in which they appeared."""
        self._listeners = listeners
        self._look = look
        self._revisions = [0] * len(listeners)
        self._pending: dict[str, None] = {}
        self._watched: dict[str, None] = {}
        self._again: set[str] = set()
        self._refused = [listener.intake.refusals() for listener in listeners]
        self._refusals_due_ns = now_ns + _REFUSALS_EVERY_NS
        self._collect()
        while self.pending:
            list(self._changes())
        self.number = 0

    @property
    def pending(self) -> bool:
        """Has the last ``advance`` left something for the next one?"""
        return bool(self._pending)

    def behind(self, now_ns: int) -> bool:
        """Is there anything to look at? Costs next to nothing."""
        return (
            bool(self._pending or self._watched)
            or now_ns >= self._refusals_due_ns
            or self._revisions != [listener.store.revision for listener in self._listeners]
        )

    def advance(self, now_ns: int) -> list[Event]:
        """What has happened since the last time, or the first part of it (see :meth:`behind`)."""
        self._collect()
        events = list(self._changes())
        if now_ns >= self._refusals_due_ns:
            self._refusals_due_ns = now_ns + _REFUSALS_EVERY_NS
            events += self._rejections()
        return events

    def tell_again(self, entity_ids: Iterable[str]) -> None:
        """Something else that is told of them has changed: the next ``advance`` tells of them,
        whether or not a store has news. Only of those that are told."""
        ids = dict.fromkeys(one for one in entity_ids if one in self.told)
        self._pending |= ids
        self._again |= ids.keys()

    def others_are_expected(self) -> Event:
        """The next event, of that kind."""
        return self._event(EventType.EXPECTED, "")

    def _collect(self) -> None:
        for index, listener in enumerate(self._listeners):
            changes = listener.store.changes_since(self._revisions[index])
            if changes.revision == self._revisions[index]:
                # One that has never heard anything says that this is everything.
                continue
            self._revisions[index] = changes.revision
            if changes.complete:
                self._pending.update(dict.fromkeys(self.told))
            self._pending.update((stored.entity_id, None) for stored in changes.hints)
            self._pending.update(dict.fromkeys(changes.gone))

    def _changes(self) -> Iterator[Event]:
        ids = [*_taken(self._pending, _LOOKS), *_taken(self._watched, _WATCHED_LOOKS)]
        for entity_id in dict.fromkeys(ids):
            before, now = self.told.get(entity_id), self._look(entity_id)
            again = entity_id in self._again
            self._again.discard(entity_id)
            if now is None:
                self.told.pop(entity_id, None)
            else:
                if _may_change_unsaid(now):
                    self._watched[entity_id] = None
                if before is not None and not again and gist(before) == gist(now):
                    continue
                self.told[entity_id] = now
            for kind in _difference(before, now):
                yield self._event(kind, entity_id, beacon=now or before)

    def _rejections(self) -> Iterator[Event]:
        for index, listener in enumerate(self._listeners):
            before, now = self._refused[index], listener.intake.refusals()
            self._refused[index] = now
            news = {
                verdict: attrs.evolve(refusal, count=refusal.count - _count(before, verdict))
                for verdict, refusal in now.items()
                if refusal.count != _count(before, verdict)
            }
            if news:
                yield self._event(EventType.REJECTED, listener.name, refusals=news)

    def _event(
        self,
        kind: EventType,
        name: str,
        *,
        beacon: Beacon | None = None,
        refusals: Mapping[Verdict, Refusal] | None = None,
    ) -> Event:
        self.number += 1
        return Event(self.number, kind, name, beacon, refusals or {})


def gist(beacon: Beacon) -> tuple[object, ...]:
    """Equal for two moments between which nothing happened that is worth telling."""
    views = sorted((view.source, view.stored.revision) for view in beacon.views)
    return (beacon.status, beacon.conflict, views)


def _taken(ids: dict[str, None], at_most: int) -> list[str]:
    """The first ones, which are not among them any more."""
    taken = list(itertools.islice(ids, at_most))
    for entity_id in taken:
        del ids[entity_id]
    return taken


def _difference(before: Beacon | None, now: Beacon | None) -> list[EventType]:
    """What to call the way from one to the other."""
    if now is None:
        return [] if before is None else [EventType.EXPIRED]
    kinds = []
    if before is None:
        kinds.append(EventType.APPEARED)
    elif _restarts(now) > _restarts(before):
        kinds.append(EventType.RESTARTED)
    was = Status.ACTIVE if before is None else before.status
    if now.status is not was:
        kinds.append(_OF_STATUS[now.status])
    if now.conflict and not (before is not None and before.conflict):
        kinds.append(EventType.CONFLICT)
    return kinds or [EventType.UPDATED]


def _restarts(beacon: Beacon) -> int:
    """Of all that is counted the most: sources that hear the same entity count the same ones."""
    return max(view.stored.restarts for view in beacon.views)


def _may_change_unsaid(beacon: Beacon) -> bool:
    """Could what is told of it change though no store says that anything has?

    By a refresh of a living view, or because an end that another source told of is forgotten.
    """
    if len(beacon.views) == 1:
        return False
    if beacon.status is not Status.ACTIVE:
        return True
    latest_ns = max(view.stored.last_seen_ns for view in beacon.views) + 1
    return any(
        (told := _as_if_heard(beacon, index, latest_ns)).status is not beacon.status
        or told.conflict is not beacon.conflict
        for index, view in enumerate(beacon.views)
        if view.stored.status is Status.ACTIVE
    )


def _as_if_heard(beacon: Beacon, index: int, at_ns: int) -> Beacon:
    views = list(beacon.views)
    heard = attrs.evolve(views[index].stored, last_seen_ns=at_ns)
    views[index] = attrs.evolve(views[index], stored=heard)
    return Beacon.of(views) or beacon


def _count(refusals: Mapping[Verdict, Refusal], verdict: Verdict) -> int:
    return refusals[verdict].count if verdict in refusals else 0
