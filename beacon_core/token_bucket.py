"""Token buckets: how much each source may say, and all of them together.

Theory. A bucket holds at most ``capacity`` tokens and gains ``rate`` per second; a message takes
one or is dropped. In any window of ``t`` seconds at most ``capacity + rate * t`` messages pass.

Fairness. One global bucket lets whoever is loudest have nearly all of it. Here each source has a
bucket of its own in front, so a loud one is cut to its own rate first. What is left is a flood of
many sources, each within its own rate: the lower half of the global bucket is kept for *settled*
sources, those that have sent something acceptable before and are not near the end of their own
bucket. Strangers and loud ones only draw from the upper half.
"""

from __future__ import annotations

import math
from typing import Protocol

from beacon_core.checks import positive_rate
from beacon_core.outcome import Verdict

__all__ = ["FairGate", "Paced", "TokenBucket"]

_SECOND_NS = 1_000_000_000

_SOURCE_RATE = Verdict.SOURCE_RATE
_GLOBAL_RATE = Verdict.GLOBAL_RATE


class TokenBucket:
    """One bucket, full at start.

    Thread rule: none of its own; the owner holds a lock. Time that goes back counts as no time.
    """

    __slots__ = ("capacity", "rate", "tokens", "updated_ns")

    def __init__(self, rate: float, *, now_ns: int, capacity: float | None = None) -> None:
        """``rate`` in tokens per second; ``capacity`` in tokens, by default one second's worth.

        Raises ``ConfigError`` unless both are finite and at least 1.
        """
        self.rate = positive_rate("rate", rate)
        self.capacity = self.rate if capacity is None else positive_rate("capacity", capacity)
        self.tokens = self.capacity
        self.updated_ns = now_ns

    def try_consume(self, now_ns: int) -> bool:
        """Take one token if there is one."""
        if self.refill(now_ns) < 1.0:
            return False
        self.tokens -= 1.0
        return True

    def refill(self, now_ns: int) -> float:
        """Bring the level up to ``now_ns`` and return it."""
        elapsed_ns = now_ns - self.updated_ns
        if elapsed_ns > 0:
            # The grouping of these three operations is ros2_medkit's, so that both grant alike
            # to the last bit.
            tokens = self.tokens + (elapsed_ns / 1e9) * self.rate
            self.tokens = tokens if tokens < self.capacity else self.capacity
            self.updated_ns = now_ns
        return self.tokens


class Paced(Protocol):
    """What :class:`FairGate` keeps of each source; whoever makes one starts it at 0."""

    busy_until_ns: int
    """When its bucket would be full again."""


class FairGate:
    """Per-source buckets under one global bucket. The theory is at the top of this module.

    The buckets are kept as a single time each, the moment at which they would be full again (the
    "virtual scheduling" form of ITU-T I.371, annex A, which grants exactly what a bucket grants):
    whole numbers, half the cost, and a quarter of the memory of :class:`TokenBucket`.

    Thread rule: as for :class:`TokenBucket`.
    """

    def __init__(self, *, source_rate: float, global_rate: float) -> None:
        """Messages per second, with a burst of one second's worth.

        Raises ``ConfigError`` unless both are finite and at least 1.
        """
        source_rate = positive_rate("source_rate", source_rate)
        global_rate = positive_rate("global_rate", global_rate)
        # Rounded up, so that never more is granted than was said.
        self._source_step_ns = math.ceil(_SECOND_NS / source_rate)
        self._global_step_ns = math.ceil(_SECOND_NS / global_rate)
        # One token less than the burst: a message passes if a token is there, not if none is gone.
        self._source_burst_ns = int((source_rate - 1) * self._source_step_ns)
        self._global_burst_ns = int((global_rate - 1) * self._global_step_ns)
        self._reserve_ns = self._global_burst_ns // 2
        self._busy_until_ns = 0

    def admit(self, source: Paced, now_ns: int, settled: bool) -> Verdict | None:  # noqa: FBT001
        """Let one message of a source pass, and take a token from both buckets.

        Returns ``None`` for "pass", else the verdict to drop the message with. A source turned away
        by the global bucket keeps its own token.
        """
        # Written to be quick where both buckets are full or nearly so: that is nearly always.
        busy_ns = source.busy_until_ns
        if busy_ns < now_ns:
            busy_ns = now_ns
        elif busy_ns - now_ns > self._source_burst_ns:
            return _SOURCE_RATE
        all_busy_ns = self._busy_until_ns
        if all_busy_ns < now_ns:
            all_busy_ns = now_ns
        elif all_busy_ns - now_ns > self._reserve_ns and (
            all_busy_ns - now_ns > self._global_burst_ns
            or not settled
            or (busy_ns - now_ns) * 2 > self._source_burst_ns
        ):
            return _GLOBAL_RATE
        source.busy_until_ns = busy_ns + self._source_step_ns
        self._busy_until_ns = all_busy_ns + self._global_step_ns
        return None

    def tokens(self, now_ns: int) -> float:
        """How many messages all sources together may send at once."""
        full_ns = self._global_burst_ns + self._global_step_ns
        return max(0, full_ns - max(0, self._busy_until_ns - now_ns)) / self._global_step_ns

    def charge(self, source: Paced, tokens: int, now_ns: int) -> None:
        """Take tokens from a source for trouble caused; its bucket does not go below empty."""
        spent_ns = max(0, source.busy_until_ns - now_ns) + tokens * self._source_step_ns
        source.busy_until_ns = now_ns + min(spent_ns, self._source_burst_ns + self._source_step_ns)
