"""Where each message is: in exactly one place, at any time.

Theory. What a side takes charge of is *entered*, and what it is done with is *settled*, once, under
one name. What is neither settled nor lost sight of is held, so ::

    entered = the sum of all fates + held

A forwarder counts messages that its network gave it. A republisher counts the numbers of contents
that its forwarder has announced, come or not: from the first one that it is to have.
"""

from __future__ import annotations

import enum
from collections import Counter

__all__ = ["Fate", "Ledger"]


class Fate(enum.StrEnum):
    """How a message ended."""

    SENT = "sent"
    """The conduit was given it, and the forwarder does not hold it any more."""
    DELIVERED = "delivered"
    """The topic side was told to publish it."""
    OVERSIZE = "oversize"
    """It is larger than a route may hold."""
    EVICTED = "evicted"
    """It gave way to newer ones before it was sent, or before it could be asked for."""
    CONFLATED = "conflated"
    """A newer one came, and only the newest is wanted."""
    UNLINKED = "unlinked"
    """There was no link, and the route keeps nothing."""
    ECHO = "echo"
    """It was a relay's own, come back."""
    HOPS = "hops"
    """It had passed too many relays."""
    SKIPPED = "skipped"
    """A newer one came first, and nobody waits on this route."""
    OVERDUE = "overdue"
    """It was asked for in vain, for as long as a gap may hold up what follows."""
    RESTARTED = "restarted"
    """The forwarder was restarted, so nobody has it any more."""
    WITHDRAWN = "withdrawn"
    """The route came to its end before the message came."""
    LIMITED = "limited"
    """More came than its rule allows in the time."""
    EXPIRED = "expired"
    """It was too old before it could be sent."""
    REFUSED = "refused"
    """The topic side cannot publish it."""


class Ledger:
    """Thread rule: none of its own."""

    def __init__(self) -> None:
        self.entered = 0
        self._settled: Counter[Fate] = Counter()

    @property
    def held(self) -> int:
        """Entered, and not settled yet."""
        return self.entered - self._settled.total()

    def enter(self, count: int = 1) -> None:
        """So many messages have come into this side's charge."""
        self.entered += count

    def settle(self, fate: Fate, count: int = 1) -> None:
        """So many of them have ended so."""
        if count:
            self._settled[fate] += count

    def pass_on(self, fate: Fate) -> None:
        """One has come, and ended so at once."""
        self.entered += 1
        self._settled[fate] += 1

    def fates(self) -> dict[Fate, int]:
        """How many ended how; those that none ended in are left out."""
        return dict(self._settled)

    def add(self, other: Ledger) -> None:
        """Count all of another one here too."""
        self.entered += other.entered
        self._settled.update(other._settled)
