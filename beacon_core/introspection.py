"""What a set of hints says about a tree of entities: the result of mapping."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

import attrs

from beacon_core.entities import App, Component, Function
from beacon_core.lifecycle import Status
from beacon_core.stored import StoredHint

__all__ = ["BeaconMetadata", "EntityMetadata", "Introspection", "Prepared", "prepare"]

EntityMetadata: TypeAlias = dict[str, str | int | float | tuple[str, ...]]
"""The ``x-medkit-beacon-*`` keys of one entity, fit for JSON."""


Prepared: TypeAlias = dict[str, Any]
"""The same before it is read: in the age's place is when the entity was last heard, in ns."""


class BeaconMetadata(Mapping[str, EntityMetadata]):
    """Metadata by entity id. Each reading gives a dict of its own, free to keep and to change.

    An age is the time from the newest message to ``now_ns``, both on the monotonic clock. Given
    ``last_seen_ns`` (a store's), the newest message is looked up at each reading, so a refresh
    costs the mapping nothing; one that came after ``now_ns`` makes the age 0, never less. Without
    it, or once the entity is gone, the age is that of the message that was mapped.

    Thread rule: may be read from any thread.
    """

    __slots__ = ("_last_seen_ns", "_now_ns", "_prepared")

    def __init__(
        self,
        prepared: Mapping[str, Prepared],
        now_ns: int,
        last_seen_ns: Callable[[str], int | None] | None = None,
    ) -> None:
        self._prepared = prepared
        self._now_ns = now_ns
        self._last_seen_ns = last_seen_ns

    def __getitem__(self, entity_id: str) -> EntityMetadata:
        prepared = self._prepared[entity_id]
        age_ns = self._age_ns(entity_id, prepared[_AGE_KEY])
        return {**prepared, _AGE_KEY: _seconds(age_ns)}

    def __iter__(self) -> Iterator[str]:
        return iter(self._prepared)

    def __len__(self) -> int:
        return len(self._prepared)

    def __contains__(self, entity_id: object) -> bool:
        return entity_id in self._prepared

    def _age_ns(self, entity_id: str, mapped_ns: int) -> int:
        if self._last_seen_ns is None:
            return self._now_ns - mapped_ns
        last_seen_ns = self._last_seen_ns(entity_id)
        return max(0, self._now_ns - (mapped_ns if last_seen_ns is None else last_seen_ns))


@attrs.frozen
class Introspection:
    """What the hints say. It never changes afterwards, but for ages (see :class:`BeaconMetadata`).

    The shadows hold only what the hints add; a gateway lays them over its own entities.
    """

    revision: int
    """The store's revision up to which hints were taken into account."""
    new_apps: tuple[App, ...]
    """Shadows of known apps, and (source ``beacon``) the apps nobody else told of."""
    new_components: tuple[Component, ...]
    new_functions: tuple[Function, ...]
    """Shadows of known functions that somebody joins."""
    metadata: BeaconMetadata
    skipped: tuple[str, ...] = ()
    """Ids with a hint but no known entity, which were therefore left out."""


_PREFIX = "x-medkit-beacon-"
_AGE_KEY = _PREFIX + "age-sec"
_RESERVED = frozenset(
    {
        "status",
        "age-sec",
        "transport-type",
        "negotiated-format",
        "process-id",
        "process-name",
        "hostname",
        "stable-id",
        "depends-on",
        "functions",
    }
)


def prepare(stored: StoredHint) -> Prepared:
    """All of an entity's metadata but its age.

    A structured key is there when its value is given. Free metadata of that name is left out in
    any case: clients rely on the type behind each of those keys.
    """
    hint = stored.hint
    # Written out, since this is most of the cost of mapping: a loop over a table takes twice that.
    fields: Prepared = {
        "x-medkit-beacon-status": "active" if stored.status is Status.ACTIVE else "stale",
        "x-medkit-beacon-transport-type": hint.transport_type,
        "x-medkit-beacon-negotiated-format": hint.negotiated_format,
        "x-medkit-beacon-process-id": hint.process_id,
        "x-medkit-beacon-process-name": hint.process_name,
        "x-medkit-beacon-hostname": hint.hostname,
        "x-medkit-beacon-stable-id": hint.stable_id,
        "x-medkit-beacon-depends-on": hint.depends_on,
        "x-medkit-beacon-functions": hint.function_ids,
    }
    if not all(fields.values()):
        fields = {key: value for key, value in fields.items() if value}
    for name, value in hint.metadata.items():
        if name not in _RESERVED:
            fields[_PREFIX + name] = value
    fields[_AGE_KEY] = stored.last_seen_ns
    return fields


def _seconds(age_ns: int) -> float:
    # Whole milliseconds toward zero, as clients know it; // alone would round -0.4 ms to -1.
    milliseconds = abs(age_ns) // 1_000_000
    return (milliseconds if age_ns >= 0 else -milliseconds) / 1000.0
