"""What a forwarder keeps of one route, so that it can be sent again.

Numbers are given as messages are taken, without gaps; from ``low`` to before ``next`` they are
held. Only the oldest ever goes. Whether it ends as sent or as something else depends on whether it
has been sent at least once.
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
    """One message, as it is to be sent. ``sent_ns`` is when it was last, ``None`` if never."""

    seq: int
    header: bytes
    payload: bytes
    sent_ns: int | None


class History:
    """Thread rule: none of its own."""

    def __init__(self, ledger: Ledger, most: int, unsent: Fate) -> None:
        """At ``most`` so many messages; what gives way to a newer one unsent ends as ``unsent``."""
        self.next = 0
        self.most = most
        self.held_bytes = 0
        self._kept: deque[Kept] = deque()
        self._ledger, self._unsent = ledger, unsent

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def low(self) -> int:
        """The oldest number that is held; ``next`` if none is."""
        return self.next - len(self._kept)

    def take(self, header: bytes, payload: bytes, sent_ns: int | None) -> int:
        """Let the message have the next number, and keep it if any are; the bytes that this adds.

        ``header`` bears that number already.
        """
        seq = self.next
        self.next = seq + 1
        if not self.most:
            self._ledger.pass_on(self._unsent if sent_ns is None else Fate.SENT)
            return 0
        self._ledger.entered += 1
        self._kept.append(Kept(seq, header, payload, sent_ns))
        added = len(payload) + MESSAGE_OVERHEAD_BYTES
        self.held_bytes += added
        return added - self.drop_oldest(self._unsent) if len(self._kept) > self.most else added

    def drop_oldest(self, unsent: Fate) -> int:
        """Let the oldest go: as sent, or as ``unsent`` if it never was. The bytes that frees."""
        kept = self._kept.popleft()
        freed = len(kept.payload) + MESSAGE_OVERHEAD_BYTES
        self.held_bytes -= freed
        self._ledger.settle(unsent if kept.sent_ns is None else Fate.SENT)
        return freed

    def at(self, seq: int) -> Kept:
        """One that is held."""
        return self._kept[seq - self.low]

    def run(self, start: int, count: int) -> Iterator[Kept]:
        """Those of ``count`` messages from ``start`` on that are held."""
        low = self.low
        for seq in range(max(start, low), min(start + count, self.next)):
            yield self._kept[seq - low]
