"""The port behind which nodes are asked for their parameters: by rclpy, by Zenoh, in a test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

__all__ = ["ClientFactory", "Done", "Drop", "NodeClient"]

Done = Callable[[Sequence[Any] | None], None]
"""Called with the answer, or with ``None`` if there is none to be had. From any thread."""

Drop = Callable[[], None]
"""Says that the answer is not wanted any more. It may still come if it is just arriving."""


class NodeClient(Protocol):
    """Asks one node. Thread rule: one thread. Nothing waits for the network, and whatever a carrier
    that is shut down raises may be raised."""

    def ready(self) -> bool:
        """Is there somebody to answer? A question asked earlier would never be answered."""

    def list_names(self, done: Done) -> Drop:
        """Ask for the names of the parameters that belong to a hint; the answer may hold others."""

    def get_values(self, names: Sequence[str], done: Done) -> Drop:
        """Ask for the values of these, in this order. Some nodes answer without any value if one
        of the parameters has none."""

    def close(self) -> None:
        """Give up what it took to ask."""


ClientFactory = Callable[[str], NodeClient]
"""From a node's full name; may raise whatever for a name that no node can have."""
