"""How frames get from one relay to another."""

from __future__ import annotations

from typing import Protocol

import attrs

__all__ = ["Conduit", "ConduitLimits", "FrameSink"]


@attrs.frozen
class ConduitLimits:
    """What a conduit can carry."""

    max_header_bytes: int
    """At least 128 KiB: a digest of 4,096 routes has 96 KB."""
    max_payload_bytes: int
    """A relay refuses larger messages where they come in, and counts them."""


class FrameSink(Protocol):
    """Where a conduit delivers. It neither raises nor blocks."""

    def frame(self, header: bytes, payload: bytes) -> None:
        """A frame has come in, as it was sent."""

    def link(self, *, up: bool) -> None:
        """Frames may get through from now on, or not any more."""


class Conduit(Protocol):
    """Carries frames to whoever is at the other end: none, one or many.

    Thread rule: ``send`` from any thread; ``start`` and ``close`` from one. The sink is called from
    one thread at a time.

    What a conduit promises: a frame that comes in is one that was sent, unaltered; ``send`` blocks
    for 250 ms at the most; a link that breaks is told within 2 s, or, where a large frame is on its
    way to an end that hangs, in the time that the adapter's page tells. What it does not promise:
    that a frame comes in at all, once, or in order.
    """

    def start(self, sink: FrameSink) -> None:
        """Begin. Returns at once; the link is down until the sink is told otherwise."""

    def send(self, header: bytes, payload: bytes) -> bool:
        """Send a frame; the payload is not copied if the carrier allows it.

        ``False`` if it was refused: that is a loss like any other, and needs no answer.
        """

    def limits(self) -> ConduitLimits:
        """What can be carried; the same at any time."""

    def close(self) -> None:
        """Stop. Idempotent, within 1 s; afterwards the sink is not called any more."""
