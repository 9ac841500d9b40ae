"""What all checks share: the harness of the check, patience, capabilities, canonical results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.stored import StoredHint
from beacon_core.testing.contract.canonical import canonical, expected
from beacon_core.testing.harness import Harness, Listener

__all__ = ["ContractBase", "hint", "known"]


def hint(entity_id: str, display_name: str = "") -> BeaconHint:
    """A small hint; the name tells one message from the next."""
    return BeaconHint(entity_id=entity_id, display_name=display_name)


def known(listener: Listener, entity_id: str) -> StoredHint:
    """What the store has; fails if it has nothing."""
    stored = listener.store.get(entity_id)
    assert stored is not None, f"{entity_id} is not in the store"
    return stored


class ContractBase:
    """A subclass gives :meth:`make_harness`; every check gets a new one and closes it."""

    recorded: ClassVar[dict[str, Any] | None] = None
    """Set to a dict, canonical results are written there instead of being compared."""

    check = ""
    """The name of the check that is running, with its parameters."""

    def make_harness(self) -> Harness:
        """A harness with nothing on it yet."""
        raise NotImplementedError

    @pytest.fixture
    def harness(self, request: pytest.FixtureRequest) -> Iterator[Harness]:
        self.check = request.node.name
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
    def eventually(harness: Harness, predicate: Callable[[], bool], what: str) -> None:
        """Wait for ``predicate`` to hold, as long as the harness's patience lasts."""
        in_time = harness.wait_until(predicate, harness.patience_s)
        assert in_time, f"did not happen within {harness.patience_s} s: {what}"

    @staticmethod
    def never(harness: Harness, predicate: Callable[[], bool], what: str) -> None:
        """Listen for a while and insist that ``predicate`` does not hold at any moment."""
        assert not harness.wait_until(predicate, harness.quiet_s), f"must not happen: {what}"

    def active(self, harness: Harness, listener: Listener, *entity_ids: str) -> None:
        """Wait until all of these are ACTIVE."""
        for entity_id in entity_ids:
            self.reaches(harness, listener, entity_id, Status.ACTIVE)

    def heard(self, harness: Harness, listener: Listener, entity_id: str) -> None:
        """Wait until the entity is known, whatever its status."""
        self.eventually(
            harness, lambda: listener.status(entity_id) is not None, f"{entity_id} is heard"
        )

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

    def conclude(self, harness: Harness, *listeners: Listener) -> None:
        """Compare what the stores end with to what they end with for every other carrier."""

        def results() -> list[dict[str, Any]]:
            return [canonical(listener) for listener in listeners]

        assert not [failure for listener in listeners for failure in listener.tap.failures]
        if self.recorded is not None:
            harness.wait_until(lambda: False, harness.quiet_s)
            self.recorded[self.check] = results()
            return
        kept = expected(self.check)
        harness.wait_until(lambda: results() == kept, harness.patience_s)
        assert results() == kept, f"not the canonical result of {self.check}"
