"""The nodes of one topic side: one that listens, and one for each mark that it publishes under."""

from __future__ import annotations

from rclpy.node import Node

from beacon_core.relay.marks import Mark, role
from beacon_ros.participant import OwnNode

__all__ = ["MAX_MARKS", "Nodes"]

MAX_MARKS = 64
"""Nodes that publish; a node costs 0.5 ms and 0.2 MB. What has yet another mark goes out under that
of its route."""


class Nodes:
    """Thread rule: ``is_ours`` from any thread, the rest from one."""

    def __init__(self, domain_id: int | None) -> None:
        """Raises ``ConfigError`` for a domain or an environment that ROS refuses."""
        self._domain_id = domain_id
        self.listening = OwnNode("relay", domain_id)
        self._publishing: dict[Mark, OwnNode] = {}
        self._names: frozenset[str] = frozenset()

    def publishing(self, mark: Mark) -> Node | None:
        """The node for this mark; ``None`` if there are too many already."""
        own = self._publishing.get(mark)
        if own is None:
            if len(self._publishing) >= MAX_MARKS:
                return None
            own = self._publishing[mark] = OwnNode(role(mark), self._domain_id)
            self._names |= {own.node.get_fully_qualified_name()}
        return own.node

    def is_ours(self, node: str) -> bool:
        """Is this the full name of one that publishes?"""
        return node in self._names

    def close(self) -> None:
        """Once nothing of theirs is used any more."""
        for own in (*self._publishing.values(), self.listening):
            own.close()
