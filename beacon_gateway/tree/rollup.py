"""Is an entity active, with everything it depends on?

Theory. An entity is *at fault* if it is not there itself. It is active if nobody is at fault among
all that can be reached from it along ``depends_on``, itself included. A cycle therefore harms
nobody: those on it are active together, or none of them is. Whoever is not active gets the chain
of ids from itself to the nearest one at fault; of several as near the one that is first named.

For the whole tree the question is turned around: from all that are at fault, backwards along
``depends_on``, each entity is met once, at the length of its chain. So the cost is linear, and a
chain is only written down when somebody reads it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypeAlias

import attrs

from beacon_core.lifecycle import Cause, Status
from beacon_gateway.views import Beacon

__all__ = ["DependsOn", "Fault", "RollUp", "RollUps", "fault_of", "roll_up"]


@attrs.frozen
class RollUp:
    """Whether an entity and all it depends on are there."""

    active: bool
    chain: tuple[str, ...] = ()
    """From the entity itself to the one that is at fault; empty if it is active."""
    reason: str = ""
    """What is wrong with the last one of the chain, in one sentence."""


DependsOn: TypeAlias = Callable[[str], Iterable[str]]
"""Whom an entity needs; nobody, for one that is unknown."""

Fault: TypeAlias = Callable[[str], str]
"""Why an entity is not there itself, in one sentence; empty if it is."""


def roll_up(entity_id: str, depends_on: DependsOn, fault: Fault) -> RollUp:
    """One entity. The cost is linear in what can be reached from it."""
    came_from: dict[str, str] = {entity_id: ""}
    waiting = [entity_id]
    for here in waiting:
        reason = fault(here)
        if reason:
            return RollUp(active=False, chain=_way_to(here, came_from), reason=reason)
        for needed in depends_on(here):
            if needed not in came_from:
                came_from[needed] = here
                waiting.append(needed)
    return RollUp(active=True)


class RollUps(Mapping[str, RollUp]):
    """All entities of a tree, worked out at once in linear time.

    Immutable. Thread rule: any thread.
    """

    def __init__(self, entity_ids: Iterable[str], depends_on: DependsOn, fault: Fault) -> None:
        needs = {entity_id: tuple(depends_on(entity_id)) for entity_id in entity_ids}
        self._ids = needs.keys()
        everybody = dict.fromkeys(needs)
        everybody.update((one, None) for needed in needs.values() for one in needed)
        self._faults = {one: reason for one in everybody if (reason := fault(one))}
        self._next = _ways(needs, self._faults)

    def __getitem__(self, entity_id: str) -> RollUp:
        if entity_id not in self._ids:
            raise KeyError(entity_id)
        if entity_id not in self._next:
            return RollUp(active=True)
        chain = [entity_id]
        while step := self._next[chain[-1]]:
            chain.append(step)
        return RollUp(active=False, chain=tuple(chain), reason=self._faults[chain[-1]])

    def __iter__(self) -> Iterator[str]:
        return iter(self._ids)

    def __len__(self) -> int:
        return len(self._ids)


def fault_of(
    entity_id: str, beacon: Beacon | None, *, known: bool = True, heard: bool = True
) -> str:
    """What is wrong with an entity itself, as its beacon has it.

    Without one, it counts whether it is ``known`` (in the tree), and was ever ``heard``.
    """
    if beacon is None:
        if not known:
            return f"{entity_id} is unknown"
        return f"{entity_id} is not heard any more" if heard else f"{entity_id} was never heard"
    if beacon.status is Status.ACTIVE:
        return ""
    if beacon.status is Status.LEFT:
        return f"{entity_id} said goodbye"
    stored = beacon.stored
    why = stored.detail if stored.cause is Cause.LOST and stored.detail else "it is silent"
    return f"{entity_id} is stale: {why}"


def _way_to(entity_id: str, came_from: Mapping[str, str]) -> tuple[str, ...]:
    way = [entity_id]
    while before := came_from[way[-1]]:
        way.append(before)
    return tuple(reversed(way))


def _ways(needs: Mapping[str, Sequence[str]], faults: Iterable[str]) -> dict[str, str]:
    """The next step of each one that is not active; empty for those at fault themselves."""
    needed_by: dict[str, list[str]] = defaultdict(list)
    for one, needed in needs.items():
        for other in needed:
            needed_by[other].append(one)
    distance = dict.fromkeys(faults, 0)
    waiting = list(distance)
    for here in waiting:
        for one in needed_by.get(here, ()):
            if one not in distance:
                distance[one] = distance[here] + 1
                waiting.append(one)
    return {
        one: next((n for n in needs[one] if distance.get(n) == far - 1), "") if far else ""
        for one, far in distance.items()
    }
