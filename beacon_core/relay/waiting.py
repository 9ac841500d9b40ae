"""What of one route waits to go out, where not everything goes out at once.

Theory. Two kinds wait. New messages, in their order: those from ``new`` on; what is before it is
out, or will be asked for. And messages that were asked for, first come first served: they go before
the new ones, since somebody stands still for them.

New ones that wait are not spoken of: digests and advertisements name ``new`` as the next number, or
a republisher would ask for them, and count them as lost when it has waited for long enough. Only a
route that is closed names all that it has, since nobody would wait for what is not announced.

Age is counted from when a message was taken. Messages are taken in order, so those that are too old
are the first ones: all below ``fresh_from``.
"""

from __future__ import annotations

from collections import OrderedDict, deque

from beacon_core.relay.history import History, Kept
from beacon_core.relay.pace import SLACK_NS, Pace
from beacon_core.relay.shaping import Shaping

__all__ = ["Waiting"]


class Waiting:
    """Thread rule: none of its own."""

    def __init__(self, number: int, history: History, shaping: Shaping, now_ns: int) -> None:
        self.number, self.history = number, history
        self.priority = shaping.priority
        self.credit = 0
        """Bytes that it may send before it is another one's turn; kept by the outlet."""
        self.new: int | None = None
        """The oldest new message that waits; ``None``: none does."""
        self._asked: OrderedDict[int, None] = OrderedDict()
        self._max_age_ns = shaping.max_age_ns
        self._taken: deque[int] = deque()
        self._fresh_from = 0
        # What is held from there on was taken at these times.
        self._paces: list[tuple[Pace, bool]] = []
        # And whether it counts messages, not bytes.
        if shaping.rate_hz is not None:
            slack_ns = int(1e9 / shaping.rate_hz)
            self._paces.append((Pace(shaping.rate_hz, slack_ns, now_ns), True))
        if shaping.bytes_per_s is not None:
            self._paces.append((Pace(shaping.bytes_per_s, SLACK_NS, now_ns), False))

    @property
    def free_ns(self) -> int:
        """When its own rates allow another message."""
        return max((pace.free_ns for pace, _ in self._paces), default=0)

    def passes(self, size: int, now_ns: int) -> bool:
        """Whether its own rates let a frame of this size pass; then it has."""
        if self.free_ns > now_ns:
            return False
        self.spend(size, now_ns)
        return True

    def spend(self, size: int, now_ns: int) -> None:
        """A frame of this size passes its own rates."""
        for pace, counts_messages in self._paces:
            pace.spend(1 if counts_messages else size, now_ns)

    def took(self, now_ns: int, *, waits: bool) -> None:
        """The message before ``history.next`` was taken, and ``waits`` to go out."""
        if waits and self.new is None:
            self.new = self.history.next - 1
        if self._max_age_ns is not None:
            self._taken.append(now_ns)

    def ask(self, seq: int) -> bool:
        """Somebody wants it again; ``False`` if it is new: then it comes by itself."""
        if self.new is not None and seq >= self.new:
            return False
        self._asked.setdefault(seq)
        return True

    def told_next(self) -> int:
        """The next number, as far as the other side is to know."""
        return self.history.next if self.new is None else max(self.new, self.history.low)

    def fresh_from(self, now_ns: int) -> int:
        """The oldest message that is not too old; what is held from there on, may be sent."""
        if self._max_age_ns is not None:
            low = self.history.low
            while self._taken and (
                self._fresh_from < low or self._taken[0] + self._max_age_ns <= now_ns
            ):
                self._taken.popleft()
                self._fresh_from += 1
        return self._fresh_from

    def head(self, now_ns: int) -> Kept | None:
        """What goes next; ``None`` if nothing does any more."""
        start = max(self.history.low, self.fresh_from(now_ns))
        while self._asked:
            seq = next(iter(self._asked))
            if seq >= start:
                return self.history.at(seq)
            del self._asked[seq]
        if self.new is None:
            return None
        if start < self.history.next:
            self.new = max(self.new, start)
            return self.history.at(self.new)
        self.new = None
        return None

    def sent(self, kept: Kept) -> None:
        """It has gone out."""
        if kept.seq in self._asked:
            del self._asked[kept.seq]
        else:
            self.new = kept.seq + 1 if kept.seq + 1 < self.history.next else None

    def clear(self) -> None:
        """There is no link: nothing waits, all can be asked for when there is one."""
        self._asked.clear()
        self.new = None
        self.credit = 0
