"""How a relay's publishers tell other relays who took their messages first, and how far they came.

ROS has no field for that in a message, and rclpy does not even tell a message's publisher. But each
message comes with its publisher's GID, and the graph tells to whose node a GID belongs. So a relay
publishes by nodes that carry the two numbers in their names; there is one for each pair of them.
The names are the same on each middleware, so relays know each other whatever they stand on.
"""

from __future__ import annotations

import re

__all__ = ["CONDUIT_ROLE", "Mark", "is_conduit", "mark_of", "role"]

Mark = tuple[int, int]
"""``first``, the forwarder that took a message from a network first; and ``hop``, how many relays
it has passed."""

_NAME = re.compile(r"/_beacon_relay_([0-9a-f]{16})_h(\d{1,3})_\w+")

CONDUIT_ROLE = "relay_conduit"
"""For a conduit's node; what it publishes are frames, and nothing to be relayed."""


def is_conduit(node: str) -> bool:
    """Is this the full name of a conduit's node?"""
    return f"/_beacon_{CONDUIT_ROLE}_" in node


def role(mark: Mark) -> str:
    """What stands in the name of the node for these: ``_beacon_<role>_<anything>``."""
    first, hop = mark
    return f"relay_{first:016x}_h{hop}"


def mark_of(node: str) -> Mark:
    """What a node's full name says; ``(0, 0)`` if it is no relay's."""
    found = _NAME.fullmatch(node)
    return (int(found[1], 16), int(found[2])) if found else (0, 0)
