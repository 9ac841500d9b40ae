"""What a package registers for the relay: networks that it may stand beside, and conduits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from beacon_core.ports.conduit import Conduit
from beacon_core.ports.topic_side import TopicSide

__all__ = ["CONDUIT_GROUP", "NETWORK_GROUP", "ConduitAdapter", "NetworkAdapter"]

CONDUIT_GROUP = "beacon.conduits"
"""Where packages register a :class:`ConduitAdapter`, under the name it is chosen by."""

NETWORK_GROUP = "beacon.networks"
"""Where packages register a :class:`NetworkAdapter`, under the name it is chosen by."""


@attrs.frozen
class ConduitAdapter:
    """One way for frames to travel, by name."""

    name: str
    options: type[Any]
    """An attrs class; the configuration's ``options`` are structured into it."""
    conduit: Callable[[Any], Conduit]
    """Makes a conduit from an instance of ``options``. Opens nothing: ``start`` does."""
    identity: Callable[[Any], str]
    """Ends whose identities are equal hear each other. For people, and for finding loops."""


@attrs.frozen
class NetworkAdapter:
    """One kind of network, by name."""

    name: str
    options: type[Any]
    """An attrs class; the configuration's ``options`` are structured into it."""
    topic_side: Callable[[Any], TopicSide]
    """Makes a topic side from an instance of ``options``. Opens nothing: ``start`` does."""
    identity: Callable[[Any], str]
    """Names the network: two topic sides with equal identities stand beside the same one."""
