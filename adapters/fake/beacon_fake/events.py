"""What will happen, in the order in which it will."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

import attrs

__all__ = ["EventQueue"]


@attrs.frozen(order=True)
class _Event:
    due_ns: int
    serial: int
    happen: Callable[[], None] = attrs.field(order=False)
    in_flight: bool = attrs.field(order=False)


class EventQueue:
    """Events by time; of two that are due together the one made first happens first.

    Times are on the monotonic clock. Thread rule: none of its own; the owner holds a lock.
    """

    def __init__(self) -> None:
        self._heap: list[_Event] = []
        self._serial = itertools.count()

    def __len__(self) -> int:
        return len(self._heap)

    def push(self, due_ns: int, happen: Callable[[], None], *, in_flight: bool) -> None:
        """``in_flight``: a message under way, not something a node will do by itself."""
        heapq.heappush(self._heap, _Event(due_ns, next(self._serial), happen, in_flight))

    def pop_due(self, now_ns: int) -> Callable[[], None] | None:
        """Take out what happens next; ``None`` if nothing is due."""
        if not self._heap or self._heap[0].due_ns > now_ns:
            return None
        return heapq.heappop(self._heap).happen

    def next_due_ns(self) -> int | None:
        """When the next thing happens; ``None`` if nothing will."""
        return self._heap[0].due_ns if self._heap else None

    def last_arrival_ns(self) -> int | None:
        """When the last message that is now under way arrives; ``None`` if none is."""
        return max((event.due_ns for event in self._heap if event.in_flight), default=None)
