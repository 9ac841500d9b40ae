"""How an adapter is doing, in words a person can act on."""

from __future__ import annotations

import enum
from collections.abc import Mapping

import attrs

__all__ = ["Condition", "Health"]


class Condition(enum.StrEnum):
    """Where an adapter is in its life, as far as its carrier is concerned."""

    STARTING = "starting"
    """Not connected yet, and trying."""
    UP = "up"
    DEGRADED = "degraded"
    """It works, but something needs attention; ``detail`` says what."""
    DOWN = "down"
    """It was connected and is not any more, and tries again by itself."""
    CLOSED = "closed"


@attrs.frozen
class Health:
    """A report at one moment. Each has counters of its own, so it stays as it was."""

    condition: Condition
    detail: str = ""
    """One sentence: what happened, and what to do about it. Empty when all is well."""
    counters: Mapping[str, int] = attrs.field(factory=dict)
    """The adapter's own counters, such as peers connected; names in kebab-case."""
