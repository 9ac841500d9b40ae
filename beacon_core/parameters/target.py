"""A node that is asked, and a question under way."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import attrs

from beacon_core.parameters.fields import read
from beacon_core.ports.asking import Drop, NodeClient
from beacon_core.wire import json

__all__ = ["Poll", "Target"]


@attrs.define(eq=False)
class Poll:
    """One round of questions to one node: what parameters it has, and what their values are."""

    sequence: int
    """Rises from one poll of a node to the next, also across sources: when it began, on the
    machine's monotonic clock (nanoseconds). What is said in answer was said after that."""
    drops: list[Drop] = attrs.field(factory=list)
    values: dict[str, object] = attrs.field(factory=dict)
    awaited: int = 0
    """Values that are asked for one by one and not there yet."""

    def drop(self) -> None:
        """Its answers are not wanted any more."""
        for drop in self.drops:
            drop()


@attrs.define(eq=False)
class Target:
    """One run of a node, from when it is seen in the graph to when it has left."""

    name: str
    seen_ns: int
    client: NodeClient | None = None
    incarnation: str = ""
    """Its GID in hexadecimal; ``""`` if not known, or if several nodes have this name."""
    open: bool = False
    """Its services have been found, and it takes part in the plan."""
    try_ns: int = 0
    """Until then: when to look for its services next."""
    wait_ns: int = 0
    proven: bool = False
    """It answered when it was last asked."""
    silent: bool = False
    """It did not."""
    asked_ns: int = 0
    poll: Poll | None = None
    left_ns: int = 0
    """When an event told that it took its hint back, unless it has answered since."""
    parameters: Mapping[str, object] = attrs.field(factory=dict)
    """What it last answered."""
    payload: bytes = b""
    """The hint in that, ``b""`` if there is none."""
    hint_id: str = ""
    """Whom that is about."""
    told_id: str = ""
    """Who was last handed to the sink on its behalf, and taken."""
    skipped: tuple[str, ...] = ()

    def learn(self, parameters: Mapping[str, object]) -> Collection[str]:
        """Take an answer in; returns what had to be left out and was not before."""
        if parameters == self.parameters:
            return ()
        reading = read(parameters)
        self.parameters = parameters
        self.payload = b"" if reading.hint is None else json.encode(reading.hint)
        self.hint_id = "" if reading.hint is None else reading.hint.entity_id
        before, self.skipped = self.skipped, reading.skipped
        return [line for line in reading.skipped if line not in before]
