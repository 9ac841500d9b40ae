"""Goodbyes, late joiners, restarts: the checks pass for the fake, and each tells of its fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.testing.contract.lifecycle import LifecycleChecks
from beacon_core.testing.harness import Harness
from beacon_core.wire import json
from beacon_fake import (
    FakeAnnouncer,
    FakeSource,
    Kind,
    Message,
)
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestLifecycle(LifecycleChecks):
    def make_harness(self) -> Harness:
        return FakeHarness()


class Broken(Exception):  # noqa: N818 - it is the fault, not an error of the test
    """What a broken adapter raises where it must not."""


class SwallowsGoodbyes(FakeAnnouncer):
    def withdraw(self, entity_id: str) -> None:
        self._payloads.pop(entity_id, None)


class ClosesWithoutGoodbye(FakeAnnouncer):
    def close(self) -> None:
        self._payloads.clear()
        super().close()


class WithdrawsWhatItNeverAnnounced(FakeAnnouncer):
    def withdraw(self, entity_id: str) -> None:
        if not self._gone:
            self._payloads.setdefault(entity_id, b"")
        super().withdraw(entity_id)


def lets_anybody_withdraw() -> FakeHarness:
    return FakeHarness(source=GoodbyeOfNobody, announcer=WithdrawsWhatItNeverAnnounced)


class RaisesOnUnknownIds(FakeAnnouncer):
    def withdraw(self, entity_id: str) -> None:
        if entity_id not in self._payloads:
            raise Broken


class GoesOnAfterTheGoodbye(FakeAnnouncer):
    def withdraw(self, entity_id: str) -> None:
        payload = self._payloads.get(entity_id)
        super().withdraw(entity_id)
        if payload is not None:
            self._payloads[entity_id] = payload
            self._begin_beats(entity_id)


class GoodbyeOfNobody(FakeSource):
    def receive(self, message: Message) -> None:
        if message.kind is Kind.GOODBYE:
            message = attrs.evolve(message, sender="", incarnation="")
        super().receive(message)


class OneIncarnationForAll(FakeAnnouncer):
    def _message(self, *args: Any) -> Message:
        return attrs.evolve(super()._message(*args), incarnation="always", sequence=0)


class TellsNothingToLateSources(FakeAnnouncer):
    def present(self) -> list[Message]:
        return []


class TellsTheFirstToLateSources(FakeAnnouncer):
    first: bytes = b""

    def present(self) -> list[Message]:
        return [self._hint("engine", json.encode(BeaconHint("engine", display_name="first")))]


class TellsLateSourcesOnlyWhatIsFresh(FakeAnnouncer):
    announced_ns = 0

    def announce(self, hint: BeaconHint) -> None:
        self.announced_ns = self._network.clock.monotonic_ns()
        super().announce(hint)

    def present(self) -> list[Message]:
        age_ns = self._network.clock.monotonic_ns() - self.announced_ns
        return super().present() if age_ns < 10**9 else []


class TellsLateSourcesAFew(FakeAnnouncer):
    def present(self) -> list[Message]:
        return super().present()[:256]


class LosesWhoeverHoldsTheId(FakeSource):
    def receive(self, message: Message) -> None:
        if message.kind is Kind.LOST:
            other = {"announcer-2": "announcer-3", "announcer-3": "announcer-2"}
            sender = other[message.sender]
            incarnation = f"{sender}/{int(message.incarnation[-1]) % 2 + 1}"
            message = attrs.evolve(message, sender=sender, incarnation=incarnation)
        super().receive(message)


BROKEN: list[tuple[Callable[[], FakeHarness], str, dict[str, Any]]] = [
    (lambda: FakeHarness(announcer=SwallowsGoodbyes), "who_is_withdrawn_has_left", {}),
    (
        lambda: FakeHarness(announcer=ClosesWithoutGoodbye),
        "an_announcer_that_closes_says_goodbye_for_all",
        {},
    ),
    (lets_anybody_withdraw, "nobody_can_withdraw_what_somebody_else_announced", {}),
    (
        lambda: FakeHarness(announcer=RaisesOnUnknownIds),
        "withdrawing_an_unknown_entity_is_ignored",
        {},
    ),
    (lambda: FakeHarness(announcer=GoesOnAfterTheGoodbye), "a_withdrawn_hint_is_not_repeated", {}),
    (lambda: FakeHarness(announcer=OneIncarnationForAll), "who_left_may_come_back", {}),
    (
        lambda: FakeHarness(announcer=OneIncarnationForAll),
        "an_announcer_restarted_after_a_goodbye_begins_an_empty_life",
        {},
    ),
    (
        lambda: FakeHarness(announcer=OneIncarnationForAll),
        "an_announcer_restarted_after_a_crash_is_a_restart_and_no_conflict",
        {},
    ),
    (
        lambda: FakeHarness(announcer=TellsNothingToLateSources),
        "a_source_that_starts_late_sees_the_present",
        {},
    ),
    (
        lambda: FakeHarness(announcer=TellsNothingToLateSources),
        "a_restarted_source_hears_what_it_missed",
        {},
    ),
    (
        lambda: FakeHarness(announcer=TellsTheFirstToLateSources),
        "a_source_that_starts_late_sees_the_present",
        {},
    ),
    (
        lambda: FakeHarness(announcer=TellsLateSourcesOnlyWhatIsFresh),
        "a_source_that_starts_late_sees_what_was_said_long_ago",
        {},
    ),
    (
        lambda: FakeHarness(announcer=TellsLateSourcesAFew),
        "a_source_that_starts_late_sees_all_of_many",
        {},
    ),
    (
        lambda: FakeHarness(source=LosesWhoeverHoldsTheId),
        "a_crash_noticed_late_does_not_harm_the_successor",
        {},
    ),
]


@pytest.mark.parametrize(("broken", "check", "parameters"), BROKEN)
def test_the_suite_reports_the_fault(
    run: Run, broken: Callable[[], FakeHarness], check: str, parameters: dict[str, Any]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception, Broken)):
        run(f"test_{check}", broken(), **parameters)
