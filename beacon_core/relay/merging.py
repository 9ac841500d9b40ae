"""What a topic that several publish is taken for, where they differ.

Theory. A route has one type and one depth, and a change of either makes a new publisher at the far
end. So both are chosen such that they seldom change: of types that equally many publish, the one it
had stays, and the depth of a durable topic moves in powers of two and never back.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import TopicType

__all__ = ["MAX_DURABLE_DEPTH", "by_name", "durable_depth", "type_of_most"]

MAX_DURABLE_DEPTH = 1024
"""Late joiners at the far end get no more, however much all publishers keep together."""


def type_of_most(types: Iterable[TopicType], before: SeenTopic | None) -> TopicType:
    """That of most publishers; among equals the one it had ``before``, or else the first by name.

    There must be a publisher.
    """
    counts = Counter(types)
    most = max(counts.values())
    first = sorted((of for of, count in counts.items() if count == most), key=by_name)
    return before.type if before is not None and before.type in first else first[0]


def durable_depth(depths: Sequence[int], before: SeenTopic | None) -> int:
    """How many messages are kept for late joiners of a topic whose publishers keep so many each.

    All together, since a late joiner gets that of each; of several rounded up to a power of two,
    and not less than ``before``.
    """
    together = sum(depths)
    if len(depths) > 1:
        together = 1 << (together - 1).bit_length()
    had = before.qos.depth if before is not None and before.qos.durable else 1
    return min(max(together, had), MAX_DURABLE_DEPTH)


def by_name(of: TopicType) -> tuple[str, str]:
    """To sort types by."""
    return of.name, of.digest
