"""What an adapter package registers: the entry point group is ``beacon.adapters``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import attrs

from beacon_core.hint import Announcement
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
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
    vendor_endpoint: str = ""
    """Where a gateway serves what it heard by this carrier of one entity, such as
    ``x-medkit-topic-beacon``: beginning with ``x-``, for it stands among the standard's own names.
    ``""``: nowhere of its own."""
    examine: Callable[[Any, float], Iterable[Finding]] | None = None
    """Looks at the carrier with these ``options``, as a source would see it, for about so many
    seconds at most (less where it is clear sooner), and says what it finds: for a person whose view
    is empty. Called in a thread of its own, beside a gateway that may be running. What it finds is
    never raised; an iterator may tell each finding as soon as it is known."""
