"""The one tree, always up to date: manifest, ROS graph, host and beacons, merged on demand."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from operator import is_
from types import MappingProxyType

import attrs

from beacon_core.store import HintStore
from beacon_core.text import quoted
from beacon_gateway.tree.beacons import BEACON, BeaconLayer
from beacon_gateway.tree.entities import App, Area, Tree
from beacon_gateway.tree.host import Host
from beacon_gateway.tree.incremental import IncrementalMerge
from beacon_gateway.tree.linker import Linking, Unmanifested, link, runtime_tree, whom_to_ask
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.tree.merge import KINDS, Conflict, Layer, MergeResult
from beacon_gateway.tree.policies import BEACONS, DEMOTED, HOST, MANIFEST, RUNTIME
from beacon_gateway.tree.rollup import RollUp, RollUps, fault_of, roll_up
from beacon_gateway.views import Beacon

__all__ = ["MergeReport", "TreeKeeper", "TreeSettings"]

_log = logging.getLogger(__name__)

_MAX_NODES_LOGGED = 1_000

_LEVELS = MappingProxyType({Unmanifested.WARN: logging.WARNING, Unmanifested.ERROR: logging.ERROR})


@attrs.frozen
class TreeSettings:
    """How the tree is put together."""

    host: Host
    allow_new_entities: bool = True
    strict_upstream_merge: bool = False
    runtime_nodes: bool = False
    """Nodes of the ROS graph become apps."""


@attrs.frozen
class MergeReport:
    """How the tree came about."""

    layers: tuple[str, ...]
    total_entities: int
    enriched_count: int
    """Entities that more than one layer knows."""
    conflicts: tuple[Conflict, ...]
    id_collisions: int
    """Ids that stand for entities of more than one kind."""
    linking: Linking | None
    """``None`` where no source knows the ROS graph."""

    @property
    def conflict_count(self) -> int:
        return len(self.conflicts)


class TreeKeeper:
    """Thread rule: every method may be called from any thread."""

    def __init__(
        self,
        manifest: Manifest,
        stores: Sequence[HintStore],
        graphs: Sequence[Callable[[], frozenset[str]]],
        beacon: Callable[[str], Beacon | None],
        settings: TreeSettings,
    ) -> None:
        """``graphs`` tell the nodes there are; ``beacon`` how all sources together have one."""
        self._manifest = manifest
        self._graphs = graphs
        self._settings = settings
        self._lock = threading.Lock()
        strict = settings.strict_upstream_merge
        self._merge = IncrementalMerge(strict_upstream=strict, finish=settings.host.placed)
        self._beacons = BeaconLayer(
            stores,
            beacon,
            listed=_listed(manifest),
            allow_new_entities=settings.allow_new_entities,
            area=settings.host.area,
            strict_upstream=strict,
        )
        self._nodes: list[frozenset[str]] = []
        self._linking = link(manifest.tree.apps.values(), (), manifest.unmanifested_nodes)
        self._wanted = whom_to_ask(manifest.tree.apps.values(), self._linking.bound)
        self._runtime = self._host = self._said = Tree()
        self._known = self._all_known()
        self._merged: tuple[object, ...] = (None, None, None)
        self._merges = 0
        self._result = MergeResult(Tree())
        self._on_host: set[str] = set()
        self._rolled_up = RollUps((), self._depends_on, self._fault)
        self._rolled_up_of: tuple[int, int] | None = None
        self._logged: set[str] = set()
        self._messages: list[tuple[int, str]] = []

    def tree(self) -> Tree:
        """As it is now. Without a change it is the same object, and that costs next to nothing."""
        # Without ``_up_to_date``: nearly every request asks this, and nearly none has to say more.
        with self._lock:
            self._refresh()
            tree, messages, self._messages = self._result.tree, self._messages, []
        _say(messages)
        return tree

    def take_manifest(self, manifest: Manifest) -> None:
        """From now on this one is known beforehand; only what it changes is merged again."""
        with self._up_to_date():
            self._manifest = manifest
            self._beacons.expect(_listed(manifest))
            self._relink()

    def whom_to_ask(self) -> frozenset[str] | None:
        """The nodes of the apps that are known beforehand; see :func:`~.linker.whom_to_ask`.

        It costs next to nothing while the ROS graph stays the same."""
        with self._lock:
            self._look_around()
            return self._wanted

    def listen(self) -> None:
        """Take note of who has been heard, before the stores forget it: more often than hints
        expire. Everything else waits until somebody asks."""
        with self._lock:
            self._beacons.listen()

    def never_heard(self, entity_id: str) -> bool:
        """It is in the manifest, and no hint about it has come since the gateway began."""
        if entity_id in self._beacons.never_heard:
            self.listen()
        return entity_id in self._beacons.never_heard

    def roll_up(self, entity_id: str) -> RollUp:
        """Is it active, with all that it needs?"""
        with self._up_to_date():
            if self._rolled_up_of == self._state() and entity_id in self._rolled_up:
                return self._rolled_up[entity_id]
            return roll_up(entity_id, self._depends_on, self._fault)

    def roll_ups(self) -> Mapping[str, RollUp]:
        """The same for every entity of the tree. Without a change it is the same object."""
        with self._up_to_date():
            if self._rolled_up_of != self._state():
                tree = self._result.tree
                ids = (*tree.components, *tree.apps, *tree.areas, *tree.functions)
                self._rolled_up = RollUps(ids, self._depends_on, self._fault)
                self._rolled_up_of = self._state()
            return self._rolled_up

    def report(self) -> MergeReport:
        """How the tree came about."""
        with self._up_to_date():
            result, linking = self._result, self._linking
        kinds = [getattr(result.tree, kind).keys() for kind in KINDS]
        total = sum(map(len, kinds))
        return MergeReport(
            layers=tuple(layer.name for layer in self._layers()),
            total_entities=total,
            enriched_count=result.enriched,
            conflicts=result.conflicts,
            id_collisions=total - len(set().union(*kinds)),
            linking=linking if self._graphs else None,
        )

    @contextmanager
    def _up_to_date(self) -> Iterator[None]:
        with self._lock:
            self._refresh()
            messages, self._messages = self._messages, []
            yield
        _say(messages)

    def _refresh(self) -> None:
        self._look_around()
        self._said = self._beacons.map(self._known)
        if skipped := self._beacons.newly_skipped():
            self._messages += [
                (
                    logging.WARNING,
                    f"{quoted(one)} is no known app or component: its hint is skipped",
                )
                for one in skipped
            ]
        parts = (self._manifest, self._runtime, self._said)
        if all(map(is_, parts, self._merged)):
            return
        self._merged = parts
        before, self._result = self._result, self._merge.merge(self._layers())
        if self._result.tree is before.tree:
            return
        self._merges += 1
        self._count_who_is_on_the_host()
        # The host is shown while somebody is on it, and whether that is so shows only now.
        areas, said = self._manifest.tree.areas, self._said.components
        filled = bool(areas) and any(component.area for component in said.values())
        shown = self._settings.host.tree(
            self._manifest.tree, hosting=self._hosting(), filled=filled
        )
        if shown != self._host:
            self._host = shown
            self._result = self._merge.merge(self._layers())

    def _look_around(self) -> None:
        nodes = [graph() for graph in self._graphs]
        if nodes != self._nodes:
            self._nodes = nodes
            self._relink()

    def _state(self) -> tuple[int, int]:
        """Another one whenever somebody may be active who was not, or the other way round."""
        return self._merges, self._beacons.revision

    def _layers(self) -> tuple[Layer, ...]:
        manifest = self._manifest
        policies = MANIFEST if manifest.allow_manifest_override else DEMOTED
        return (
            Layer("manifest", manifest.tree, policies),
            Layer("runtime", self._runtime, RUNTIME),
            Layer("host", self._host, HOST),
            Layer("beacon", self._said, BEACONS, unites_lists=True, touched=self._beacons.touched),
        )

    def _hosting(self) -> bool:
        return self._settings.host.id in self._said.components or bool(self._on_host)

    def _count_who_is_on_the_host(self) -> None:
        host, apps = self._settings.host.id, self._result.tree.apps
        for one in self._merge.folded["apps"]:
            if one in apps and apps[one].component_id == host:
                self._on_host.add(one)
            else:
                self._on_host.discard(one)

    def _relink(self) -> None:
        manifest, settings = self._manifest, self._settings
        nodes = frozenset[str]().union(*self._nodes)
        apps = manifest.tree.apps.values()
        self._linking = link(apps, nodes, manifest.unmanifested_nodes)
        self._wanted = whom_to_ask(apps, self._linking.bound)
        policy = self._linking.policy
        show = policy is Unmanifested.INCLUDE_AS_ORPHAN or (
            settings.runtime_nodes and policy is not Unmanifested.IGNORE
        )
        found = runtime_tree(self._linking, show_orphans=show).apps
        old = self._runtime.apps
        # What is equal stays the same object, so that it is not merged again.
        self._runtime = Tree(
            apps={app.id: old[app.id] if old.get(app.id) == app else app for app in found.values()}
        )
        self._known = self._all_known()
        self._messages += self._on_orphans()

    def _all_known(self) -> Tree:
        """Whom a hint may be about: everybody but those who are there by their hints only.

        An app is on a component here if its hint cannot move it.
        """
        known, host = self._manifest.tree, self._settings.host
        apps: Mapping[str, App] = known.apps
        if not self._manifest.allow_manifest_override:
            apps = {one: attrs.evolve(app, component_id="") for one, app in apps.items()}
        return Tree(
            areas={**known.areas, host.area: Area(host.area)} if known.areas else {},
            components={host.id: host.component(), **known.components},
            apps={**self._runtime.apps, **apps},
            functions=known.functions,
        )

    def _on_orphans(self) -> list[tuple[int, str]]:
        policy = self._linking.policy
        level = None if policy is None else _LEVELS.get(policy)
        if level is None:
            return []
        fresh = [node for node in self._linking.orphans if node not in self._logged]
        del fresh[_MAX_NODES_LOGGED - len(self._logged) :]
        self._logged.update(fresh)
        return [(level, f"{quoted(node)} is the node of no app of the manifest") for node in fresh]

    def _depends_on(self, entity_id: str) -> Iterable[str]:
        """Whom it needs by the tree, and by its own word."""
        tree = self._result.tree
        entity = (
            tree.components.get(entity_id)
            or tree.apps.get(entity_id)
            or tree.functions.get(entity_id)
        )
        needed = () if entity is None else entity.depends_on
        beacon = self._beacons.last(entity_id)
        told = () if beacon is None else beacon.stored.hint.depends_on
        return dict.fromkeys((*needed, *told)) if needed and told else needed or told

    def _fault(self, entity_id: str) -> str:
        beacon = self._beacons.last(entity_id)
        if beacon is not None:
            return fault_of(entity_id, beacon)
        if self._there_without(entity_id):
            return ""
        known = self._result.tree.kind(entity_id) is not None
        heard = entity_id not in self._beacons.never_heard
        return fault_of(entity_id, None, known=known, heard=heard)

    def _there_without(self, entity_id: str) -> bool:
        """Areas, functions and what only hints name have no beacon; a node shows an app, and this
        answer the host."""
        tree = self._result.tree
        if entity_id in tree.apps:
            return tree.apps[entity_id].is_online
        if entity_id in tree.components:
            made = tree.components[entity_id].source == BEACON
            return made or entity_id == self._settings.host.id
        return entity_id in tree.areas or entity_id in tree.functions


def _say(messages: Iterable[tuple[int, str]]) -> None:
    for level, message in messages:
        _log.log(level, "%s", message)


def _listed(manifest: Manifest) -> tuple[str, ...]:
    return (*manifest.tree.apps, *manifest.tree.components)
