"""Who publishes, and whom each publisher spoke for.

Theory. Middleware numbers publishers by GIDs, and brings the GID with each message; the ROS graph
lists the GIDs that are there. A publisher that was listed and is not any more has gone: at once if
its process ended it in order, after the lease of its DDS participant (20 s) if the process was
killed or the network cut. Neither is proof of a goodbye: so what it spoke for is lost, not left.

One that was heard but is not listed is not taken for gone: discovery may lag behind messages. If
it never is listed, it came and went between two looks at the graph, or its middleware shows other
GIDs there: it is forgotten after a while without a word, and the time to live does the rest.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs

from beacon_core.outcome import Outcome

__all__ = ["MAX_PUBLISHERS", "MAX_SPOKEN_FOR", "UNLISTED_FOR_S", "Publisher", "Roster"]

MAX_PUBLISHERS = 20_000
"""Twice the hints a store keeps."""

MAX_SPOKEN_FOR = 100_000
"""Entities remembered, over all publishers; each takes about 100 bytes."""

UNLISTED_FOR_S = 10.0
"""So long one that was heard may stay out of the graph; discovery takes 3 s at the worst."""


@attrs.define(eq=False)
class Publisher:
    """One publisher that was heard or is listed."""

    name: str
    """Its GID in hexadecimal: what a sink is told as source, and as incarnation."""
    entities: dict[str, None] = attrs.field(factory=dict)
    """Whom it spoke for and did not say goodbye for."""
    listed: bool = False
    unlisted_since_s: float | None = None
    """When a look at the graph first missed it."""
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
        """How often there was no room to remember a publisher or an entity that was heard: it is
        taken all the same, but not missed when it goes."""

    def messages(self) -> int:
        """How many came, from all that were ever met. Any thread may ask."""
        return self._messages_of_others + sum(one.messages for one in [*self.publishers.values()])

    def meet(self, gid: bytes) -> Publisher:
        """The publisher with this GID, which was heard; made now if it was never met."""
        found = self.publishers.get(gid)
        if found is None:
            found = Publisher(gid.hex())
            if len(self.publishers) < MAX_PUBLISHERS:
                self.publishers[gid] = found
            else:
                self.refused += 1
                self._messages_of_others += 1
        return found

    def spoke(self, gid: bytes, entity_id: str) -> None:
        """The publisher with this GID was heard to speak for this entity."""
        publisher = self.publishers.get(gid)
        if publisher is None or entity_id in publisher.entities:
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

    def gone(self, listed: Iterable[bytes], now_s: float) -> list[Publisher]:
        """Those that have gone, given the GIDs that are listed now; they are forgotten."""
        present = set(listed)
        for gid in present - self.publishers.keys():
            if len(self.publishers) < MAX_PUBLISHERS:
                self.publishers[gid] = Publisher(gid.hex())
        gone = []
        for gid, one in [*self.publishers.items()]:
            if gid in present:
                one.listed = True
            elif one.listed:
                gone.append(self._forget(gid))
            elif one.unlisted_since_s is None:
                one.unlisted_since_s = now_s
            elif now_s - one.unlisted_since_s > UNLISTED_FOR_S:
                self._forget(gid)
        return gone

    def _forget(self, gid: bytes) -> Publisher:
        publisher = self.publishers[gid]
        # In this order: who counts meanwhile may count it twice, but never loses it.
        self._messages_of_others += publisher.messages
        del self.publishers[gid]
        self._spoken_for -= len(publisher.entities)
        return publisher
