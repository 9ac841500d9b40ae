"""The payloads that were accepted last, so that an equal one need not be decoded."""

from __future__ import annotations

from beacon_core.limits import MAX_SHORTCUT_BYTES
from beacon_core.outcome import Outcome, Verdict
from beacon_core.record import Record
from beacon_core.sources import Known, Source

__all__ = ["PayloadMemory"]


class PayloadMemory:
    """One payload per entity: in its source's account, or else in a table of limited size.

    A source usually speaks for one entity. Its payload is at hand in the account, and comparing
    two payloads costs a tenth of hashing one. Further entities of a source go to the table.

    When the table is full it is emptied: that also drops what ended entities left behind, and
    under a fleet that does not fit it still answers for a good part, where evicting the oldest
    would answer for none.

    Thread rule: none of its own; the intake holds its lock.
    """

    def __init__(self, max_bytes: int) -> None:
        """``max_bytes`` limits the payloads in the table, not those in accounts."""
        self._max_bytes = max_bytes
        self._bytes = 0
        self._known: dict[bytes, Known] = {}
        self._payload_of: dict[str, bytes] = {}
        self.recall = self._known.get
        """What the table knows of an equal payload, or ``None``: one look-up, for the hot path."""

    def remember(
        self, payload: bytes, source: Source, incarnation: str, record: Record, version: int
    ) -> None:
        """This payload, sent by this source, led to this version of this record."""
        if len(payload) <= MAX_SHORTCUT_BYTES and _is_free(source.known, record):
            outcome = _outcome(record, source.known)
            source.payload = payload
            source.known = (source, incarnation, record, version, outcome)
            return
        source.speaks_for_several = True
        former = self._payload_of.pop(record.entity_id, b"")
        known = self._known.pop(former, None)
        if known is not None:
            self._bytes -= len(former)
        if self._bytes + len(payload) > self._max_bytes:
            self._known.clear()
            self._payload_of.clear()
            self._bytes = 0
        self._known[payload] = (source, incarnation, record, version, _outcome(record, known))
        self._payload_of[record.entity_id] = payload
        self._bytes += len(payload)


def _is_free(at_hand: Known | None, record: Record) -> bool:
    """Is the place in the account empty, this record's own, or that of one that has ended?"""
    return at_hand is None or at_hand[2] is record or not at_hand[2].revision


def _outcome(record: Record, former: Known | None) -> Outcome:
    """The outcome of refreshing a record, as it was made before if it was."""
    if former is not None and former[2] is record:
        return former[4]
    return Outcome(Verdict.REFRESHED, record.entity_id)
