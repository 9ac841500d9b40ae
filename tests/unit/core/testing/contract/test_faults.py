"""Hostility, floods, crashes: the checks pass for the fake, and each tells of its own fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.hint import Announcement
from beacon_core.ports.adapter import Malformed
from beacon_core.ports.announcer import Announcer
from beacon_core.testing.contract.faults import FaultChecks
from beacon_core.testing.harness import Harness
from beacon_core.wire import json
from beacon_fake import (
    FakeAnnouncer,
    FakeOptions,
    FakeSource,
    Kind,
    Message,
)
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestFault(FaultChecks):
    def make_harness(self) -> Harness:
        return FakeHarness()


class Broken(Exception):  # noqa: N818 - it is the fault, not an error of the test
    """What a broken adapter raises where it must not."""


def with_decoder(change: Callable[[Announcement], Announcement]) -> FakeHarness:
    def decode(payload: bytes) -> Announcement | Malformed:
        found = json.decode(payload)
        return found if isinstance(found, Malformed) else change(found)

    return FakeHarness(decode=decode)


def raises_when_decoding() -> FakeHarness:
    def decode(payload: bytes) -> Announcement | Malformed:
        raise Broken

    return FakeHarness(decode=decode)


def raises_when_a_hint_needs_repair() -> FakeHarness:
    def refused(a: Announcement) -> Announcement:
        if a.repairs:
            raise Broken
        return a

    return with_decoder(refused)


class HidesTheSender(FakeSource):
    def receive(self, message: Message) -> None:
        super().receive(attrs.evolve(message, sender="carrier", incarnation=""))


class DiesOfBadBytes(FakeSource):
    def receive(self, message: Message) -> None:
        if message.kind is Kind.HINT and isinstance(json.decode(message.payload), Malformed):
            self._network.leave(self)
        super().receive(message)


class DropsBadBytesSilently(FakeSource):
    def receive(self, message: Message) -> None:
        if message.payload or message.kind is not Kind.HINT:
            super().receive(message)


class DoesNotSayWhomAMessageSpeaksFor(FakeSource):
    def receive(self, message: Message) -> None:
        named = message.kind is not Kind.HINT
        super().receive(message if named else attrs.evolve(message, entity_id=""))


class DiesOfAFaultySink(FakeSource):
    def _note_fault(self) -> None:
        self._network.leave(self)


class CountsFloodedMessagesTwice(FakeSource):
    def receive(self, message: Message) -> None:
        super().receive(message)
        super().receive(message)


class ThrottlesEverybodyTogether(FakeSource):
    heard = 0

    def receive(self, message: Message) -> None:
        self.heard += 1
        if self.heard <= 100:
            super().receive(message)


def hears_other_networks() -> FakeHarness:
    class OneForAll(FakeHarness):
        def options(self, network: int = 0) -> FakeOptions:
            return super().options(0)

    return OneForAll()


class SwallowsGoodbyes(FakeAnnouncer):
    def withdraw(self, entity_id: str) -> None:
        self._payloads.pop(entity_id, None)


def does_not_notice_crashes() -> FakeHarness:
    class Unnoticed(FakeHarness):
        def crash(self, announcer: Announcer) -> None:
            assert isinstance(announcer, FakeAnnouncer)
            announcer.vanish()
            self.network().leave(announcer)

    return Unnoticed()


def takes_the_whole_host_for_crashed() -> FakeHarness:
    class TooMany(FakeHarness):
        def crash(self, announcer: Announcer) -> None:
            for name in self.network().names():
                self.network().crash(name)

    return TooMany()


BROKEN: list[tuple[Callable[[], FakeHarness], str, dict[str, Any]]] = [
    (raises_when_decoding, "the_decoder_answers_any_bytes_with_a_value", {}),
    (
        lambda: FakeHarness(source=HidesTheSender),
        "two_processes_with_one_id_are_a_conflict_once_both_go_on",
        {},
    ),
    (lambda: FakeHarness(source=HidesTheSender), "in_a_flood_a_quiet_neighbour_is_heard", {}),
    (
        lambda: FakeHarness(source=DiesOfBadBytes),
        "bytes_that_are_no_hint_are_refused_and_harm_nobody",
        {"kind": "text"},
    ),
    (
        raises_when_a_hint_needs_repair,
        "what_its_own_wire_format_allows_at_its_worst_harms_nobody",
        {},
    ),
    (
        lambda: FakeHarness(source=DropsBadBytesSilently),
        "bytes_that_are_no_hint_are_refused_and_harm_nobody",
        {"kind": "nothing"},
    ),
    (
        lambda: FakeHarness(source=DoesNotSayWhomAMessageSpeaksFor),
        "a_payload_about_another_than_it_may_speak_for_is_refused",
        {},
    ),
    (
        lambda: FakeHarness(source=DiesOfAFaultySink),
        "a_sink_that_raises_does_not_stop_the_source",
        {},
    ),
    (
        lambda: FakeHarness(source=CountsFloodedMessagesTwice),
        "in_a_flood_every_message_is_counted_and_the_rest_dropped",
        {},
    ),
    (
        lambda: FakeHarness(source=ThrottlesEverybodyTogether),
        "a_flood_of_garbage_silences_only_its_sender",
        {},
    ),
    (hears_other_networks, "two_networks_do_not_hear_each_other", {}),
    (
        lambda: FakeHarness(announcer=SwallowsGoodbyes),
        "a_conflict_ends_when_one_of_the_two_leaves",
        {},
    ),
    (does_not_notice_crashes, "a_crash_makes_stale_at_once_and_the_reason_is_told", {}),
    (
        takes_the_whole_host_for_crashed,
        "a_crash_makes_stale_all_that_the_announcer_spoke_for_and_nobody_else",
        {},
    ),
]


@pytest.mark.parametrize(("broken", "check", "parameters"), BROKEN)
def test_the_suite_reports_the_fault(
    run: Run, broken: Callable[[], FakeHarness], check: str, parameters: dict[str, Any]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception, Broken)):
        run(f"test_{check}", broken(), **parameters)
