"""Who there is: the known tree with what the beacons add to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import attrs

from beacon_core import entities as core
from beacon_core.entities import App, Component, Entities
from beacon_gateway.departures import Departures
from beacon_gateway.listener import Listener
from beacon_gateway.tree.entities import Kind, Tree
from beacon_gateway.tree.keeper import MergeReport, TreeKeeper, TreeSettings
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.tree.rollup import RollUp
from beacon_gateway.views import Beacon, View, with_departure

__all__ = ["Directory", "Found", "Kind"]

_NEW_APP_SOURCE = "beacon"
"""The ``source`` of an app that nobody but its own hint told of."""


@attrs.frozen
class Found:
    """An app or a component, and its beacon if it has one."""

    entity: App | Component
    beacon: Beacon | None


class Directory:
    """Answers from the stores as they are now, and from who went last.

    Thread rule: every method may be called from any thread.
    """

    def __init__(
        self,
        manifest: Manifest,
        listeners: Sequence[Listener],
        departures: Departures,
        settings: TreeSettings,
    ) -> None:
        self._known = _core_entities(manifest.tree)
        self._listeners = listeners
        self._departures = departures
        self._allow_new_entities = settings.allow_new_entities
        self._keeper = TreeKeeper(
            manifest,
            [listener.store for listener in listeners],
            [listener.nodes for listener in listeners if listener.knows_nodes],
            self.beacon,
            settings,
        )

    def tree(self) -> Tree:
        """All entities as they are now. Without a change it is the same object as before."""
        return self._keeper.tree()

    def take_manifest(self, manifest: Manifest) -> None:
        """Put another manifest in the place of the one there is."""
        self._known = _core_entities(manifest.tree)
        self._keeper.take_manifest(manifest)

    def listen(self) -> None:
        """Take note of who has been heard; to be called more often than hints expire."""
        self._keeper.listen()

    def never_heard(self, entity_id: str) -> bool:
        """It is known beforehand, and no hint about it has come since the gateway began."""
        return self._keeper.never_heard(entity_id)

    def roll_up(self, entity_id: str) -> RollUp:
        """Whether it is active with all it depends on; if not, through whom and why."""
        return self._keeper.roll_up(entity_id)

    def roll_ups(self) -> Mapping[str, RollUp]:
        """The same for all entities of the tree, by id: for many of them far cheaper."""
        return self._keeper.roll_ups()

    def report(self) -> MergeReport:
        """How the tree came about."""
        return self._keeper.report()

    def apps(self) -> Iterator[Found]:
        """All apps: the known ones, then those nobody but their own hint told of.

        One that said goodbye stays until its tombstone lapses.
        """
        for app in self._known.apps.values():
            yield self._named(app)
        new: dict[str, None] = {}
        for listener in self._listeners:
            new |= listener.new_app_ids(self._known)
        for entity_id in new:
            found = self._new_app(entity_id)
            if found is not None:
                yield found

    def components(self) -> Iterator[Found]:
        """All components; they are known beforehand."""
        for component in self._known.components.values():
            yield self._named(component)

    def app(self, entity_id: str) -> Found | None:
        """One app, known or new."""
        app = self._known.apps.get(entity_id)
        if app is not None:
            return self._named(app)
        return None if entity_id in self._known.components else self._new_app(entity_id)

    def component(self, entity_id: str) -> Found | None:
        """One component."""
        component = self._known.components.get(entity_id)
        return None if component is None else self._named(component)

    def kind(self, entity_id: str) -> Kind | None:
        """What the id stands for, ``None`` if it is unknown."""
        return self.tree().kind(entity_id)

    def beacon(self, entity_id: str) -> Beacon | None:
        """What the sources say of it, whether or not such an entity is known."""
        # First this: a store that forgets a departure meanwhile has told of it before.
        departure = self._departures.last(entity_id)
        views = [
            View(listener.name, listener.adapter, stored)
            for listener in self._listeners
            if (stored := listener.store.get(entity_id)) is not None
        ]
        return Beacon.of(with_departure(views, departure))

    def _named(self, entity: App | Component) -> Found:
        """The known entity; what the tree does not say of it, its beacon may."""
        beacon = self.beacon(entity.id)
        if beacon is None:
            return Found(entity, None)
        hint = beacon.stored.hint
        named = attrs.evolve(entity, name=entity.name or hint.display_name)
        if isinstance(named, App):
            named = attrs.evolve(named, component_id=named.component_id or hint.component_id)
        return Found(named, beacon)

    def _new_app(self, entity_id: str) -> Found | None:
        if not self._allow_new_entities or (beacon := self.beacon(entity_id)) is None:
            return None
        hint = beacon.stored.hint
        app = App(entity_id, hint.display_name, hint.component_id, source=_NEW_APP_SOURCE)
        return Found(app, beacon)


def _core_entities(tree: Tree) -> Entities:
    return Entities(
        areas=[core.Area(one.id, one.name) for one in tree.areas.values()],
        components=[Component(one.id, one.name, one.source) for one in tree.components.values()],
        apps=[App(one.id, one.name, one.component_id) for one in tree.apps.values()],
        functions=[core.Function(one.id, one.name, one.hosts) for one in tree.functions.values()],
    )
