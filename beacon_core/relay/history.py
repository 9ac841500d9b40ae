"""What a forwarder keeps of one route, so that it can be sent again.

Numbers are given as messages are kept, without gaps; from ``low`` to before ``next`` they are held.
Only the oldest ever goes. Whether it ends as sent or as something else depends on whether it has
been sent at least once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import attrs

from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.settings import MESSAGE_OVERHEAD_BYTES

__all__ = ["History", "Kept"]


@attrs.define
class Kept:
    """One message. ``sent_ns`` is when it was sent last, ``None`` if never."""

    seq: int
    payload: bytes
    stamp_ns: int
    first: int
    hop: int
    sent_ns: int | None = None


class History:
    """Thread rule: none of its own."""

    def __init__(self, ledger: Ledger) -> None:
        self.next = 0
        self.held_bytes = 0
        self._kept: deque[Kept] = deque()
        self._ledger = ledger

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def low(self) -> int:
        """The oldest number that is held; ``next`` if none is."""
        return self.next - len(self._kept)

    def keep(self, payload: bytes, stamp_ns: int, first: int, hop: int) -> Kept:
        """Give the message the next number, and keep it."""
        kept = Kept(self.next, payload, stamp_ns, first, hop)
        self.next += 1
        self._kept.append(kept)
        self.held_bytes += len(payload) + MESSAGE_OVERHEAD_BYTES
        return kept

    def drop_oldest(self, unsent: Fate) -> None:
        """Let the oldest go: as sent, or as ``unsent`` if it never was."""
        kept = self._kept.popleft()
        self.held_bytes -= len(kept.payload) + MESSAGE_OVERHEAD_BYTES
        self._ledger.settle(Fate.SENT if kept.sent_ns is not None else unsent)

    def run(self, start: int, count: int) -> Iterator[Kept]:
        """Those of ``count`` messages from ``start`` on that are held."""
        low = self.low
        for seq in range(max(start, low), min(start + count, self.next)):
            yield self._kept[seq - low]
