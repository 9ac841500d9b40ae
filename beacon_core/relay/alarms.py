"""What is due when, by name. Each name has at most one time.

A heap with entries that are valid while they agree with the table; it is rebuilt when most do not.
"""

from __future__ import annotations

import heapq
from collections.abc import Hashable
from typing import Generic, TypeVar

__all__ = ["Alarms"]

_K = TypeVar("_K", bound=Hashable)

_SLACK = 64
"""Invalid entries beyond twice the valid ones before the heap is rebuilt."""


class Alarms(Generic[_K]):
    """Thread rule: none of its own."""

    def __init__(self) -> None:
        self._due: dict[_K, tuple[int, int]] = {}
        self._heap: list[tuple[int, int, _K]] = []
        self.changed = False
        """Something may be due at another time than when the owner last looked."""
        self._serial = 0
        # Keeps the names out of comparisons, and makes every run alike.

    def set(self, key: _K, due_ns: int) -> None:
        """Make ``due_ns`` the time of ``key``, instead of what it was."""
        self.changed = True
        self._serial += 1
        self._due[key] = (due_ns, self._serial)
        heapq.heappush(self._heap, (due_ns, self._serial, key))
        if len(self._heap) > 2 * len(self._due) + _SLACK:
            self._heap = [(due, serial, one) for one, (due, serial) in self._due.items()]
            heapq.heapify(self._heap)

    def set_if_none(self, key: _K, due_ns: int) -> None:
        """The same, unless it has a time."""
        if key not in self._due:
            self.set(key, due_ns)

    def cancel(self, key: _K) -> None:
        """Nothing is due by this name; nothing happens if there was nothing."""
        if self._due.pop(key, None) is not None:
            self.changed = True

    def pop_due(self, now_ns: int) -> _K | None:
        """Take out the name that was due first, if any is due."""
        due_ns = self.next_ns()
        if due_ns is None or due_ns > now_ns:
            return None
        self.changed = True
        _, _, key = heapq.heappop(self._heap)
        del self._due[key]
        return key

    def next_ns(self) -> int | None:
        """The earliest time of all."""
        while self._heap and self._due.get(self._heap[0][2]) != self._heap[0][:2]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None
