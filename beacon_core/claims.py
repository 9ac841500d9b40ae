"""Who speaks under an id: the holder, and those who claim it too.

Theory. An id should belong to one process at a time. Processes restart, so another process under
the same id is usually its successor; and people copy configurations, so sometimes it is a second
one. The two look alike in the first message. They differ in what follows: a predecessor falls
silent, a rival speaks again. Hence:

* another process in the same place takes the id over at once, which counts as a restart; its
  predecessor is remembered for one ``ttl``. If it is heard again, both claim the id: CONFLICT;
* another *host* while the holder is ACTIVE is a rival at once: nothing restarts across machines
  within a ``ttl`` without having been stale;
* a rival's words are kept beside the holder's, never mixed into them;
* a conflict ends when one of the two has been silent for ``ttl``, has left or was lost. If that is
  the holder, the rival holds the id from then on.
"""

from __future__ import annotations

import attrs

from beacon_core.hint import BeaconHint

__all__ = ["Rival", "same_claimant"]


@attrs.define(eq=False)
class Rival:
    """Somebody other than the holder who has spoken under its id within the last ``ttl``."""

    hint: BeaconHint
    source: str
    incarnation: str
    sequence: int
    last_seen_ns: int
    contending: bool
    """Heard while another held the id; otherwise a predecessor that has been silent since."""


def same_claimant(
    hint: BeaconHint, source: str, incarnation: str, other: BeaconHint, other_source: str, other_incarnation: str
) -> bool:
    """Does ``hint``, as sent by ``source``, come from the process that sent ``other``?

    The strongest evidence that both sides give decides: the incarnation; host and process id; at
    last the source. A message without any source makes no claim and goes to whoever holds the id.
    """
    if not source:
        return True
    if incarnation and other_incarnation:
        return incarnation == other_incarnation
    if hint.hostname and other.hostname and hint.hostname != other.hostname:
        return False
    if hint.process_id and other.process_id:
        if hint.process_id != other.process_id:
            return False
        if hint.hostname and other.hostname:
            return True
    return source == other_source
