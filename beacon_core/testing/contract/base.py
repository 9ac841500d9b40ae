"""What all checks share: the harness of the check, patience, and capabilities."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.testing.harness import Harness, Listener

__all__ = ["ContractBase", "hint"]


def hint(entity_id: str, display_name: str = "") -> BeaconHint:
    """A small hint; the name tells one message from the next."""
    return BeaconHint(entity_id=entity_id, display_name=display_name)


class ContractBase:
    """A subclass gives :meth:`make_harness`; every check gets a new one and closes it."""

    def make_harness(self) -> Harness:
        """A harness with nothing on it yet."""
        raise NotImplementedError

    @pytest.fixture
    def harness(self) -> Iterator[Harness]:
        harness = self.make_harness()
        try:
            yield harness
        finally:
            harness.close()

    @staticmethod
    def needs(harness: Harness, *capabilities: str) -> None:
        """Skip the check, and say why, if the carrier cannot do one of these."""
        for name in capabilities:
            if not getattr(harness.capabilities, name):
                pytest.skip(f"{harness.adapter.name}: the carrier lacks the capability {name}")

    @staticmethod
    def eventually(
        harness: Harness, predicate: Callable[[], bool], what: str, *, deadline_s: float = 0.0
    ) -> None:
        """Wait for ``predicate`` to hold, at most the harness's patience unless told otherwise."""
        deadline_s = deadline_s or harness.patience_s
        assert harness.wait_until(predicate, deadline_s), f"within {deadline_s} s never: {what}"

    @staticmethod
    def quiet(harness: Harness, predicate: Callable[[], bool], what: str) -> None:
        """Listen for a while and insist that ``predicate`` never holds."""
        assert not harness.wait_until(predicate, harness.quiet_s), f"should not happen: {what}"

    def active(self, harness: Harness, listener: Listener, *entity_ids: str) -> None:
        """Wait until all of these are ACTIVE."""
        for entity_id in entity_ids:
            self.reaches(harness, listener, entity_id, Status.ACTIVE)

    def reaches(
        self, harness: Harness, listener: Listener, entity_id: str, status: Status | None
    ) -> None:
        """Wait until the entity has this status; ``None``: until it is gone."""
        self.eventually(
            harness, lambda: listener.status(entity_id) is status, f"{entity_id} is {status}"
        )

    def named(
        self, harness: Harness, listener: Listener, entity_id: str, display_name: str
    ) -> None:
        """Wait until the entity is known by this name."""
        self.eventually(
            harness,
            lambda: listener.says(entity_id, display_name),
            f"{entity_id} is called {display_name!r}",
        )
