"""Who there is: the known tree with what the beacons add to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from beacon_gateway.departures import Departures
from beacon_gateway.listener import Listener
from beacon_gateway.tree.entities import Kind, Tree
from beacon_gateway.tree.keeper import MergeReport, TreeKeeper, TreeSettings
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.tree.rollup import RollUp
from beacon_gateway.views import Beacon, View, with_departure

__all__ = ["Directory"]


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
        self.known_revision = 0
        """Rises when others are known beforehand."""
        self._listeners = listeners
        self._departures = departures
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
        self._keeper.take_manifest(manifest)
        self.known_revision += 1

    def listen(self) -> None:
        """Take note of who has been heard; to be called more often than hints expire."""
        self._keeper.listen()

    def whom_to_ask(self) -> frozenset[str] | None:
        """The nodes of the apps that are known beforehand; ``None``: nobody can say."""
        return self._keeper.whom_to_ask()

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

    def kind(self, entity_id: str) -> Kind | None:
        """What the id stands for, ``None`` if it is unknown."""
        return self.tree().kind(entity_id)

    def evidence(self) -> Callable[[str], tuple[object, ...]]:
        """What each entity's beacon follows from at this moment: while it is the same objects, the
        beacon is the same. For many of them far cheaper than :meth:`beacon`."""
        heard = [
            {stored.hint.entity_id: stored for stored in listener.store.changes_since(0).hints}
            for listener in self._listeners
        ]
        finders: list[Callable[[str], object]] = [self._departures.last]
        finders += [one.get for one in heard]
        return lambda entity_id: tuple([find(entity_id) for find in finders])

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
