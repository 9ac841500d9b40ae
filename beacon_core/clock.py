"""Time as a port: the core is handed the time and never asks the operating system for it.

Two clocks are needed. Ages are differences of the *monotonic* clock, which no one sets back;
stamps on messages are readings of the sender's *wall* clock.
"""

from __future__ import annotations

import time
from typing import Protocol

__all__ = ["Clock", "ManualClock", "SystemClock"]


class Clock(Protocol):
    """Thread rule: both methods may be called from any thread, also while a lock is held.

    Neither may block or raise.
    """

    def monotonic_ns(self) -> int:
        """Nanoseconds from an arbitrary start; never below 0, and never goes back."""

    def wall_ns(self) -> int:
        """Nanoseconds since 1970-01-01 UTC, as this machine believes."""


class SystemClock:
    """The operating system's clocks: the one place where the core meets them."""

    monotonic_ns = staticmethod(time.monotonic_ns)
    wall_ns = staticmethod(time.time_ns)


class ManualClock:
    """A clock that moves only when told: for tests and simulations.

    Thread rule: move it from one thread; read it from any.
    """

    def __init__(self, monotonic_ns: int = 10**9, wall_ns: int = 1_700_000_000 * 10**9) -> None:
        self._monotonic_ns = monotonic_ns
        self._wall_ns = wall_ns

    def monotonic_ns(self) -> int:
        return self._monotonic_ns

    def wall_ns(self) -> int:
        return self._wall_ns

    def advance(self, ns: int) -> None:
        """Let ``ns`` nanoseconds pass on both clocks.

        Raises ``ValueError`` when ``ns`` is negative: a monotonic clock has no way back.
        """
        if ns < 0:
            raise ValueError(f"advance({ns}): a monotonic clock cannot go back")
        self._monotonic_ns += ns
        self._wall_ns += ns

    def set_wall(self, ns: int) -> None:
        """Set the wall clock alone, as NTP or an operator would; any value is allowed."""
        self._wall_ns = ns
