"""Limits and stamps: the checks pass for the fake, and each tells of its own fault."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.hint import Announcement
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.contract.bounds import BoundsChecks
from beacon_core.testing.harness import Harness
from beacon_core.wire import json
from beacon_fake import (
    FakeSource,
    Message,
)
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestBounds(BoundsChecks):
    def make_harness(self) -> Harness:
        return FakeHarness()


def with_decoder(change: Callable[[Announcement], Announcement]) -> FakeHarness:
    def decode(payload: bytes) -> Announcement | Malformed:
        found = json.decode(payload)
        return found if isinstance(found, Malformed) else change(found)

    return FakeHarness(decode=decode)


def loses_the_stamp() -> FakeHarness:
    return with_decoder(lambda a: attrs.evolve(a, stamp_ns=0))


def mangles_text() -> FakeHarness:
    def mangled(a: Announcement) -> Announcement:
        name = a.hint.display_name.encode().decode("latin-1")
        return attrs.evolve(a, hint=attrs.evolve(a.hint, display_name=name))

    return with_decoder(mangled)


def has_limits_of_its_own() -> FakeHarness:
    return with_decoder(
        lambda a: attrs.evolve(a, hint=attrs.evolve(a.hint, stable_id=a.hint.stable_id[:255]))
    )


class CutsLargePayloads(FakeSource):
    def receive(self, message: Message) -> None:
        super().receive(attrs.evolve(message, payload=message.payload[:65_000]))


class RefusesLargePayloadsItself(FakeSource):
    def receive(self, message: Message) -> None:
        if len(message.payload) <= 262_144:
            super().receive(message)


BROKEN: list[tuple[Callable[[], FakeHarness], str, dict[str, Any]]] = [
    (loses_the_stamp, "a_stamp_survives_the_wire", {}),
    (loses_the_stamp, "a_stamp_in_the_past_gives_the_age", {}),
    (loses_the_stamp, "a_stamp_older_than_the_time_to_live_makes_a_stale_hint", {}),
    (
        mangles_text,
        "over_a_limit_a_hint_is_repaired_and_the_repair_reported",
        {"limit": "display_name-multibyte"},
    ),
    (has_limits_of_its_own, "at_a_limit_nothing_is_touched", {"limit": "stable_id"}),
    (
        lambda: FakeHarness(source=CutsLargePayloads),
        "the_largest_hint_there_may_be_arrives_intact",
        {},
    ),
    (
        lambda: FakeHarness(source=RefusesLargePayloadsItself),
        "a_larger_payload_is_refused_and_harms_nobody",
        {},
    ),
]


@pytest.mark.parametrize(("broken", "check", "parameters"), BROKEN)
def test_the_suite_reports_the_fault(
    run: Run, broken: Callable[[], FakeHarness], check: str, parameters: dict[str, Any]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception)):
        run(f"test_{check}", broken(), **parameters)
