"""Who gives way in a full store. The order is explained at the top of :mod:`.store`."""

from __future__ import annotations

import heapq
from collections.abc import Callable

from beacon_core.lifecycle import Status
from beacon_core.record import Record

__all__ = ["Room"]

_SLACK = 64
"""Outdated entries the heap may hold beyond twice the valid ones before it is rebuilt."""

_Entry = tuple[int, int, str]


class Room:
    """Counts and bytes by status, and the heap of those that give way first.

    Thread rule: none of its own; the store holds its lock.
    """

    def __init__(self, max_hints: int, max_bytes: int) -> None:
        self.max_hints = max_hints
        self.max_bytes = max_bytes
        self.count = dict.fromkeys((Status.ACTIVE, Status.STALE, Status.LEFT), 0)
        self.total_bytes = 0
        self._active_bytes = 0
        self._idle: list[_Entry] = []

    def enter(self, record: Record) -> None:
        """A record begins to count, under the status and the size it has now."""
        self.count[record.status] += 1
        self.total_bytes += record.size
        if record.status is Status.ACTIVE:
            self._active_bytes += record.size

    def leave(self, record: Record) -> None:
        """A record ceases to count under the status and the size it has now."""
        self.count[record.status] -= 1
        self.total_bytes -= record.size
        if record.status is Status.ACTIVE:
            self._active_bytes -= record.size

    def resize(self, record: Record, size: int) -> None:
        """A record's words have been replaced by others of this size."""
        growth = size - record.size
        record.size = size
        self.total_bytes += growth
        if record.status is Status.ACTIVE:
            self._active_bytes += growth

    def fits(self, *, count: int, size: int) -> bool:
        """Is there room for ``count`` more records with ``size`` more bytes, as things are?"""
        return (count == 0 or len(self) + count <= self.max_hints) and (
            size <= 0 or self.total_bytes + size <= self.max_bytes
        )

    def offer(self, record: Record, records: dict[str, Record]) -> None:
        """Enter a STALE or LEFT record among those that give way, as it is now."""
        heapq.heappush(self._idle, _entry(record))
        if len(self._idle) > 2 * (len(self) - self.count[Status.ACTIVE]) + _SLACK:
            self._idle = sorted({entry for entry in self._idle if _idle(entry, records)})

    def can_be_made(self, *, count: int, size: int, grower: Record | None = None) -> bool:
        """Would ``count`` more records with ``size`` more bytes fit if all idle ones gave way?

        ``grower`` is a record that stays, whatever its status: it is the one that wants to grow.
        """
        staying = self._active_bytes
        if grower is not None and grower.status is not Status.ACTIVE:
            staying += grower.size
        return self.count[Status.ACTIVE] + count <= self.max_hints and (
            size <= 0 or staying + size <= self.max_bytes
        )

    def victims(
        self,
        records: dict[str, Record],
        *,
        count: int,
        size: int,
        displace: Callable[[Record], None],
        grower: Record | None = None,
    ) -> None:
        """Displace idle records until it fits. Only after ``can_be_made`` said yes."""
        kept: list[_Entry] = []
        while not self.fits(count=count, size=size):
            entry = heapq.heappop(self._idle)
            record = _idle(entry, records)
            if record is not None and record is grower:
                kept.append(entry)
            elif record is not None:
                displace(record)
        for entry in kept:
            heapq.heappush(self._idle, entry)

    def __len__(self) -> int:
        return sum(self.count.values())


def _idle(entry: _Entry, records: dict[str, Record]) -> Record | None:
    """The record behind an entry, unless the entry is outdated."""
    record = records.get(entry[2])
    if record is None or record.status is Status.ACTIVE or _entry(record) != entry:
        return None
    return record


def _entry(record: Record) -> _Entry:
    rank = 0 if record.status is Status.LEFT else 1 if record.heard_once else 2
    return rank, record.last_seen_ns, record.entity_id
