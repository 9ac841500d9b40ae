"""Nodes of the ROS graph and the apps of the tree: which is which.

An app of the manifest may say by which name its node is found. A node is bound to one app at most,
and an app to one node: apps in the order of the manifest, each to the first of its nodes, by full
name, that is not taken. Nodes that nobody asked for are orphans; a policy says what becomes of
them.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping, Sequence

import attrs

from beacon_gateway.tree.entities import App, RosBinding, Tree

__all__ = [
    "NODE",
    "ORPHAN",
    "Linking",
    "Unmanifested",
    "binds",
    "link",
    "runtime_tree",
    "whom_to_ask",
]

NODE = "node"
"""The ``source`` of an app that is there because its node is."""
ORPHAN = "orphan"
"""The same where the manifest says ``include_as_orphan``."""


class Unmanifested(enum.StrEnum):
    """What becomes of nodes that no app of the manifest is bound to."""

    IGNORE = "ignore"
    """Nothing; they are no apps, whatever the configuration says."""
    WARN = "warn"
    """Each is logged once."""
    ERROR = "error"
    """The same, as an error."""
    INCLUDE_AS_ORPHAN = "include_as_orphan"
    """They become apps of source ``orphan``."""


@attrs.frozen
class Linking:
    """Who was found, and who was not."""

    bound: Mapping[str, str]
    """The node's full name, by app."""
    orphans: tuple[str, ...] = ()
    """The nodes that belong to no app, sorted."""
    unbound: tuple[str, ...] = ()
    """The apps whose node is not there."""
    policy: Unmanifested | None = None
    binding_conflicts: int = 0
    """Apps whose node is there but was another app's already."""

    @property
    def linked_count(self) -> int:
        return len(self.bound)

    @property
    def orphan_count(self) -> int:
        return len(self.orphans)


def link(apps: Iterable[App], nodes: Iterable[str], policy: Unmanifested | None = None) -> Linking:
    """Find the node of each app that has a ``ros_binding``. Pure.

    ``nodes`` are full names such as ``/arm/driver``; hidden ones (``_...``) are nobody's orphans.
    """
    by_name: dict[str, list[str]] = {}
    for node in sorted(set(nodes)):
        by_name.setdefault(node.rpartition("/")[2], []).append(node)
    taken: dict[str, str] = {}
    bound: dict[str, str] = {}
    unbound: list[str] = []
    conflicts = 0
    for app in apps:
        binding = app.ros_binding
        if app.external or binding is None or not binding.node_name:
            continue
        named = by_name.get(binding.node_name.rpartition("/")[2], ())
        candidates = [node for node in named if binds(binding, node)]
        free = next((node for node in candidates if node not in taken), None)
        if free is None:
            unbound.append(app.id)
            conflicts += bool(candidates)
        else:
            taken[free] = app.id
            bound[app.id] = free
    every = sorted(node for names in by_name.values() for node in names)
    orphans = tuple(node for node in every if node not in taken and not _hidden(node))
    return Linking(bound, orphans, tuple(unbound), policy, conflicts)


def binds(binding: RosBinding, node: str) -> bool:
    """Is this the app's node? ``node_name`` may be more than one segment (``costmap/costmap``)."""
    name = binding.node_name.strip("/")
    if not node.endswith(f"/{name}"):
        return False
    if binding.namespace == "*":
        return True
    space, wanted = f"{node[: -len(name)].rstrip('/')}/", binding.namespace.strip("/")
    return space.startswith(f"/{wanted}/") if wanted else space == "/"


def whom_to_ask(apps: Iterable[App], bound: Mapping[str, str]) -> frozenset[str] | None:
    """The nodes of the apps, for sources that ask nodes; ``bound`` are those that were found.

    ``None`` if nobody can say: no app has a node, or one has that may be called anything and is not
    found yet.
    """
    found: set[str] = set()
    for app in apps:
        binding = app.ros_binding
        if app.external or binding is None or not binding.node_name:
            continue
        if app.id not in bound and binding.namespace == "*":
            return None
        parts = (binding.namespace.strip("/"), binding.node_name.strip("/"))
        found.add(bound.get(app.id) or "/" + "/".join(filter(None, parts)))
    return frozenset(found) or None


def runtime_tree(linking: Linking, *, show_orphans: bool) -> Tree:
    """What the ROS graph says of the tree: who is online, and apps that are only there."""
    apps = {
        app_id: App(app_id, bound_fqn=node, is_online=True, source=NODE)
        for app_id, node in linking.bound.items()
    }
    source = ORPHAN if linking.policy is Unmanifested.INCLUDE_AS_ORPHAN else NODE
    for app_id, node in _ids(linking.orphans if show_orphans else (), taken=apps).items():
        name = node.rpartition("/")[2]
        apps[app_id] = App(app_id, name, bound_fqn=node, is_online=True, source=source)
    return Tree(apps=apps)


def _ids(nodes: Sequence[str], taken: Iterable[str]) -> dict[str, str]:
    """Nodes by the id of their app: ``/arm/driver`` is ``arm_driver``. Where two would have one
    id, the later has its segments kept apart: no node has a ``-`` in its name."""
    by_id: dict[str, str] = dict.fromkeys(taken, "")
    for node in nodes:
        apart = node.strip("/").replace("/", "-")
        names = (node.strip("/").replace("/", "_"), apart, f"{apart}-{NODE}")
        by_id[next((name for name in names if name not in by_id), names[-1])] = node
    return {app_id: node for app_id, node in by_id.items() if node}


def _hidden(node: str) -> bool:
    return any(segment.startswith("_") for segment in node.split("/"))
