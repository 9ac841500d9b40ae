"""The ROS graph, as it follows from liveliness tokens: nodes, and what each of them has.

Theory. A token that is there is a member that is there; nothing else is known. Reports of tokens
may be repeated, may come in any order (a publisher's before its node's), and may be missed while a
session is replaced. So the graph is a set of tokens by key: what is reported twice changes nothing,
and a new session begins with a doubt about everybody (:meth:`Graph.doubt`), which each report
removes, and whoever is still in doubt after a while has gone (:meth:`Graph.sweep`).

A node is there while its own token is. Its members stand for themselves: of rmw_zenoh's nodes they
come and go together, within milliseconds.
"""

from __future__ import annotations

import threading
from collections import defaultdict

import attrs

from beacon_zenoh.rmw.tokens import Kind, Member, NodeKey, member_of

__all__ = ["MAX_MEMBERS", "Graph", "NodeView"]

MAX_MEMBERS = 100_000
"""A node of ROS has about a dozen. Each takes about 1 kB; a flood beyond is counted and ignored."""


@attrs.frozen
class NodeView:
    """A node at one moment."""

    node: Member
    members: tuple[Member, ...] = ()
    """Its publishers, subscribers, services and clients."""

    def of(self, kind: Kind) -> tuple[Member, ...]:
        """Its members of one kind."""
        return tuple(one for one in self.members if one.kind is kind)


class Graph:
    """Thread rule: any method from any thread; none blocks or calls back."""

    def __init__(self, max_members: int = MAX_MEMBERS) -> None:
        self.refused = 0
        """Tokens that there was no room for."""
        self.malformed = 0
        """Tokens that are none of rmw_zenoh's."""
        self._max = max_members
        self._lock = threading.Lock()
        self._members: dict[str, Member] = {}
        self._of_node: defaultdict[NodeKey, dict[str, Member]] = defaultdict(dict)
        self._nodes: dict[NodeKey, Member] = {}
        self._names: frozenset[str] | None = frozenset()
        self._doubted: set[str] = set()

    def __len__(self) -> int:
        """How many members there are."""
        return len(self._members)

    def __contains__(self, key: str) -> bool:
        """Is there a member with this token?"""
        return key in self._members

    def appeared(self, key: str) -> Member | None:
        """A token came. Returns whose it is, if that is news."""
        with self._lock:
            if key in self._members:
                self._doubted.discard(key)
                return None
            member = member_of(key)
            if member is None:
                self.malformed += 1
                return None
            if len(self._members) >= self._max:
                self.refused += 1
                return None
            self._members[key] = member
            if member.kind is Kind.NODE:
                self._nodes[member.node_key] = member
                self._names = None
            else:
                self._of_node[member.node_key][key] = member
            return member

    def vanished(self, key: str) -> Member | None:
        """A token went. Returns whose it was, if it was known."""
        with self._lock:
            return self._remove(key)

    def doubt(self) -> None:
        """Nobody is known to be there any more until it is reported again."""
        with self._lock:
            self._doubted = set(self._members)

    def sweep(self) -> list[tuple[str, Member]]:
        """Whoever is still in doubt has gone. Returns them, by their keys."""
        with self._lock:
            doubted, self._doubted = self._doubted, set()
            gone = [(key, self._remove(key)) for key in doubted]
        return [(key, member) for key, member in gone if member is not None]

    def node(self, key: NodeKey) -> NodeView | None:
        """One node; ``None`` if it is not there."""
        with self._lock:
            node = self._nodes.get(key)
            return None if node is None else self._view(node)

    def members_of(self, key: NodeKey) -> dict[str, Member]:
        """What a node has, by the keys of the tokens, whether or not it is there itself."""
        with self._lock:
            return dict(self._of_node.get(key, {}))

    def nodes(self, domain: int | None = None) -> list[NodeView]:
        """All nodes, or those of one domain, by their names."""
        with self._lock:
            found = [
                self._view(one) for one in self._nodes.values() if domain in (None, one.domain)
            ]
        return sorted(found, key=lambda view: (view.node.domain, view.node.node_name))

    def names(self) -> frozenset[str]:
        """The full names of all nodes. Without a change it is the same object."""
        with self._lock:
            if self._names is None:
                self._names = frozenset(one.node_name for one in self._nodes.values())
            return self._names

    def size(self) -> int:
        """How many nodes there are."""
        return len(self._nodes)

    def _view(self, node: Member) -> NodeView:
        return NodeView(node, tuple(self._of_node.get(node.node_key, {}).values()))

    def _remove(self, key: str) -> Member | None:
        member = self._members.pop(key, None)
        if member is None:
            return None
        self._doubted.discard(key)
        if member.kind is Kind.NODE:
            self._nodes.pop(member.node_key, None)
            self._names = None
        else:
            theirs = self._of_node[member.node_key]
            del theirs[key]
            if not theirs:
                del self._of_node[member.node_key]
        return member
