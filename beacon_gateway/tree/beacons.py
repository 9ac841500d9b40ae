"""What the beacons add to the tree: one layer over all sources.

An entity that several sources have heard of is taken as the freshest of them has it
(:mod:`beacon_gateway.views`), and so are its words here. A hint about a known app or component adds
to it; one about nobody known makes a new app, or is skipped. Its function ids make it a host of
those functions that exist. Who said goodbye is listed until its tombstone lapses, but takes part in
nothing. Clients come to apps by way of components; so where hints place apps on one that nobody
else knows, it is one while such an app is listed.

Mapping again costs what has changed. A store tells of its changes, and a refresh is none; but a
refresh may turn the freshest source into another one, so entities of which several sources say
different things are looked at without a change: some of them each time, in turn.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from itertools import islice
from typing import Generic, TypeVar

from beacon_core.lifecycle import Status
from beacon_core.limits import MAX_SKIPS_LOGGED
from beacon_core.store import HintStore
from beacon_gateway.tree.entities import App, Component, Function, Tree
from beacon_gateway.views import Beacon, View

__all__ = ["BEACON", "BeaconLayer"]

BEACON = "beacon"
"""The ``source`` of what nobody but a hint told of."""

_DOUBTS = 100
"""Looked at each time: half a millisecond. Where a whole carrier has fallen silent there are as
many as entities, and whoever asks is not to wait for all of them."""

_T = TypeVar("_T")


class BeaconLayer:
    """Keeps the last result, and maps again what has changed since.

    Thread rule: none of its own; one call at a time. (The stores may be filled meanwhile.)
    """

    def __init__(
        self,
        stores: Sequence[HintStore],
        beacon: Callable[[str], Beacon | None],
        *,
        listed: Iterable[str] = (),
        allow_new_entities: bool,
        area: str = "",
        strict_upstream: bool = False,
    ) -> None:
        """``beacon`` says how all sources together have an entity. ``listed``: ids to remember, if
        they were ever heard. ``area``: where components are that nobody else knows, if there are
        areas. ``strict_upstream``: there are no such components, and what a hint depends on stays
        out of the tree."""
        self._beacon = beacon
        self._allow_new_entities = allow_new_entities
        self._with_dependencies = not strict_upstream
        self._with_components = allow_new_entities and not strict_upstream
        self._area = area
        self._readers = [_Reader(store) for store in stores]
        self._listed: frozenset[str] = frozenset()
        self._silent: set[str] = set()
        self._known = Tree()
        self._tree = Tree()
        self._beacons: dict[str, Beacon] = {}
        self._doubtful: dict[str, None] = {}
        self._changed: dict[str, None] = {}
        self._members = _Named()
        self._placed = _Named()
        self.expect(listed)
        self._skipped: set[str] = set()
        self._newly_skipped: list[str] = []
        self.revision = 0
        """Rises when a beacon has changed in any way but its age."""
        self.touched: Mapping[str, Collection[str]] = {}
        """By kind of entity, of whom the latest tree says another thing than the one before."""

    @property
    def never_heard(self) -> Container[str]:
        """Of the listed ids those of which no hint has ever come."""
        return self._silent

    def last(self, entity_id: str) -> Beacon | None:
        """An entity's beacon as it was mapped last."""
        return self._beacons.get(entity_id)

    def expect(self, listed: Iterable[str]) -> None:
        """Other ids to remember; of those listed before it is known whether they were heard."""
        before, self._listed = self._listed, frozenset(listed)
        self._silent = {
            one
            for one in self._listed
            if (one in self._silent if one in before else one not in self._beacons)
        }

    def listen(self) -> None:
        """Take note of what has changed, and leave the work for later."""
        for reader in self._readers:
            changed = reader.changed()
            self._changed |= changed
            self._silent.difference_update(changed)

    def map(self, known: Tree) -> Tree:
        """What the hints say beside ``known``, which holds what all other layers know.

        The same object as last time if nothing has changed.
        """
        self.listen()
        # Whoever is looked at goes to their end.
        touched = dict.fromkeys(islice(self._doubtful, _DOUBTS)) | self._changed
        self._changed = {}
        before, self._known = self._known, known
        if before is not known:
            touched |= self._moved(before, known)
        if touched or self._members.changed or self._placed.changed:
            self._tree = self._mapped(touched)
        return self._tree

    def newly_skipped(self) -> list[str]:
        """Whose hint was skipped for the first time, since the last call. It is bounded."""
        found, self._newly_skipped = self._newly_skipped, []
        return found

    def _moved(self, old: Tree, new: Tree) -> dict[str, None]:
        """Whose hint means something else now; and what else has to be looked at is noted."""
        self._members.changed.update(dict.fromkeys(old.functions.keys() ^ new.functions.keys()))
        self._placed.changed.update(self._placed.ids())
        moved = old.apps.keys() ^ new.apps.keys() | old.components.keys() ^ new.components.keys()
        return dict.fromkeys(
            one
            for one in self._beacons
            if one in moved or _place_of(one, old) != _place_of(one, new)
        )

    def _mapped(self, touched: Iterable[str]) -> Tree:
        apps, components = _Column(self._tree.apps), _Column(self._tree.components)
        functions = _Column(self._tree.functions)
        for entity_id in touched:
            shadow = self._shadow(entity_id)
            apps.put(entity_id, shadow if isinstance(shadow, App) else None)
            components.put(entity_id, shadow if isinstance(shadow, Component) else None)
            # As an app, or none any more, it may be no component, or one again.
            if self._placed.of(entity_id):
                self._placed.changed[entity_id] = None
        for function_id in self._members.take_changed():
            functions.put(function_id, self._function(function_id))
        for component_id in self._placed.take_changed():
            if component_id not in self._known.components or component_id not in self._beacons:
                components.put(component_id, self._component(component_id, apps.items))
        columns = (components, apps, functions)
        if not any(column.changed for column in columns):
            return self._tree
        self.touched = {
            "components": components.touched,
            "apps": apps.touched,
            "functions": functions.touched,
        }
        return Tree(components=components.items, apps=apps.items, functions=functions.items)

    def _shadow(self, entity_id: str) -> App | Component | None:
        """What its beacon says of it now; keeps the beacon, and whom it hosts, and who hosts it."""
        beacon = self._beacon(entity_id)
        self._note(entity_id, beacon)
        shadow = beacon and self._said(entity_id, beacon)
        if not beacon or not shadow:
            self._members.put(entity_id, ())
            self._placed.put(entity_id, ())
            return None
        gone = beacon.status is Status.LEFT
        self._members.put(entity_id, () if gone else beacon.stored.hint.function_ids)
        named = shadow.component_id if isinstance(shadow, App) else ""
        places = named and self._with_components and not _place_of(entity_id, self._known)
        self._placed.put(entity_id, (named,) if places else ())
        return shadow

    def _said(self, entity_id: str, beacon: Beacon) -> App | Component | None:
        hint = beacon.stored.hint
        depends_on = hint.depends_on if self._with_dependencies else ()
        if entity_id in self._known.apps:
            kind: type[App | Component] = App
        elif entity_id in self._known.components:
            kind = Component
        elif self._allow_new_entities:
            kind = App
        else:
            self._skip(entity_id)
            return None
        if kind is Component:
            return Component(entity_id, hint.display_name, depends_on=depends_on, source=BEACON)
        return App(entity_id, hint.display_name, hint.component_id, depends_on, source=BEACON)

    def _function(self, function_id: str) -> Function | None:
        hosts = self._members.of(function_id)
        if function_id not in self._known.functions or not hosts:
            return None
        return Function(function_id, hosts=hosts, source=BEACON)

    def _component(self, component_id: str, apps: Container[str]) -> Component | None:
        """One that only hints name: no id of anything else is one."""
        known = self._known
        others = (known.components, known.apps, apps, known.areas, known.functions)
        if not self._placed.of(component_id) or any(component_id in ids for ids in others):
            return None
        area = self._area if known.areas else ""
        return Component(component_id, area=area, source=BEACON)

    def _note(self, entity_id: str, beacon: Beacon | None) -> None:
        before = self._beacons.pop(entity_id, None)
        self._doubtful.pop(entity_id, None)
        if beacon is not None:
            self._beacons[entity_id] = beacon
            if len(set(map(_words, beacon.views))) > 1:
                self._doubtful[entity_id] = None
        if (before and _state(before)) != (beacon and _state(beacon)):
            self.revision += 1

    def _skip(self, entity_id: str) -> None:
        if entity_id in self._skipped or len(self._skipped) >= MAX_SKIPS_LOGGED:
            return
        self._skipped.add(entity_id)
        self._newly_skipped.append(entity_id)


