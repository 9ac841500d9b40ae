"""Coming, going, coming back: goodbyes, late joiners, restarts of either end, and health."""

from __future__ import annotations

import pytest

from beacon_core.errors import UsageError
from beacon_core.lifecycle import Cause, Status
from beacon_core.ports.health import Condition
from beacon_core.testing.contract.base import ContractBase, hint
from beacon_core.testing.harness import Harness, Listener

__all__ = ["LifecycleChecks"]


class LifecycleChecks(ContractBase):
    """The life of announcers and sources, as the store tells it."""

    def test_a_withdrawn_hint_has_left(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        announcer.withdraw("engine")
        self.reaches(harness, listener, "engine", Status.LEFT)

    def test_a_crashed_announcer_is_stale_at_once_and_the_reason_is_told(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "detects_crash")
        listener = Listener(harness).start()
        announcer = harness.announcer(mortal=True)
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        harness.crash(announcer)
        self.reaches(harness, listener, "engine", Status.STALE)
        stored = listener.store.get("engine")
        assert stored is not None
        assert stored.cause is Cause.LOST
        assert stored.detail

    def test_a_source_that_starts_late_sees_the_present(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present")
        early = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine", "first"))
        announcer.announce(hint("engine", "second"))
        self.named(harness, early, "engine", "second")
        late = Listener(harness).start()
        self.named(harness, late, "engine", "second")

    def test_a_second_start_is_a_mistake_of_the_caller(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        with pytest.raises(UsageError):
            listener.source.start(listener.tap)

    def test_health_before_start_while_up_and_after_close(self, harness: Harness) -> None:
        listener = Listener(harness)
        assert listener.source.health().condition in (Condition.STARTING, Condition.CLOSED)
        listener.start()
        self.eventually(
            harness, lambda: listener.source.health().condition is Condition.UP, "the source is up"
        )
        listener.source.close()
        assert listener.source.health().condition is Condition.CLOSED
