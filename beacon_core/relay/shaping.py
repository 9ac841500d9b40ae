"""How much of a topic may go out, how old it may be, and who goes first."""

from __future__ import annotations

import math

import attrs

from beacon_core.errors import ConfigError

__all__ = ["PRIORITIES", "UNSHAPED", "Shaping", "is_rate"]

PRIORITIES = 8
"""Classes, 0 to 7; 7 goes first."""


@attrs.frozen
class Shaping:
    """Of one topic. ``ConfigError`` for what cannot be meant."""

    rate_hz: float | None = None
    """Messages per second, two at once at the most; ``None``: as many as come."""
    bytes_per_s: float | None = None
    """Of frames. What a tenth of a second allows may go at once, and one message always."""
    max_age_ns: int | None = None
    """Since the forwarder took it: what is so old is not sent, nor sent again."""
    priority: int = 0

    def __attrs_post_init__(self) -> None:
        for key, rate in (("rate_hz", self.rate_hz), ("bytes_per_s", self.bytes_per_s)):
            if rate is not None and not is_rate(rate):
                raise ConfigError(f"{key}: {rate!r} is no rate; give a number above 0")
        if self.max_age_ns is not None and self.max_age_ns <= 0:
            raise ConfigError(f"max_age_ns: {self.max_age_ns} is not possible; give more than 0")
        if not 0 <= self.priority < PRIORITIES:
            raise ConfigError(
                f"priority: {self.priority} is not possible; give 0 to {PRIORITIES - 1}"
            )


def is_rate(rate: float) -> bool:
    """Something per second: finite, above 0."""
    return 0 < rate < math.inf


UNSHAPED = Shaping()
"""Everything at once, however old."""
