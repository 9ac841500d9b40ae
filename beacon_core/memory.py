"""The payloads that were accepted last, so that an equal one need not be decoded."""

from __future__ import annotations

from beacon_core.limits import MAX_SHORTCUT_BYTES
from beacon_core.outcome import Outcome, Verdict
from beacon_core.record import Record
from beacon_core.sources import Known, Source

__all__ = ["PayloadMemory"]


class PayloadMemory:
    """One payload per entity, up to a number of bytes.

    A source that speaks for one entity has its payload at hand: comparing two payloads is a tenth
    of the cost of hashing one. The others are looked up.

    When the memory is full it is emptied: that also drops what ended entities left behind, and
    under a fleet that does not fit it still answers for a good part, where evicting the oldest
    would answer for none.

    Thread rule: none of its own; the intake holds its lock.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._bytes = 0
        self._known: dict[bytes, Known] = {}
        self._payload_of: dict[str, bytes] = {}
        self.recall = self._known.get
        """What was remembered with an equal payload, or ``None``: one look-up, for the hot path."""

    def remember(
        self, payload: bytes, source: Source, incarnation: str, record: Record, version: int
    ) -> None:
        """This payload, sent by this source, led to this version of this record."""
        entity_id = record.entity_id
        former = self._payload_of.pop(entity_id, b"")
        if self._known.pop(former, None) is not None:
            self._bytes -= len(former)
        if self._bytes + len(payload) > self._max_bytes:
            self._known.clear()
            self._payload_of.clear()
            self._bytes = 0
        outcome = Outcome(Verdict.REFRESHED, entity_id)
        self._known[payload] = known = (source, incarnation, record, version, outcome)
        self._payload_of[entity_id] = payload
        self._bytes += len(payload)
        if len(payload) <= MAX_SHORTCUT_BYTES:
            source.payload, source.known = payload, known
