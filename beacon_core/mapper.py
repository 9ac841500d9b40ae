"""Hints onto entities: who of the known tree has spoken, and what it says about itself.

A hint about a known app or component gives a *shadow* of it and metadata; its function ids make it
a host of those functions that exist. A hint about nobody known is skipped, or makes a new app.

:func:`map_hints` does it from scratch. :class:`IncrementalMapper` keeps the last result and maps
what changed since: hints as the store tells, and entities that appeared, vanished or changed kind.
Both give the same, but for order: from scratch it is the order of the hints; incrementally an
entity keeps its place while it is there, and comes last when it is new.
"""

from __future__ import annotations

import logging
import threading
from collections import defaultdict
from collections.abc import Collection, Iterable
from typing import Generic, TypeVar

from beacon_core.entities import App, Component, Entities, Function
from beacon_core.introspection import BeaconMetadata, Introspection, Prepared, prepare
from beacon_core.lifecycle import Status
from beacon_core.limits import MAX_SKIPS_LOGGED
from beacon_core.store import HintStore
from beacon_core.stored import Changes, StoredHint
from beacon_core.text import quoted

__all__ = ["IncrementalMapper", "map_hints"]

_log = logging.getLogger(__name__)


def map_hints(
    hints: Iterable[StoredHint],
    entities: Entities,
    now_ns: int,
    *,
    allow_new_entities: bool = False,
) -> Introspection:
    """Map all hints from scratch. Pure; the cost is linear in hints and their function ids.

    Hints that LEFT are left out; any other status but ACTIVE shows as ``stale``. Ages count to
    ``now_ns`` from what the hints say and stay as they are; a hint from after it has one below 0.
    Several hints of one id (no store gives that) make a shadow each, and the last one's metadata.
    """
    apps: list[App] = []
    components: list[Component] = []
    prepared: dict[str, Prepared] = {}
    members: dict[str, dict[str, None]] = defaultdict(dict)
    skipped: dict[str, None] = {}
    revision = 0
    for stored in hints:
        revision = max(revision, stored.revision)
        if stored.status is Status.LEFT:
            continue
        shadow = _shadow(stored, entities, allow_new=allow_new_entities)
        if shadow is None:
            skipped[stored.entity_id] = None
            continue
        if isinstance(shadow, App):
            apps.append(shadow)
        else:
            components.append(shadow)
        prepared[shadow.id] = prepare(stored)
        for function_id in stored.hint.function_ids:
            members[function_id][shadow.id] = None
    functions = [_function(entities, function_id, hosts) for function_id, hosts in members.items()]
    return Introspection(
        revision=revision,
        new_apps=tuple(apps),
        new_components=tuple(components),
        new_functions=tuple(function for function in functions if function),
        metadata=BeaconMetadata(prepared, now_ns),
        skipped=tuple(skipped),
    )


