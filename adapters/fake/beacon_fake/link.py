"""A link from one sender to one receiver: how long messages take, and what happens to them."""

from __future__ import annotations

import random

import attrs

from beacon_core.errors import ConfigError

__all__ = ["LAN", "LOCAL", "STORM", "WAN", "Link"]


def _share(_: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not 0.0 <= value <= 1.0:
        raise ConfigError(f"{attribute.name}: {value!r} is not a share between 0 and 1")


def _seconds(_: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not 0.0 <= value < float("inf"):
        raise ConfigError(f"{attribute.name}: {value!r} is not a time of 0 s or more")


@attrs.frozen
class Link:
    """Times in seconds, shares from 0 (never) to 1 (always).

    Without ``reorder`` a link is a queue: what was sent first arrives first, whatever the jitter.
    """

    latency_s: float = attrs.field(default=0.001, validator=_seconds)
    """The least time a message takes."""
    jitter_s: float = attrs.field(default=0.0, validator=_seconds)
    """Mean of what comes on top, exponentially distributed: mostly little, now and then much."""
    loss: float = attrs.field(default=0.0, validator=_share)
    duplicate: float = attrs.field(default=0.0, validator=_share)
    """Share of messages that arrive twice."""
    reorder: float = attrs.field(default=0.0, validator=_share)
    """Share of messages that are held back and overtaken."""
    reorder_by_s: float = attrs.field(default=0.1, validator=_seconds)
    """The longest time one is held back."""
    detect_s: float = attrs.field(default=0.01, validator=_seconds)
    """How long it takes to notice that the other end has vanished."""

    def delay_ns(self, rng: random.Random) -> int:
        """The time one message takes, by chance."""
        delay_s = self.latency_s
        if self.jitter_s:
            delay_s += rng.expovariate(1.0 / self.jitter_s)
        return int(delay_s * 1e9)

    def held_back_ns(self, rng: random.Random) -> int:
        """How much longer this one takes because others overtake it; mostly 0."""
        if rng.random() >= self.reorder:
            return 0
        return 1 + int(rng.random() * self.reorder_by_s * 1e9)


LOCAL = Link(latency_s=0.0001)
"""One machine."""
LAN = Link(latency_s=0.0005, jitter_s=0.0005)
"""One site, wired."""
WAN = Link(latency_s=0.04, jitter_s=0.02, loss=0.01, detect_s=2.0)
"""Robots on a mobile network."""
STORM = Link(latency_s=0.001, jitter_s=0.2, loss=0.2, duplicate=0.2, reorder=0.3, reorder_by_s=2.0)
"""Everything at once, far worse than any real network: for tests."""
