"""Delivery: the checks pass for the fake, and each tells of its own fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.ports.adapter import Malformed
from beacon_core.ports.sink import HintSink
from beacon_core.testing.contract.delivery import DeliveryChecks
from beacon_core.testing.harness import Harness
from beacon_core.wire import json
from beacon_fake import (
    FakeAnnouncer,
    FakeSource,
    Link,
    Message,
)
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestDelivery(DeliveryChecks):
    def make_harness(self) -> Harness:
        return FakeHarness()


def with_decoder(change: Callable[[Announcement], Announcement]) -> FakeHarness:
    def decode(payload: bytes) -> Announcement | Malformed:
        found = json.decode(payload)
        return found if isinstance(found, Malformed) else change(found)

    return FakeHarness(decode=decode)


def loses_a_field() -> FakeHarness:
    return with_decoder(lambda a: attrs.evolve(a, hint=attrs.evolve(a.hint, depends_on=())))


def mangles_text() -> FakeHarness:
    def mangled(a: Announcement) -> Announcement:
        name = a.hint.display_name.encode().decode("latin-1")
        return attrs.evolve(a, hint=attrs.evolve(a.hint, display_name=name))

    return with_decoder(mangled)


def trims_text() -> FakeHarness:
    return with_decoder(
        lambda a: attrs.evolve(a, hint=attrs.evolve(a.hint, hostname=a.hint.hostname.strip()))
    )


def reorders() -> FakeHarness:
    return FakeHarness(link=Link(reorder=0.2, reorder_by_s=0.01))


def loses() -> FakeHarness:
    return FakeHarness(link=Link(loss=0.05))


class WaitsForItsPeriod(FakeAnnouncer):
    def announce(self, hint: BeaconHint) -> None:
        if hint.entity_id not in self._payloads:
            super().announce(hint)
        self._payloads[hint.entity_id] = json.encode(hint)


class NeverRepeats(FakeAnnouncer):
    def _beat(self, entity_id: str, row: int) -> None:
        pass


class RepeatsUnasked(FakeAnnouncer):
    def announce(self, hint: BeaconHint) -> None:
        super().announce(hint)
        self._network.schedule(self._network.clock.monotonic_ns() + 3 * 10**9, self._again)

    def _again(self) -> None:
        for message in self.present():
            self._network.send(message)


class RepeatsAllAtOnce(FakeAnnouncer):
    def _schedule_beat(self, in_ns: int, entity_id: str, row: int) -> None:
        period_ns = self._period_ns or 1
        now_ns = self._network.clock.monotonic_ns()
        in_ns = period_ns - now_ns % period_ns
        super()._schedule_beat(in_ns, entity_id, row)


class ChangesWithEachRepetition(FakeAnnouncer):
    def announce(self, hint: BeaconHint) -> None:
        super().announce(attrs.evolve(hint, process_name=f"{self._sequence}"))


class HidesTheSender(FakeSource):
    def receive(self, message: Message) -> None:
        super().receive(attrs.evolve(message, sender="carrier", incarnation=""))


class OnlyTheFirstHears(FakeSource):
    def start(self, sink: HintSink) -> None:
        if not self._network._receivers:
            super().start(sink)


BROKEN: list[tuple[Callable[[], FakeHarness], str, dict[str, Any]]] = [
    (loses_a_field, "every_field_arrives_intact", {}),
    (loses_a_field, "any_valid_hint_arrives_intact", {}),
    (mangles_text, "text_of_any_script_arrives_intact", {"script": "cjk"}),
    (trims_text, "text_of_any_script_arrives_intact", {"script": "spaces-around"}),
    (reorders, "what_one_announcer_says_arrives_in_the_order_said", {}),
    (loses, "one_announcer_speaks_for_many_entities", {}),
    (loses, "announcing_from_many_threads_loses_nothing", {}),
    (
        lambda: FakeHarness(announcer=WaitsForItsPeriod),
        "a_change_is_seen_without_waiting_for_the_next_period",
        {},
    ),
    (
        lambda: FakeHarness(announcer=NeverRepeats),
        "an_announcer_with_a_period_repeats_by_itself",
        {},
    ),
    (
        lambda: FakeHarness(announcer=RepeatsUnasked),
        "an_announcer_without_a_period_speaks_only_when_told",
        {},
    ),
    (
        lambda: FakeHarness(announcer=RepeatsAllAtOnce),
        "repetitions_are_spread_so_that_a_rate_does_not_starve_the_same_ones_for_ever",
        {},
    ),
    (
        lambda: FakeHarness(announcer=ChangesWithEachRepetition),
        "saying_the_same_again_is_no_change",
        {},
    ),
    (lambda: FakeHarness(source=HidesTheSender), "every_announcer_is_a_sender_of_its_own", {}),
    (lambda: FakeHarness(source=OnlyTheFirstHears), "every_source_hears_everything", {}),
]


@pytest.mark.parametrize(("broken", "check", "parameters"), BROKEN)
def test_the_suite_reports_the_fault(
    run: Run, broken: Callable[[], FakeHarness], check: str, parameters: dict[str, Any]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        run(f"test_{check}", broken(), **parameters)
