"""What the relay's world is made of: its names, what it notes of a message, and of calls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import attrs

from beacon_core.relay.effects import Effect
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode, TopicType

__all__ = ["MS", "ORIGIN", "Recorder", "Taken", "names"]

MS = 10**6
ORIGIN = 7


def names(shaping: Shaping = UNSHAPED, priorities: Sequence[int] = (0, 0, 0, 0)) -> NameMap:
    """All topics but ``/ordered/b`` and ``/twin`` are shaped."""
    ordered, latest, best, state = (attrs.evolve(shaping, priority=one) for one in priorities)
    return NameMap(
        (
            Rule(allow=True, pattern="/ordered/b", to="/r/ordered/b", mode=Mode.ORDERED),
            Rule(True, "/ordered/*", "/r/ordered/*", Mode.ORDERED, ordered),
            Rule(True, "/latest/*", "/r/latest/*", Mode.LATEST, latest),
            Rule(True, "/best/*", "/r/best/*", Mode.BEST_EFFORT, best),
            Rule(True, "/state/*", "/r/state/*", Mode.STATE, state),
            Rule(allow=True, pattern="/twin", to="/r/ordered/a", mode=Mode.ORDERED),
        )
    )


@attrs.frozen
class Taken:
    """A message that the source was given and did not refuse."""

    epoch: int
    route: int
    seq: int
    at_ns: int
    name: str
    type: TopicType
    mode: Mode
    aged: bool
    """Its rule gives it an age."""
    first: int
    hop: int


class Recorder:
    """Passes calls on and keeps them, so that they can be made again."""

    def __init__(self, make: Callable[[], Any]) -> None:
        self._make = make
        self.core = make()
        self._calls: list[tuple[str, tuple[Any, ...], dict[str, Any], list[Effect]]] = []

    def call(self, method: str, *args: Any, **named: Any) -> list[Effect]:
        effects: list[Effect] = getattr(self.core, method)(*args, **named)
        self._calls.append((method, args, named, effects))
        return effects

    def replays_alike(self) -> bool:
        again = self._make()
        return all(getattr(again, m)(*args, **named) == out for m, args, named, out in self._calls)