class _Reader:
    """What has changed in one store since the last time."""

    def __init__(self, store: HintStore) -> None:
        self._store = store
        self._revision = 0
        self._ids: set[str] = set()

    def changed(self) -> dict[str, None]:
        changes = self._store.changes_since(self._revision)
        self._revision = changes.revision
        changed: dict[str, None] = {}
        if changes.complete:
            changed.update(dict.fromkeys(self._ids))
            self._ids.clear()
        for stored in changes.hints:
            self._ids.add(stored.entity_id)
            changed[stored.entity_id] = None
        for entity_id in changes.gone:
            self._ids.discard(entity_id)
            changed[entity_id] = None
        return changed


class _Column(Generic[_T]):
    """Some of a tree's entities, to be changed: a copy from the first change on."""

    def __init__(self, items: Mapping[str, _T]) -> None:
        self._original = items
        self._copy: dict[str, _T] | None = None
        self.touched: dict[str, None] = {}
        """Who was set or taken away."""

    @property
    def items(self) -> Mapping[str, _T]:
        return self._original if self._copy is None else self._copy

    @property
    def changed(self) -> bool:
        return self._copy is not None

    def put(self, key: str, value: _T | None) -> None:
        """Set, or (``None``) take away; what is equal stays the same object."""
        if self.items.get(key) == value:
            return
        self.touched[key] = None
        if self._copy is None:
            self._copy = dict(self._original)
        if value is None:
            del self._copy[key]
        else:
            self._copy[key] = value


