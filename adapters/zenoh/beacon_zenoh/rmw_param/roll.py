"""Who is in the graph, in the words of the asker: nodes by name, their runs, and where to ask them.

Theory. A node is there while its token is, and ``GRACE_NS`` longer: a fail-over to another router
takes a token away and brings it back within 10 ms, and the end of a connection overtakes the last
events sent over it. One whose token goes while another node of its name is there is not waited for:
that is a restart.

A run of a node is named by the node's session and its number there, which a restart changes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from beacon_zenoh.rmw.graph import Graph, NodeView
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.tokens import Member, NodeKey
from beacon_zenoh.rmw_param.clients import Doors
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.services import GET, LIST, offered

__all__ = ["GRACE_NS", "Roll"]

GRACE_NS = 50_000_000
"""Five times the longest flap that was measured."""

_HIDDEN = "_"
"""How the names of nodes begin that are not asked unless they are named: those that ROS hides, of
gateways too."""


class Roll:
    """Thread rule: one thread, but for ``came`` and ``went``: those one at a time, from any."""

    def __init__(self, options: RmwParamOptions) -> None:
        self.doors: dict[str, Doors] = {}
        """Where nodes can be asked, by name; kept by :meth:`call`."""
        self._options = options
        self._several = len(options.ros_domain_ids) > 1
        self._runs: dict[str, set[str]] = {}
        self._gone: dict[NodeKey, tuple[Member, int]] = {}
        # Nodes whose tokens went a moment ago, and until when they count as there.

    def came(self, node: Member) -> None:
        """A node's token came."""
        self._gone.pop(node.node_key, None)

    def went(self, node: Member, now_ns: int) -> None:
        """A node's token went."""
        self._gone[node.node_key] = (node, now_ns + GRACE_NS)

    def call(self, graph: Graph, now_ns: int) -> Mapping[str, Collection[str]]:
        """Look at the graph: all nodes that are to be heard, by name, with their runs."""
        before = self.doors.copy()
        self.doors.clear()
        self._runs = {}
        for view in graph.nodes():
            if self._options.admits(view.node.namespace):
                self._note(view)
        for key, (node, until_ns) in list(self._gone.items()):
            name = self.name(node.domain, node.node_name)
            if until_ns <= now_ns:
                self._gone.pop(key, None)
            elif name not in self._runs and self._options.admits(node.namespace):
                self._runs[name] = {_run(node)}
                if name in before:
                    self.doors[name] = before[name]
        return self._runs

    def next_due_ns(self) -> int | None:
        """When somebody is not waited for any longer."""
        return min((until_ns for _, until_ns in list(self._gone.values())), default=None)

    def name(self, domain: int, node_name: str) -> str:
        """What a node is called here: with its domain, if there are several."""
        return f"{domain}{node_name}" if self._several else node_name

    def visible(self) -> list[str]:
        """Whom to ask if nobody is named."""
        return [one for one in self._runs if not one.rpartition("/")[2].startswith(_HIDDEN)]

    def named(self, nodes: Iterable[str]) -> list[str]:
        """What nodes of these full names are called here, in each domain."""
        domains = self._options.ros_domain_ids
        return [self.name(domain, node) for node in nodes for domain in domains]

    def missing(self, nodes: Iterable[str]) -> list[str]:
        """Of these full names, those that no node has in any domain."""
        return [one for one in nodes if not any(name in self._runs for name in self.named([one]))]

    def _note(self, view: NodeView) -> None:
        node = view.node
        name = self.name(node.domain, node.node_name)
        runs = self._runs.setdefault(name, set())
        runs.add(_run(node))
        ways = [offered(node, view.members, service) for service in (LIST, GET)]
        if ways[0] is not None and ways[1] is not None:
            list_key, get_key = data_key(ways[0].data_key), data_key(ways[1].data_key)
            self.doors[name] = Doors(list_key, get_key, node.zid if len(runs) == 1 else "")


def _run(node: Member) -> str:
    return f"{node.zid}-{node.node_id}"
