"""Which record is due next: a calendar of coarse slots in front of a heap.

Theory. A record's deadline moves later with every refresh, and there are many refreshes for each
deadline that is ever reached. A heap alone pays for that either at the refresh (re-sorting) or at
the sweep (popping every entry that has become untrue). So a deadline that is still far away is only
filed under its *slot*, an interval of 2^k nanoseconds: a refresh changes one integer, or moves the
record between two sets. Only when a slot comes near is it sorted, into the heap. Whoever is in it
by then has been silent for nearly its whole time to live, so a sweep pays for what it expires, and
hardly for anything else.

Entries of the heap are never removed from the middle: one is valid while its record's deadline is
still the one it was pushed with. Nor are slots: one is valid while it has members.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

__all__ = ["NEVER", "DeadlineQueue", "Timed"]

NEVER = -(2**63)
"""The deadline and slot of a record that is not in the queue; a clock may well show -1."""

_SLOTS_PER_TTL = 16
"""A slot is at most this part of the shortest usual interval. Finer slots move a record at more of
its refreshes; coarser ones sort more records that are refreshed after all."""

_SLACK = 64
"""Invalid entries the heap may hold beyond twice the valid ones before it is rebuilt."""


class Timed(Protocol):
    """What the queue needs of a record. It alone writes the first two fields."""

    due_ns: int
    """The deadline it stands in the heap with."""
    slot: int
    """The slot it is filed under."""
    slot_end_ns: int
    """Its deadline may move freely up to here, without a word to the queue."""

    @property
    def entity_id(self) -> str:
        """Orders records that are due at the same moment, so that every run is alike."""


_T = TypeVar("_T", bound=Timed)


class DeadlineQueue(Generic[_T]):
    """Thread rule: none of its own; the owner holds a lock."""

    def __init__(self, interval_ns: int, deadline_ns: Callable[[_T], int]) -> None:
        """``interval_ns``: the shortest usual time from scheduling to deadline.

        ``deadline_ns`` tells an item's deadline at any time.
        """
        self._deadline_ns = deadline_ns
        self._shift = max(0, (interval_ns // _SLOTS_PER_TTL).bit_length() - 1)
        # A deadline's slot is its nanoseconds, shifted right by this.
        self._slots: dict[int, set[_T]] = {}
        self._slot_order: list[int] = []
        self._near: list[tuple[int, str, int, _T]] = []
        self._near_limit = _SLACK
        self._horizon = NEVER
        # Slots up to this one have been sorted into the heap.
        self._serial = 0

    def schedule(self, item: _T, deadline_ns: int) -> None:
        """File ``item`` under a new deadline, instead of the one it may have. O(1) if far away."""
        slot = deadline_ns >> self._shift
        if slot <= self._horizon:
            # Filed again under the same deadline, its entry in the heap would stay valid too.
            if item.due_ns != deadline_ns:
                self.cancel(item)
                self._push(item, deadline_ns)
        elif slot != item.slot:
            self.cancel(item)
            item.slot, item.slot_end_ns = slot, (slot + 1) << self._shift
            self._enter_slot(item)

    def cancel(self, item: _T) -> None:
        """Take ``item`` out; nothing happens if it is not in."""
        self._leave_slot(item)
        item.slot = item.slot_end_ns = item.due_ns = NEVER

    def pop_due(self, now_ns: int) -> tuple[int, _T] | None:
        """Take out the earliest deadline at or before ``now_ns``, and its item, if there is one."""
        while self._slot_order and self._slot_order[0] <= now_ns >> self._shift:
            self._bring_near()
        self._drop_invalid()
        if not self._near or self._near[0][0] > now_ns:
            return None
        deadline_ns, *_, item = heapq.heappop(self._near)
        item.due_ns = NEVER
        return deadline_ns, item

    def next_deadline_ns(self) -> int | None:
        """A time at which it is early enough to look again; ``None`` when nothing is filed.

        Not after the earliest deadline, and at most a slot before it: to be exact, a slot would
        have to be sorted whose members will nearly all have moved on by then.
        """
        self._drop_invalid()
        if self._near:
            return self._near[0][0]
        while self._slot_order and self._slot_order[0] not in self._slots:
            heapq.heappop(self._slot_order)
        return self._slot_order[0] << self._shift if self._slot_order else None

    def _enter_slot(self, item: _T) -> None:
        members = self._slots.get(item.slot)
        if members is not None:
            members.add(item)
            return
        self._slots[item.slot] = {item}
        if len(self._slot_order) > 2 * len(self._slots) + _SLACK:
            self._slot_order = sorted(self._slots)
        else:
            heapq.heappush(self._slot_order, item.slot)

    def _leave_slot(self, item: _T) -> None:
        members = self._slots.get(item.slot)
        if members is not None:
            members.discard(item)
            # A set that has been large stays so, and there may be many slots: so not kept if empty.
            if not members:
                del self._slots[item.slot]

    def _bring_near(self) -> None:
        slot = heapq.heappop(self._slot_order)
        self._horizon = slot
        for item in self._slots.pop(slot, ()):
            item.slot = item.slot_end_ns = NEVER
            self._push(item, self._deadline_ns(item))

    def _push(self, item: _T, deadline_ns: int) -> None:
        if len(self._near) >= self._near_limit:
            self._near = [entry for entry in self._near if _valid(entry)]
            heapq.heapify(self._near)
            self._near_limit = 2 * len(self._near) + _SLACK
        # The serial keeps two records of one id, an ended and a new one, out of comparisons.
        self._serial += 1
        item.due_ns = deadline_ns
        heapq.heappush(self._near, (deadline_ns, item.entity_id, self._serial, item))

    def _drop_invalid(self) -> None:
        while self._near and not _valid(self._near[0]):
            heapq.heappop(self._near)


def _valid(entry: tuple[int, str, int, Timed]) -> bool:
    return entry[-1].due_ns == entry[0]