class _Named:
    """Who names which id. Unknown ones too: each may appear at any time."""

    def __init__(self) -> None:
        self.changed: dict[str, None] = {}
        """The ids that others name since somebody took this; add to it what else is to be taken."""
        self._by: dict[str, dict[str, None]] = defaultdict(dict)
        self._named: dict[str, tuple[str, ...]] = {}

    def of(self, named: str) -> tuple[str, ...]:
        """Who names it."""
        return tuple(self._by.get(named, ()))

    def ids(self) -> dict[str, None]:
        """All that are named."""
        return dict.fromkeys(self._by)

    def take_changed(self) -> dict[str, None]:
        taken, self.changed = self.changed, {}
        return taken

    def put(self, entity_id: str, named: tuple[str, ...]) -> None:
        """Set all that ``entity_id`` names, in place of what it named before."""
        before = self._named.pop(entity_id, ())
        if named:
            self._named[entity_id] = named
        if before == named:
            return
        for one in set(before).difference(named):
            del self._by[one][entity_id]
            if not self._by[one]:
                del self._by[one]
            self.changed[one] = None
        for one in named:
            self._by[one][entity_id] = None
            self.changed[one] = None


def _place_of(app_id: str, known: Tree) -> str:
    """The component that an app is on whatever its hint says."""
    app = known.apps.get(app_id)
    return "" if app is None else app.component_id


def _words(view: View) -> tuple[object, ...]:
    """What makes one source's view another than the next one's, but for when it was heard."""
    stored = view.stored
    hint = stored.hint
    return (
        stored.status,
        hint.display_name,
        hint.component_id,
        hint.function_ids,
        hint.depends_on,
    )


def _state(beacon: Beacon) -> tuple[object, ...]:
    """What others may be told of: whether it is there, why not, and whom it needs."""
    stored = beacon.stored
    return stored.status, stored.cause, stored.detail, stored.hint.depends_on
