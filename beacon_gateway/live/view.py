"""The live view of one gateway: the feed, its latest events, and everything as it is now.

A revision is a text that clients hand back: the run of the gateway, and the number of the latest
event. After a restart, or when a client was away for too long, it is not known any more; then there
is everything anew instead.
"""

from __future__ import annotations

import secrets
import threading
from collections.abc import Collection

import attrs

from beacon_gateway.gateway import Gateway
from beacon_gateway.live.feed import Event, EventType, Feed, gist
from beacon_gateway.live.ring import Frame, Ring
from beacon_gateway.live.rows import Writer, sse
from beacon_gateway.views import Beacon
from beacon_gateway.writing import to_json

__all__ = ["LiveView", "Snapshot"]

_SNAPSHOT_LIVES_NS = 2_000_000_000
"""A thousand clients that come at once get the same one, and then what has happened since."""


@attrs.frozen
class Snapshot:
    """Everything as it was at one event, ready to send."""

    number: int
    at_ns: int
    data: bytes
    """A whole event of the stream."""


class LiveView:
    """Thread rule: every method may be called from any thread; all but ``behind`` may take some
    milliseconds for each thousand entities, so no event loop should call them."""

    def __init__(self, gateway: Gateway, ring: Ring | None = None) -> None:
        self.clock = gateway.clock
        self.writer = Writer(gateway)
        self.ring = Ring() if ring is None else ring
        self._epoch = secrets.token_hex(4)
        self._directory = gateway.directory
        self._known_revision = gateway.directory.known_revision
        self._feed = Feed(gateway.listeners, gateway.directory.beacon, self.clock.monotonic_ns())
        self._places = {one: self.writer.place(one) for one in self._feed.told}
        self._lock = threading.Lock()
        self._building = threading.Lock()
        self._snapshot: Snapshot | None = None

    def behind(self) -> bool:
        """Is there anything for :meth:`advance` to look at?"""
        others = self._known_revision != self._directory.known_revision
        return others or self._feed.behind(self.clock.monotonic_ns())

    def advance(self) -> None:
        """Take the next changes into the ring."""
        with self._lock:
            self._advance()

    def catch_up(self) -> None:
        """Take all changes into the ring that there are now."""
        with self._lock:
            self._advance()
            while self._feed.pending:
                self._advance()

    def revision(self, number: int) -> str:
        """What a client hands back to go on after this event."""
        return f"{self._epoch}-{number}"

    def number(self, revision: str) -> int | None:
        """The event a client has seen last; ``None`` if it must begin anew."""
        epoch, _, digits = revision.partition("-")
        if epoch != self._epoch or not digits.isdecimal() or len(digits) > 18:
            return None
        return int(digits) if self.ring.reaches(int(digits)) else None

    def snapshot(self) -> Snapshot:
        """Everything as it is now, or was a moment ago: the ring reaches back to it."""
        with self._building:
            known = self._snapshot
            if known is None or not self._is_fresh(known):
                known = self._snapshot = self._built()
            return known

    def listing(self, number: int | None, ids: Collection[str], *, full: bool) -> bytes:
        """The collection's body: everything, or what has changed since an event; of ``ids`` only,
        if there are any."""
        with self._lock:
            told, last = self._feed.told, self.ring.last
            touched = None if number is None else self.ring.entities_after(number)
            asked = told if touched is None else touched
            wanted = [one for one in asked if not ids or one in ids]
            beacons = [(one, told[one]) for one in wanted if one in told]
            gone = [one for one in wanted if one not in told]
            count = len(told)
        write = self.writer.full if full else self.writer.row
        body: dict[str, object] = {
            "revision": self.revision(last),
            "timestamp": self.writer.timestamp(),
            "complete": touched is None,
            "items": [write(*self._aged(*one)) for one in beacons],
            "gone": gone,
            "x-medkit": {"total_count": count},
        }
        return to_json(body)

    def _advance(self) -> None:
        events: list[Event] = []
        if self._known_revision != self._directory.known_revision:
            self._known_revision = self._directory.known_revision
            events.append(self._feed.others_are_expected())
            self._feed.tell_again(
                one for one, place in self._places.items() if place != self.writer.place(one)
            )
        for event in events + self._feed.advance(self.clock.monotonic_ns()):
            self._note_place(event)
            data = to_json(self.writer.event(event))
            frame = sse(event.type.value, data, self.revision(event.number))
            entity_id = event.name if event.beacon is not None else ""
            self.ring.append(Frame(event.number, entity_id, frame))

    def _note_place(self, event: Event) -> None:
        # Before it is written: if the tree changes in between, it is told once more.
        if event.type is EventType.EXPIRED:
            self._places.pop(event.name, None)
        elif event.beacon is not None:
            self._places[event.name] = self.writer.place(event.name)

    def _built(self) -> Snapshot:
        with self._lock:
            number, beacons = self.ring.last, [*self._feed.told.items()]
        at_ns, revision = self.clock.monotonic_ns(), self.revision(number)
        body: dict[str, object] = {
            "revision": revision,
            "timestamp": self.writer.timestamp(),
            "sources": self.writer.sources(),
            "expected": self.writer.expected(),
            "items": [self.writer.row(*self._aged(*one)) for one in beacons],
        }
        return Snapshot(number, at_ns, sse("snapshot", to_json(body), revision))

    def _aged(self, entity_id: str, told: Beacon) -> tuple[str, Beacon]:
        """As told, but as old as it is now: refreshes are not told."""
        now = self._directory.beacon(entity_id)
        return entity_id, told if now is None or gist(now) != gist(told) else now

    def _is_fresh(self, snapshot: Snapshot) -> bool:
        age_ns = self.clock.monotonic_ns() - snapshot.at_ns
        # Near, so that the events since then can still be read when it has been sent.
        return age_ns < _SNAPSHOT_LIVES_NS and self.ring.near(snapshot.number)
