"""The contents of one route, as a republisher puts them in order.

Theory. Numbers come in any order, some twice, some never. ``next`` is how far the forwarder is
known to have come, ``cursor`` what is next here. Each number from the first one that is wanted to
``next`` is entered in the ledger when it is announced, by a content, a digest or an advertisement,
and then it is either held, or missing, or below the cursor and settled::

    first ... cursor ........ next
    settled   held or missing     not announced

:meth:`pop` passes the next one on. What is missing at the cursor stops it, unless nobody has it any
more (``low``), or it has been given up (:meth:`give_up`); then it is settled as that and passed by.
All of this is arithmetic: a number that is announced costs nothing until its content comes.

What the mode changes: BEST_EFFORT passes by whatever is missing before a content that is held.
LATEST holds the newest only, and whatever is before it is settled as conflated when it comes.
"""

from __future__ import annotations

import enum
import heapq

from beacon_core.relay.frames import MAX_RANGES, MAX_SPAN, Advertisement, Content, Range
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.settings import MESSAGE_OVERHEAD_BYTES
from beacon_core.relay.values import Mode

__all__ = ["Placed", "Track", "content_bytes"]


class Placed(enum.Enum):
    """What became of a content."""

    HELD = enum.auto()
    AGAIN = enum.auto()
    """It is held already, has been passed on, or is not wanted any more."""
    NO_ROOM = enum.auto()
    """It is still missing; but of BEST_EFFORT, which nobody sends again, it is given up."""


class Track:
    """Thread rule: none of its own."""

    def __init__(self, advertised: Advertisement, start: int, born_ns: int) -> None:
        self.advertised = advertised
        self.born_ns = born_ns
        self.first = self.cursor = self.next = start
        self.low = 0
        self.held_bytes = 0
        self.ledger = Ledger()
        self.asks = 0
        """Times that it was asked for what is missing, since the last that came."""
        self.outstanding: set[int] = set()
        """What was asked for last and has not come."""
        self.ended: Fate | None = None
        """Nothing will follow, and what is missing ends so."""
        self._held: dict[int, tuple[Content, Fate]] = {}
        self._order: list[int] = []
        self._given_up = 0
        self._given_up_as = Fate.OVERDUE

    @property
    def mode(self) -> Mode:
        """The route's."""
        return self.advertised.mode

    @property
    def held(self) -> int:
        """Contents that are here."""
        return len(self._held)

    @property
    def done(self) -> bool:
        """Nothing is left, and nothing will follow."""
        over = self.advertised.closed or self.ended is not None
        return over and self.cursor == self.next

    @property
    def flows(self) -> bool:
        """It has begun, and nothing is held or missing."""
        return self.cursor == self.next > self.first and self.ended is None

    def announce(self, low: int, after: int) -> None:
        """The forwarder has come to ``after``, and has nothing below ``low`` any more."""
        if after > self.next and self.ended is None:
            self.ledger.enter(after - self.next)
            self.next = after
        self.low = max(self.low, min(low, self.next))

    def place(self, content: Content, fate: Fate, *, room: bool) -> Placed:
        """A content has come; it is to end as ``fate``. Without ``room`` it is only announced."""
        seq = content.seq
        self.announce(0, seq + 1)
        if seq < self.cursor or seq in self._held or seq >= self.next:
            return Placed.AGAIN
        if self.mode is Mode.LATEST:
            return self._replace(content, fate)
        if not room:
            if self.mode is Mode.BEST_EFFORT:
                self.stop_waiting(seq + 1)
            return Placed.NO_ROOM
        self._hold(content, fate)
        return Placed.HELD

    def may_be_next(self, seq: int) -> bool:
        """Does nothing have to be waited for before this content?"""
        return seq == self.cursor or self.mode is Mode.BEST_EFFORT

    def pop(self) -> tuple[Content, Fate] | None:
        """The next content in order, or ``None`` if it is missing. The caller settles it."""
        self._pass_by()
        if not self._order or self._order[0] != self.cursor:
            return None
        heapq.heappop(self._order)
        self.cursor += 1
        content, fate = self._held.pop(self.cursor - 1)
        self.held_bytes -= content_bytes(content)
        return content, fate

    def give_up(self, before: int, fate: Fate) -> None:
        """Whatever is missing below ``before`` is not waited for any more."""
        if before > self._given_up:
            self._given_up, self._given_up_as = min(before, self.next), fate

    def stop_waiting(self, before: int) -> None:
        """The same, after having waited for it for as long as the mode allows."""
        best_effort = self.mode is Mode.BEST_EFFORT
        self.give_up(before, Fate.SKIPPED if best_effort else Fate.OVERDUE)

    def end(self, fate: Fate) -> None:
        """Nothing will follow: what is here is passed on, what is missing ends as ``fate``."""
        self.ended = fate
        self.give_up(self.next, fate)

    def is_missing(self) -> bool:
        """Something is, that the forwarder may still have."""
        wanted_from = max(self.cursor, self.low, self._given_up)
        if self.mode is Mode.LATEST:
            return wanted_from < self.next and self.next - 1 not in self._held
        if wanted_from == self.cursor:
            return self.next - self.cursor > len(self._held)
        return self.next - wanted_from > sum(seq >= wanted_from for seq in self._held)

    def missing(self, most: int) -> tuple[Range, ...]:
        """The first ``most`` of those, in runs."""
        if self.mode is Mode.LATEST:
            return (Range(self.advertised.route, self.next - 1, 1),) if self.is_missing() else ()
        ranges: list[Range] = []
        at = max(self.cursor, self.low, self._given_up)
        for stop in [*sorted(self._order), self.next]:
            while at < stop and most > 0 and len(ranges) < MAX_RANGES:
                count = min(stop - at, most, MAX_SPAN)
                ranges.append(Range(self.advertised.route, at, count))
                at += count
                most -= count
            at = max(at, stop + 1)
        return tuple(ranges)

    def _hold(self, content: Content, fate: Fate) -> None:
        self._held[content.seq] = (content, fate)
        heapq.heappush(self._order, content.seq)
        self.held_bytes += content_bytes(content)
        self.outstanding.discard(content.seq)

    def _replace(self, content: Content, fate: Fate) -> Placed:
        self.ledger.settle(Fate.CONFLATED, content.seq - self.cursor)
        self.cursor = content.seq
        self._held.clear()
        self._order.clear()
        self.outstanding.clear()
        self.held_bytes = 0
        self._hold(content, fate)
        return Placed.HELD

    def _pass_by(self) -> None:
        stop = self._order[0] if self._order else self.next
        latest = self.mode is Mode.LATEST
        self._settle_to(min(stop, self.low), Fate.CONFLATED if latest else Fate.EVICTED)
        self._settle_to(min(stop, self._given_up), self._given_up_as)
        if self.mode is Mode.BEST_EFFORT and self._order:
            self._settle_to(stop, Fate.SKIPPED)

    def _settle_to(self, stop: int, fate: Fate) -> None:
        if stop > self.cursor:
            self.ledger.settle(fate, stop - self.cursor)
            self.cursor = stop


def content_bytes(content: Content) -> int:
    """What a waiting content counts for."""
    return len(content.payload) + MESSAGE_OVERHEAD_BYTES
