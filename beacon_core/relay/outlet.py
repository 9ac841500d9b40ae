"""Who goes out next, where not everything goes out at once: priorities, fair shares, one bucket.

Theory. All contents of shaped routes, and all contents whatever if the link has a bucket, wait in
their histories and leave here, each as soon as the link's bucket lets it:

* The class with the highest priority that waits goes first.
* Within a class each route has its turn, with ``QUANTUM_BYTES`` more to spend each time (deficit
  round robin, Shreedhar and Varghese, 1995): so two that always wait get the same number of bytes,
  but for a quantum and a frame.
* So that nobody starves, every ``PATIENCE``-th frame that would go while lower classes wait is one
  of theirs instead: of the one that has waited longest.

Hence the bound: before the first message of a class, at most one frame of each lower class goes,
besides one that is under way; of all lower classes together at most one in ``PATIENCE`` frames. And
of each class that waits, at least one in ``PATIENCE * 7`` goes.

A route of its own rate whose turn has not come (only the newest message of LATEST waits for that)
is set aside until then. Control frames are never held back, but paid for from the same bucket.
"""

from __future__ import annotations

from collections import deque

from beacon_core.relay.frames import HEADER_BYTES
from beacon_core.relay.history import Kept
from beacon_core.relay.pace import SLACK_NS, Pace
from beacon_core.relay.shaping import PRIORITIES
from beacon_core.relay.waiting import Waiting

__all__ = ["PATIENCE", "QUANTUM_BYTES", "Outlet", "frame_bytes"]

PATIENCE = 32
"""So many frames, and one of them is of a lower class, if one waits."""

QUANTUM_BYTES = 64 * 1024
"""What a route may send more each time that its turn comes; most messages fit into one."""


class Outlet:
    """Thread rule: none of its own."""

    def __init__(self, link_bytes_per_s: float | None, now_ns: int) -> None:
        self._link = None if link_bytes_per_s is None else Pace(link_bytes_per_s, SLACK_NS, now_ns)
        self._rings: list[deque[Waiting]] = [deque() for _ in range(PRIORITIES)]
        self._waits: set[int] = set()
        # Who is in a ring, by number.
        self._later: dict[int, Waiting] = {}
        # Whose own turn has not come.
        self._passed_over = 0
        # Frames that have gone since one of a lower class has, while one waited.
        self._turns = list(range(PRIORITIES))
        # When each class went last, by count: the one that is served counts on.

    @property
    def limited(self) -> bool:
        """The link has a bucket: all routes leave here."""
        return self._link is not None

    def pay(self, size: int, now_ns: int) -> None:
        """A control frame goes out, at once and in any case."""
        if self._link is not None:
            self._link.spend(size, now_ns)

    def add(self, one: Waiting, now_ns: int, *, paced: bool) -> None:
        """Something of it waits; ``paced``: for its own turn as well."""
        if one.number in self._waits:
            return
        if paced and one.free_ns > now_ns:
            self._later[one.number] = one
            return
        self._later.pop(one.number, None)
        self._waits.add(one.number)
        self._rings[one.priority].append(one)

    def remove(self, one: Waiting) -> None:
        """Nothing of it waits any more."""
        self._later.pop(one.number, None)
        if one.number in self._waits:
            self._waits.discard(one.number)
            self._rings[one.priority].remove(one)
        one.clear()

    def due_ns(self) -> int | None:
        """When :meth:`next` is to be called again; ``None``: when something is added."""
        dues = [one.free_ns for one in self._later.values()]
        if self._waits:
            dues.append(0 if self._link is None else self._link.free_ns)
        return min(dues, default=None)

    def next(self, now_ns: int) -> tuple[Waiting, Kept] | None:
        """What is to go out now: it is paid for. ``None``: nothing may, until :meth:`due_ns`."""
        for one in [one for one in self._later.values() if one.free_ns <= now_ns]:
            self.add(one, now_ns, paced=False)
        while self._waits and (self._link is None or self._link.free_ns <= now_ns):
            picked = self._pick(self._class(), now_ns)
            if picked is not None:
                self._sent(*picked, now_ns)
                return picked
        return None

    def _class(self) -> int:
        waiting = [one for one in reversed(range(PRIORITIES)) if self._rings[one]]
        if len(waiting) > 1 and self._passed_over >= PATIENCE - 1:
            return min(waiting[1:], key=self._turns.__getitem__)
        return waiting[0]

    def _pick(self, priority: int, now_ns: int) -> tuple[Waiting, Kept] | None:
        """The next of this class; ``None`` if what waited has gone in the meantime."""
        ring = self._rings[priority]
        while ring:
            one = ring[0]
            kept = one.head(now_ns)
            if kept is None:
                ring.popleft()
                self._waits.discard(one.number)
                one.credit = 0
            elif one.credit >= frame_bytes(kept):
                return one, kept
            else:
                one.credit += QUANTUM_BYTES
                ring.rotate(-1)
        return None

    def _sent(self, one: Waiting, kept: Kept, now_ns: int) -> None:
        size = frame_bytes(kept)
        one.credit -= size
        one.sent(kept)
        self.pay(size, now_ns)
        self._turns[one.priority] = max(self._turns) + 1
        if any(self._rings[one.priority + 1 :]):
            self._passed_over = 0
        elif any(self._rings[: one.priority]):
            self._passed_over += 1


def frame_bytes(kept: Kept) -> int:
    """What a content counts for on the link."""
    return HEADER_BYTES + len(kept.payload)