class IncrementalMapper:
    """Maps one store onto a tree, again and again, at the cost of what changed in between.

    An entity that did not change is not looked at, whether refreshed or not; a change copies one
    pointer for each entity, so that results handed out earlier stay as they are. Another
    ``Entities`` object is compared with the last one (linear, but nothing is mapped that need
    not be).

    Thread rule: any thread; calls are taken one at a time. Each result is one consistent state of
    the store. A skipped entity is logged the first time, up to ``MAX_SKIPS_LOGGED`` of them.
    """

    def __init__(self, store: HintStore, *, allow_new_entities: bool = False) -> None:
        self._store = store
        self._allow_new_entities = allow_new_entities
        self._lock = threading.Lock()
        self._revision = 0
        self._entities = Entities()
        self._hints: dict[str, StoredHint] = {}
        self._apps: _Column[App] = _Column()
        self._components: _Column[Component] = _Column()
        self._functions: _Column[Function] = _Column()
        self._skipped: _Column[str] = _Column()
        self._prepared: dict[str, Prepared] = {}
        self._members = _Members()
        self._logged: set[str] = set()

    def introspect(self, entities: Entities) -> Introspection:
        """What the store's hints say about ``entities`` now. Its ages are live."""
        with self._lock:
            changes = self._store.changes_since(self._revision)
            touched = self._take_hints(changes)
            self._take_entities(entities, touched)
            self._remap(touched)
            self._revision = changes.revision
            result = self._result()
            unheard_of = self._to_log(touched)
        for entity_id in unheard_of:
            _log.warning("%s is no known app or component: its hint is skipped", quoted(entity_id))
        return result

    def _take_hints(self, changes: Changes) -> dict[str, None]:
        """Bring ``_hints`` up to date; returns the ids to map again, as an ordered set."""
        touched: dict[str, None] = {}
        if changes.complete:
            touched.update(dict.fromkeys(self._hints))
            self._hints = {}
        for entity_id in changes.gone:
            self._hints.pop(entity_id, None)
            touched[entity_id] = None
        for stored in changes.hints:
            touched[stored.entity_id] = None
            if stored.status is Status.LEFT:
                self._hints.pop(stored.entity_id, None)
            else:
                self._hints[stored.entity_id] = stored
        return touched

    def _take_entities(self, new: Entities, touched: dict[str, None]) -> None:
        """Add to ``touched`` whose kind is another now, and note the functions that changed."""
        old, self._entities = self._entities, new
        if old is new:
            return
        moved = old.apps.keys() ^ new.apps.keys() | old.components.keys() ^ new.components.keys()
        if moved:
            touched.update((entity_id, None) for entity_id in self._hints if entity_id in moved)
        for function_id in (*new.functions, *old.functions):
            if _name(old, function_id) != _name(new, function_id):
                self._members.changed[function_id] = None

    def _remap(self, touched: Iterable[str]) -> None:
        if touched:
            self._prepared = self._prepared.copy()  # the last result holds the other one
        for entity_id in touched:
            self._map_one(entity_id, self._hints.get(entity_id))
        for function_id in self._members.changed:
            hosts = self._members.of(function_id)
            self._functions.put(function_id, _function(self._entities, function_id, hosts))
        self._members.changed.clear()

    def _map_one(self, entity_id: str, stored: StoredHint | None) -> None:
        """Put one entity where it belongs, or (without a hint) away."""
        shadow = stored and _shadow(stored, self._entities, allow_new=self._allow_new_entities)
        self._apps.put(entity_id, shadow if isinstance(shadow, App) else None)
        self._components.put(entity_id, shadow if isinstance(shadow, Component) else None)
        self._skipped.put(entity_id, entity_id if stored and not shadow else None)
        if stored and shadow:
            self._prepared[entity_id] = prepare(stored)
            self._members.put(entity_id, stored.hint.function_ids)
        else:
            self._prepared.pop(entity_id, None)
            self._members.put(entity_id, ())

    def _result(self) -> Introspection:
        return Introspection(
            revision=self._revision,
            new_apps=self._apps.values(),
            new_components=self._components.values(),
            new_functions=self._functions.values(),
            metadata=BeaconMetadata(
                self._prepared, self._store.clock.monotonic_ns(), self._store.last_seen_ns
            ),
            skipped=self._skipped.values(),
        )

    def _to_log(self, touched: Iterable[str]) -> list[str]:
        fresh = [e for e in touched if e in self._skipped and e not in self._logged]
        del fresh[MAX_SKIPS_LOGGED - len(self._logged) :]
        self._logged.update(fresh)
        return fresh


_T = TypeVar("_T")


class _Column(Generic[_T]):
    """One part of the result, by id; a tuple handed out is made again only after a change."""

    def __init__(self) -> None:
        self._items: dict[str, _T] = {}
        self._values: tuple[_T, ...] | None = ()

    def __contains__(self, key: str) -> bool:
        return key in self._items

    def put(self, key: str, value: _T | None) -> None:
        """Set, replace in its place, or (``None``) take away."""
        old = self._items.get(key)
        if value is None:
            if old is None:
                return
            del self._items[key]
        else:
            if old is not None and old == value:
                return
            self._items[key] = value
        self._values = None

    def values(self) -> tuple[_T, ...]:
        if self._values is None:
            self._values = tuple(self._items.values())
        return self._values


class _Members:
    """Who names which function. Unknown functions too: one may appear at any time."""

    def __init__(self) -> None:
        self.changed: dict[str, None] = {}
        """Functions whose hosts are others since somebody emptied this."""
        self._hosts: dict[str, dict[str, None]] = defaultdict(dict)
        self._named: dict[str, tuple[str, ...]] = {}

    def of(self, function_id: str) -> Collection[str]:
        return self._hosts.get(function_id, ())

    def put(self, entity_id: str, function_ids: tuple[str, ...]) -> None:
        """Set all that ``entity_id`` names, in place of what it named before."""
        before = self._named.pop(entity_id, ())
        if function_ids:
            self._named[entity_id] = function_ids
        if before == function_ids:
            return
        if before:
            self._leave(entity_id, set(before).difference(function_ids))
        for function_id in function_ids:
            self._hosts[function_id][entity_id] = None
            self.changed[function_id] = None

    def _leave(self, entity_id: str, function_ids: Iterable[str]) -> None:
        for function_id in function_ids:
            hosts = self._hosts[function_id]
            del hosts[entity_id]
            if not hosts:
                del self._hosts[function_id]
            self.changed[function_id] = None


def _shadow(stored: StoredHint, known: Entities, *, allow_new: bool) -> App | Component | None:
    hint = stored.hint
    if hint.entity_id in known.apps:
        return App(hint.entity_id, hint.display_name, hint.component_id)
    if hint.entity_id in known.components:
        return Component(hint.entity_id, hint.display_name)
    if allow_new:
        return App(hint.entity_id, hint.display_name, hint.component_id, source="beacon")
    return None


def _function(known: Entities, function_id: str, hosts: Collection[str]) -> Function | None:
    function = known.functions.get(function_id)
    return Function(function_id, function.name, tuple(hosts)) if function and hosts else None


def _name(known: Entities, function_id: str) -> str | None:
    function = known.functions.get(function_id)
    return None if function is None else function.name
