"""What an adapter package registers: the entry point group is ``beacon.adapters``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from beacon_core.hint import Announcement
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.source import HintSource

__all__ = ["ENTRY_POINT_GROUP", "Adapter", "Decoder", "Malformed"]

ENTRY_POINT_GROUP = "beacon.adapters"
"""Where packages register an :class:`Adapter`, under the name it is chosen by."""


@attrs.frozen
class Malformed:
    """Bytes that are not a hint in this wire format; ``reason`` names the place as ``$.path``."""

    reason: str


Decoder = Callable[[bytes], Announcement | Malformed]
"""Turns a payload into an announcement. Any bytes in, a value out: it never raises."""


@attrs.frozen
class Adapter:
    """One carrier, by name. A package offers an instance under the entry point of that name."""

    name: str
    options: type[Any]
    """An attrs class; the configuration's ``options`` are structured into it."""
    decode: Decoder
    source: Callable[[Any], HintSource]
    """Makes a source from an instance of ``options``. Opens nothing: ``start`` does."""
    announcer: Callable[[Any, float | None], Announcer]
    """Makes an announcer from ``options`` and a period in seconds (``None``: only when told)."""
    default_ttl_s: float = 10.0
