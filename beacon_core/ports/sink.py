"""Where a source delivers what it hears."""

from __future__ import annotations

from typing import Protocol

from beacon_core.outcome import Outcome

__all__ = ["HintSink"]


class HintSink(Protocol):
    """What a :class:`~beacon_core.ports.source.HintSource` is given; ``Intake`` is the one we ship.

    Thread rule: any thread may call any method at any time, also several at once. No method
    raises, blocks on I/O or calls back into the source, so a carrier's receive thread may call it
    directly.

    Arguments that all methods share:

    ``source``
        Who sent the message, as the carrier knows it: whatever is hardest to forge. Rates are
        limited and counters kept per source.
    ``incarnation``
        A name for this run of the announcer (a new one at each start), ``""`` if unknown.
    ``sequence``
        Rises with each message of one incarnation, from 1; 0 if unknown. A message that is not
        above the last one of its incarnation is late or a repetition and changes nothing.
    """

    def offer(
        self,
        payload: bytes,
        source: str,
        *,
        entity_id: str = "",
        stamp_ns: int = 0,
        incarnation: str = "",
        sequence: int = 0,
    ) -> Outcome:
        """Hand in one message as it arrived.

        ``entity_id`` is whom the message may speak for, if the carrier says so (a key that access
        control lets nobody else write to); a payload that names another is INVALID. ``""``: anyone.
        ``stamp_ns`` is the sender's wall clock if the carrier brought it beside the payload
        (nanoseconds since 1970, 0 if not); a stamp inside the payload is found by the decoder.
        """

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        """The announcer of ``entity_id`` said that it is leaving."""

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "connection lost"
    ) -> Outcome:
        """The carrier saw the announcer of ``entity_id`` vanish; ``reason`` is shown to people."""
