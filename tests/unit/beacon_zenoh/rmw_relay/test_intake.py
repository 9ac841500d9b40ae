"""A subscription: what waits is bounded, what comes twice is told once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import attrs
import pytest
import zenoh

from beacon_core.relay.effects import Subscribe
from beacon_core.relay.values import Qos
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw_relay import intake as module
from beacon_zenoh.rmw_relay.harness import TEXT
from beacon_zenoh.rmw_relay.intake import Intake
from beacon_zenoh.rmw_relay.teller import Teller

ONE, TWO = b"1" * 16, b"2" * 16


@attrs.frozen
class Sample:
    """What an intake looks at."""

    payload: zenoh.ZBytes
    attachment: zenoh.ZBytes | None
    timestamp: str | None


class Now(Teller):
    """Tells when asked to."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], object]] = []

    def tell(self, what: Callable[[], object]) -> None:
        self.waiting.append(what)

    def run(self) -> int:
        """Says how many turns it took."""
        turns = 0
        while self.waiting:
            self.waiting.pop(0)()
            turns += 1
        return turns


@attrs.define
class Fixture:
    teller: Now = attrs.field(factory=Now)
    told: list[tuple[bytes, bytes, int]] = attrs.field(factory=list)

    def intake(self, *, durable: bool = False) -> Intake:
        what = Subscribe(1, "/t", TEXT, Qos(True, durable, 10))
        return Intake(what, self.teller, lambda _, *told: self.told.append(told))

    def payloads(self) -> list[bytes]:
        self.teller.run()
        return [payload for _, payload, _ in self.told]


@pytest.fixture
def it() -> Fixture:
    return Fixture()


def come(
    intake: Intake, payload: bytes, gid: bytes = ONE, number: int = 0, stamp: str | None = None
) -> None:
    beside = zenoh.ZBytes(attachment.encode(gid, number, 7))
    intake._take(cast("Any", Sample(zenoh.ZBytes(payload), beside, stamp)))


def test_a_message_comes_with_gid_and_stamp(it: Fixture) -> None:
    come(it.intake(), b"x", number=1)
    assert it.teller.run() == 1
    assert it.told == [(ONE, b"x", 7)]


def test_what_has_no_attachment_is_not_told(it: Fixture) -> None:
    intake = it.intake()
    for beside in (None, zenoh.ZBytes(b"who knows")):
        intake._take(cast("Any", Sample(zenoh.ZBytes(b"x"), beside, None)))
    assert it.payloads() == []
    assert intake.refused == 2


def test_a_message_that_comes_again_is_told_once_in_whatever_order(it: Fixture) -> None:
    intake = it.intake()
    for number in (1, 3, 2, 3, 1, 4):
        come(intake, b"%d" % number, number=number)
    come(intake, b"other", TWO, 1)
    assert it.payloads() == [b"1", b"3", b"2", b"4", b"other"]


def test_messages_without_a_number_are_all_told(it: Fixture) -> None:
    intake = it.intake()
    for _ in range(2):
        come(intake, b"x")
    assert it.payloads() == [b"x", b"x"]


def test_what_is_kept_is_known_by_its_stamp_though_its_publisher_has_another_number(
    it: Fixture,
) -> None:
    intake = it.intake(durable=True)
    come(intake, b"map", ONE, 1, "1/a")
    come(intake, b"map", TWO, 1, "1/a")
    come(intake, b"new", TWO, 2, "2/a")
    come(intake, b"old", TWO, 2)
    assert it.payloads() == [b"map", b"new", b"old"]


def test_the_oldest_gives_way_when_too_many_wait(
    it: Fixture, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "MOST_WAITING", 3)
    intake = it.intake()
    for number in range(5):
        come(intake, b"%d" % number)
    assert it.payloads() == [b"2", b"3", b"4"]
    assert intake.dropped == 2
    assert [one.message for one in caplog.records] == [
        "/t: more comes than is taken; the oldest gives way"
    ]


def test_and_when_too_many_bytes_wait_but_one_may_always(
    it: Fixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_WAITING_BYTES", 10)
    intake = it.intake()
    for payload in (b"a" * 8, b"b" * 4, b"c" * 4):
        come(intake, payload)
    assert it.payloads() == [b"b" * 4, b"c" * 4]
    come(intake, b"d" * 20)
    assert it.payloads()[2:] == [b"d" * 20]


def test_other_topics_get_their_turn(it: Fixture) -> None:
    busy, other = it.intake(), it.intake()
    for number in range(100):
        come(busy, b"%d" % number)
    come(other, b"other")
    payloads = it.payloads()
    assert payloads.index(b"other") == 64
    assert len(payloads) == 101


def test_nothing_is_told_after_the_end(it: Fixture) -> None:
    intake = it.intake()
    come(intake, b"x")
    intake.close()
    come(intake, b"y")
    assert it.payloads() == []
