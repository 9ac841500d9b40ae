"""The announcer's own promises; that what it says arrives is in the contract suite."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator

import pytest
import zenoh

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import RealTimeHarness
from beacon_core.wire import json
from beacon_zenoh import ZenohOptions, spokesman, wire
from beacon_zenoh import announcer as module
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.harness import free_endpoint, open_router

ENGINE = BeaconHint("engine")


class Ear:
    """A router that writes down what it hears."""

    def __init__(self) -> None:
        self.session, self.endpoint = open_router()
        self.samples: list[zenoh.Sample] = []
        self.tokens: list[str] = []
        self.session.declare_subscriber("beacon/**", self.samples.append)
        self.session.liveliness().declare_subscriber("beacon/**", self._note, history=True)

    def _note(self, sample: zenoh.Sample) -> None:
        sign = "+" if sample.kind == zenoh.SampleKind.PUT else "-"
        self.tokens.append(f"{sign}{sample.key_expr}")

    @property
    def said(self) -> list[str]:
        """Each as ``PUT key`` or ``DELETE key``."""
        return [f"{one.kind} {one.key_expr}".partition(".")[2] for one in self.samples]

    def announcer(self, period_s: float | None = None) -> ZenohAnnouncer:
        return ZenohAnnouncer(ZenohOptions(connect=(self.endpoint,)), period_s)

    def ask(self, key: str) -> list[zenoh.Sample]:
        replies = self.session.get(key, zenoh.handlers.FifoChannel(100), timeout=2.0)
        return [reply.ok for reply in replies if reply.ok is not None]


@pytest.fixture
def ear() -> Iterator[Ear]:
    made = Ear()
    yield made
    made.session.close()


def envelope_of(sample: zenoh.Sample) -> wire.Envelope:
    assert sample.attachment is not None
    envelope = wire.decode(sample.attachment.to_bytes())
    assert envelope is not None
    return envelope


def eventually(predicate: Callable[[], bool]) -> None:
    assert RealTimeHarness().wait_until(predicate, 5.0)


def test_what_it_says_is_the_documented_dialect(ear: Ear) -> None:
    announcer = ear.announcer()
    before_ns = time.time_ns()
    announcer.announce(ENGINE)
    eventually(lambda: len(ear.samples) == len(ear.tokens) == 1)
    announcer.withdraw("engine")
    eventually(lambda: len(ear.samples) == len(ear.tokens) == 2)
    assert ear.said == ["PUT beacon/hint/engine", "DELETE beacon/hint/engine"]
    hint, goodbye = ear.samples
    assert hint.payload.to_bytes() == json.encode(ENGINE)
    assert str(hint.encoding) == "application/json"
    first, second = envelope_of(hint), envelope_of(goodbye)
    assert first[0] == second[0]
    assert (first[1], second[1]) == (1, 2)
    assert before_ns <= first[2] <= second[2] <= time.time_ns()
    token = f"beacon/live/engine/{first[0]}"
    assert ear.tokens == [f"+{token}", f"-{token}"]
    announcer.close()


def test_an_unchanged_hint_is_repeated_in_the_same_bytes(ear: Ear) -> None:
    announcer = ear.announcer(0.01)
    announcer.announce(ENGINE)
    eventually(lambda: len(ear.samples) >= 5)
    announcer.close()
    payloads = {one.payload.to_bytes() for one in ear.samples if one.kind == zenoh.SampleKind.PUT}
    assert payloads == {json.encode(ENGINE)}


def test_repetitions_come_early_by_chance_and_never_late(
    ear: Ear, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer = ear.announcer(10.0)
    waits = []
    for number in range(200):
        voice = announcer._voices[f"part-{number}"] = module._Voice()
        before_ns = time.monotonic_ns()
        announcer._schedule(f"part-{number}", voice)
        waits.append((voice.due_ns - before_ns) / 1e9)
    assert 8.5 <= min(waits) < 8.8
    assert 9.7 < max(waits) <= 10.01
    announcer._voices.clear()
    announcer.close()


def test_who_speaks_much_oftener_than_its_period_leaves_nothing_behind(ear: Ear) -> None:
    announcer = ear.announcer(3600.0)
    for number in range(1000):
        announcer.announce(BeaconHint(f"part-{number % 3}", display_name=f"{number}"))
    eventually(lambda: len(ear.samples) == 1000)
    assert len(announcer._beats) <= 106
    assert {name for _, name in announcer._beats} == {"part-0", "part-1", "part-2"}
    announcer.close()


def test_it_answers_who_asks_with_the_present_hint_and_a_new_number(ear: Ear) -> None:
    announcer = ear.announcer()
    announcer.announce(ENGINE)
    announcer.announce(BeaconHint("engine", display_name="now"))
    announcer.announce(BeaconHint("brake"))
    eventually(lambda: len(ear.samples) == 3)
    eventually(lambda: len(ear.ask("beacon/hint/*")) == 2)
    answers = {str(one.key_expr): one for one in ear.ask("beacon/hint/*")}
    assert set(answers) == {"beacon/hint/engine", "beacon/hint/brake"}
    engine = answers["beacon/hint/engine"]
    assert engine.payload.to_bytes() == json.encode(BeaconHint("engine", display_name="now"))
    assert envelope_of(engine)[1] > 3
    announcer.withdraw("engine")
    eventually(lambda: len(ear.samples) == 4)
    eventually(lambda: [str(one.key_expr) for one in ear.ask("**")] == ["beacon/hint/brake"])
    announcer.close()


def test_a_question_about_somebody_who_has_just_left_is_let_go(ear: Ear) -> None:
    announcer = ear.announcer()
    announcer.announce(ENGINE)
    eventually(lambda: bool(ear.ask("beacon/hint/engine")))
    # As when the goodbye is said between the question and its turn.
    announcer._voices.clear()
    assert ear.ask("beacon/hint/engine") == []
    announcer.close()


def test_a_flood_of_questions_is_dropped_and_not_kept(
    ear: Ear, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MAX_QUESTIONS", 0)
    dropped: list[int] = []
    original = ZenohAnnouncer._on_question

    def count(self: ZenohAnnouncer, entity_id: str, query: zenoh.Query) -> None:
        original(self, entity_id, query)
        dropped.append(len(self._questions))

    monkeypatch.setattr(ZenohAnnouncer, "_on_question", count)
    announcer = ear.announcer()
    announcer.announce(ENGINE)
    eventually(lambda: ear.ask("beacon/hint/engine") == [] and bool(dropped))
    assert set(dropped) == {0}
    announcer.close()


def test_it_says_goodbye_only_for_those_it_spoke_for(ear: Ear) -> None:
    announcer = ear.announcer()
    announcer.withdraw("somebody-else")
    announcer.announce(ENGINE)
    announcer.close()
    eventually(lambda: len(ear.samples) >= 2)
    assert ear.said == ["PUT beacon/hint/engine", "DELETE beacon/hint/engine"]


def test_who_comes_back_in_one_breath_is_heard_in_that_order(ear: Ear) -> None:
    announcer = ear.announcer()
    with announcer._lock:  # so that it finds all of it in line
        announcer._put_in_line("engine", b"1")
        announcer._put_in_line("engine", None)
        announcer._put_in_line("engine", b"2")
    announcer._keeper.wake()
    eventually(lambda: len(ear.samples) == 3)
    kinds = [line.split()[0] for line in ear.said]
    assert kinds == ["PUT", "DELETE", "PUT"]
    assert [one.payload.to_bytes() for one in ear.samples] == [b"1", b"", b"2"]
    eventually(lambda: [str(one.key_expr) for one in ear.ask("**")] == ["beacon/hint/engine"])
    announcer.close()


def test_without_a_router_of_each_entity_the_last_word_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(spokesman, "_MAX_WAITING", 10)
    announcer = ZenohAnnouncer(ZenohOptions(connect=(free_endpoint(),)), 0.001)
    for number in range(100):
        announcer.announce(BeaconHint(f"part-{number % 7}", display_name=f"{number}"))
    announcer.withdraw("part-6")
    last = json.encode(BeaconHint("part-1", display_name="99"))

    def entered() -> bool:
        """Words are taken out of the line before they are."""
        voice = announcer._voices.get("part-1")
        count = announcer.health().counters["entities"]
        return voice is not None and (voice.payload, count) == (last, 6)

    eventually(entered)
    assert not announcer._words
    assert announcer.health().condition is Condition.STARTING
    announcer.close()


def test_words_that_cannot_be_said_quickly_enough_are_reduced_to_the_last_of_each(
    ear: Ear, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer = ear.announcer()
    monkeypatch.setattr(announcer, "_too_many", 5)
    monkeypatch.setattr(spokesman, "_MAX_WAITING", 5)
    with announcer._lock:
        for number in range(100):
            announcer._put_in_line(f"part-{number % 3}", str(number).encode())
        assert len(announcer._words) <= 6
        assert dict(announcer._words)["part-0"] == b"99"
    announcer.close()


def test_a_session_that_is_replaced_is_told_everything_anew(ear: Ear) -> None:
    announcer = ear.announcer()
    for name in ("engine", "brake"):
        announcer.announce(BeaconHint(name))
    eventually(lambda: len(ear.samples) == 2)
    session = announcer._keeper._session
    assert session is not None
    session.close()
    eventually(lambda: len(ear.samples) == 4)
    eventually(lambda: len(ear.tokens) == 6)
    eventually(lambda: len(ear.ask("beacon/hint/*")) == 2)
    announcer.close()


@pytest.mark.parametrize("entity_id", ["", "a b", "a/b", "e" * 257, "*", "größe"])
def test_what_is_no_id_cannot_be_announced(ear: Ear, entity_id: str) -> None:
    announcer = ear.announcer()
    with pytest.raises(UsageError, match=r"entity_id .* letters, digits"):
        announcer.announce(BeaconHint(entity_id))
    announcer.close()


@pytest.mark.parametrize("period_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_is_a_time(period_s: float) -> None:
    with pytest.raises(ConfigError, match=r"period_s: .* seconds above 0"):
        ZenohAnnouncer(ZenohOptions(), period_s)


def test_in_a_forked_child_it_says_what_to_do(ear: Ear, monkeypatch: pytest.MonkeyPatch) -> None:
    announcer = ear.announcer()
    monkeypatch.setattr(announcer._keeper, "_pid", os.getpid() + 1)
    with pytest.raises(UsageError, match="made before a fork; make an announcer in the child"):
        announcer.announce(ENGINE)
    announcer.close()
