"""The payloads that were accepted last, so that an equal one need not be decoded."""

from __future__ import annotations

from beacon_core.outcome import Outcome, Verdict

__all__ = ["PayloadMemory"]


class PayloadMemory:
    """One payload per entity, up to a number of bytes.

    When it is full it is emptied: that also drops what ended entities left behind, and under a
    fleet that does not fit it still answers for a good part, where evicting the oldest would
    answer for none.

    Thread rule: none of its own; the intake holds its lock.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._bytes = 0
        self._known: dict[bytes, tuple[int, Outcome]] = {}
        self._payload_of: dict[str, bytes] = {}
        self.recall = self._known.get
        """What was remembered with an equal payload, or ``None``: one look-up, for the hot path."""

    def remember(self, payload: bytes, entity_id: str, content: int) -> None:
        """This payload led to this content version of the entity's record."""
        self._bytes -= len(self._drop(self._payload_of.pop(entity_id, b"")))
        if self._bytes + len(payload) > self._max_bytes:
            self._known.clear()
            self._payload_of.clear()
            self._bytes = 0
        self._known[payload] = content, Outcome(Verdict.REFRESHED, entity_id)
        self._payload_of[entity_id] = payload
        self._bytes += len(payload)

    def _drop(self, payload: bytes) -> bytes:
        self._known.pop(payload, None)
        return payload
