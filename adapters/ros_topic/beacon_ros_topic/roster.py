"""Who publishes, and whom each publisher spoke for.

Theory. Middleware numbers publishers by GIDs, and brings the GID with each message; the ROS graph
lists the GIDs that are there. A publisher that was listed and is not any more has gone: at once if
its process ended it in order, after the lease of its DDS participant (20 s) if the process was
killed or the network cut. One that was heard but never listed (discovery may lag behind messages)
is not taken for gone. Neither is proof of a goodbye: so what it spoke for is lost, not left.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs

from beacon_core.outcome import Outcome

__all__ = ["MAX_PUBLISHERS", "MAX_SPOKEN_FOR", "Publisher", "Roster"]

MAX_PUBLISHERS = 20_000
"""Twice the hints a store keeps."""

MAX_SPOKEN_FOR = 100_000
"""Entities remembered, over all publishers; each takes about 100 bytes."""


@attrs.define(eq=False)
class Publisher:
    """One publisher that was heard or is listed."""

    name: str
    """Its GID in hexadecimal: what a sink is told as source, and as incarnation."""
    entities: dict[str, None] = attrs.field(factory=dict)
    """Whom it spoke for and did not say goodbye for."""
    listed: bool = False
    messages: int = 0
    outcome: Outcome | None = None
    """Of its last message."""


class Roster:
    """Thread rule: one thread; the counters may be read by any."""

    def __init__(self) -> None:
        self.publishers: dict[bytes, Publisher] = {}
        """By GID."""
        self._spoken_for = 0
        self._messages_of_others = 0
        self.refused = 0
        """Publishers and entities that there was no room for: they are heard, but not missed."""

    def messages(self) -> int:
        """How many came, from all that were ever met. Any thread may ask."""
        return self._messages_of_others + sum(one.messages for one in [*self.publishers.values()])

    def meet(self, gid: bytes) -> Publisher:
        """The publisher with this GID; made now if it was never met."""
        found = self.publishers.get(gid)
        if found is None:
            found = Publisher(gid.hex())
            if len(self.publishers) < MAX_PUBLISHERS:
                self.publishers[gid] = found
            else:
                self.refused += 1
        return found

    def spoke(self, publisher: Publisher, entity_id: str) -> None:
        """It was heard to speak for this entity."""
        if entity_id in publisher.entities:
            return
        if self._spoken_for < MAX_SPOKEN_FOR:
            publisher.entities[entity_id] = None
            self._spoken_for += 1
        else:
            self.refused += 1

    def left(self, publisher: Publisher, entity_id: str) -> None:
        """It said goodbye for this entity."""
        if entity_id in publisher.entities:
            del publisher.entities[entity_id]
            self._spoken_for -= 1

    def gone(self, listed: Iterable[bytes]) -> list[Publisher]:
        """Those that have gone, given the GIDs that are listed now; they are forgotten."""
        present = set(listed)
        for gid in present:
            self.meet(gid).listed = True
        gone = [gid for gid, one in self.publishers.items() if one.listed and gid not in present]
        publishers = [self.publishers.pop(gid) for gid in gone]
        self._spoken_for -= sum(len(one.entities) for one in publishers)
        self._messages_of_others += sum(one.messages for one in publishers)
        return publishers
