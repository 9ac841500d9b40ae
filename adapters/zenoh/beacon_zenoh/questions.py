"""Which questions may be put now, of all that somebody should be asked.

Theory. A token without a hint makes a question, and anybody may invent tokens. One entity is asked
on its own key, and answers alone. When many should be asked, one question to everybody is cheaper
than one to each; but everybody answers it, each time. So both have a rate of their own, and what
cannot be asked yet waits: nobody is forgotten, since it ends in one question to everybody. Whoever
invents tokens costs the fleet no more than one more hint from each in each second.

This holds no thread, no clock and no connection.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.token_bucket import TokenBucket

__all__ = [
    "ASK_ALL_ABOVE",
    "EVERYBODY",
    "QUESTIONS_AT_ONCE",
    "QUESTIONS_PER_S",
    "ROLL_CALLS_AT_ONCE",
    "ROLL_CALLS_PER_S",
    "Questions",
]

EVERYBODY = "*"
"""Stands for all entities; no id has this character."""

ASK_ALL_ABOVE = 16
"""From so many on, one question to everybody is cheaper than one to each."""

ROLL_CALLS_PER_S = 1.0
"""Questions to everybody."""

ROLL_CALLS_AT_ONCE = 4.0
"""A gateway that starts needs four within its first 1.3 s: one at once, and those that the roster
repeats (:data:`beacon_zenoh.roster.ASK_AGAIN_NS`)."""

QUESTIONS_PER_S = 16.0
"""Questions to one entity."""

QUESTIONS_AT_ONCE = 48.0
"""As many as may be asked alone, each three times."""


class Questions:
    """Thread rule: one thread."""

    def __init__(self, now_ns: int) -> None:
        self.postponed = 0
        """How often something that should have been asked had to wait."""
        self._waiting: dict[str, None] = {}
        self._roll_calls = TokenBucket(ROLL_CALLS_PER_S, capacity=ROLL_CALLS_AT_ONCE, now_ns=now_ns)
        self._single = TokenBucket(QUESTIONS_PER_S, capacity=QUESTIONS_AT_ONCE, now_ns=now_ns)

    def want(self, entity_ids: Iterable[str]) -> None:
        """These should be asked."""
        self._waiting.update(dict.fromkeys(entity_ids))
        if len(self._waiting) > ASK_ALL_ABOVE or EVERYBODY in self._waiting:
            self._waiting = {EVERYBODY: None}

    def drop(self) -> None:
        """Nobody can be asked: there is no session."""
        self._waiting.clear()

    def take(self, now_ns: int) -> list[str]:
        """Whom to ask now: entity ids, or :data:`EVERYBODY` alone."""
        taken = []
        for name in list(self._waiting):
            bucket = self._roll_calls if name == EVERYBODY else self._single
            if not bucket.try_consume(now_ns):
                self.postponed += 1
                break
            del self._waiting[name]
            taken.append(name)
        return taken

    def next_due_ns(self) -> int | None:
        """When there may be something to take; ``None``: nobody waits."""
        if not self._waiting:
            return None
        bucket = self._roll_calls if EVERYBODY in self._waiting else self._single
        missing = max(0.0, 1.0 - bucket.tokens)
        # Not a nanosecond too early, or there would be a step for nothing.
        return bucket.updated_ns + int(missing / bucket.rate * 1e9) + 1
