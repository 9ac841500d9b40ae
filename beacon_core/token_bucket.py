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

from beacon_core.checks import positive_rate
from beacon_core.outcome import Verdict

__all__ = ["FairGate", "TokenBucket"]

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

    def charge(self, tokens: float) -> None:
        """Take tokens for trouble caused; the level does not go below zero."""
        self.tokens = max(0.0, self.tokens - tokens)


class FairGate:
    """Per-source buckets under one global bucket. The theory is at the top of this module.

    Thread rule: as for :class:`TokenBucket`.
    """

    __slots__ = ("_everyone", "_reserve", "_source_rate")

    def __init__(self, *, source_rate: float, global_rate: float, now_ns: int) -> None:
        """Rates in messages per second. Raises ``ConfigError`` unless finite and at least 1."""
        self._source_rate = positive_rate("source_rate", source_rate)
        self._everyone = TokenBucket(positive_rate("global_rate", global_rate), now_ns=now_ns)
        # One less, so that a stranger passes a full bucket of any size.
        self._reserve = (self._everyone.capacity - 1.0) / 2

    def bucket(self, now_ns: int) -> TokenBucket:
        """A full bucket for a source that was not heard before."""
        return TokenBucket(self._source_rate, now_ns=now_ns)

    def admit(self, own: TokenBucket, now_ns: int, settled: bool) -> Verdict | None:  # noqa: FBT001
        """Let a source pass, whose bucket is ``own``, and take a token from both buckets.

        Returns ``None`` for "pass", else the verdict to drop the message with. A source turned away
        by the global bucket keeps its own token.
        """
        # Both refills are written out: this runs for every message, and a call costs as much as
        # the arithmetic.
        elapsed_ns = now_ns - own.updated_ns
        if elapsed_ns > 0:
            level = own.tokens + (elapsed_ns / 1e9) * own.rate
            own.tokens = level = level if level < own.capacity else own.capacity
            own.updated_ns = now_ns
        else:
            level = own.tokens
        if level < 1.0:
            return _SOURCE_RATE
        everyone = self._everyone
        elapsed_ns = now_ns - everyone.updated_ns
        if elapsed_ns > 0:
            available = everyone.tokens + (elapsed_ns / 1e9) * everyone.rate
            everyone.tokens = available = (
                available if available < everyone.capacity else everyone.capacity
            )
            everyone.updated_ns = now_ns
        else:
            available = everyone.tokens
        if available - 1.0 < self._reserve and (
            available < 1.0 or not settled or level * 2 < own.capacity
        ):
            return _GLOBAL_RATE
        own.tokens = level - 1.0
        everyone.tokens = available - 1.0
        return None
