"""The sending half of an adapter."""

from __future__ import annotations

from typing import Protocol

from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Health

__all__ = ["Announcer"]


class Announcer(Protocol):
    """Speaks for any number of entities, on behalf of one process.

    Thread rule: every method may be called from any thread. None waits for the network longer
    than 1 s.
    """

    def announce(self, hint: BeaconHint) -> None:
        """Say it now and, where the announcer has a period, again each period.

        The repetitions of many entities are spread over the period: said all at once, the last of
        them would be cut off by the receiver's rate limit each time.

        A later call with the same ``entity_id`` replaces the hint and is sent at once. Raises
        :class:`beacon_core.errors.UsageError` after ``close``.
        """

    def withdraw(self, entity_id: str) -> None:
        """Say goodbye for this entity and stop repeating it.

        An unknown id is ignored, and so is a call after ``close``.
        """

    def close(self) -> None:
        """Withdraw everything and release the carrier. Idempotent, within 1 s."""

    def health(self) -> Health:
        """How it is doing; never raises, also while ``close`` is under way and after it."""
