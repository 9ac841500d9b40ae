"""What a sink is told of a node's answers, and of what an event said before it fell silent."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from beacon_core.outcome import Outcome, Verdict
from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_core.parameters.target import Poll, Target
from beacon_core.parameters.teller import Teller


class Sink:
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []
        self.raises = False
        self.takes = True

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        return self._note("offer", source, envelope)

    def goodbye(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return self._note("goodbye", entity_id, envelope)

    def lost(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return self._note("lost", entity_id, envelope)

    def _note(self, kind: str, whom: str, envelope: dict[str, Any]) -> Outcome:
        if self.raises:
            raise RuntimeError("a fault in the sink")
        self.told.append((kind, whom, envelope))
        return Outcome(Verdict.NEW, "engine" if self.takes else "")

    def take(self) -> list[str]:
        kinds = [one[0] for one in self.told]
        self.told.clear()
        return kinds


@pytest.fixture
def sink() -> Sink:
    return Sink()


@pytest.fixture
def teller(sink: Sink) -> Teller:
    return Teller(sink, 0)


@pytest.fixture
def target() -> Target:
    return Target("/engine", 0, incarnation="run-1")


def answered(at_ns: int, entity_id: str = "engine", **others: Any) -> Poll:
    parameters = {f"{PREFIX}.{key}": value for key, value in others.items()}
    return Poll(at_ns, values={**parameters, ENTITY_ID: entity_id})


def test_a_hint_is_offered_with_its_run_and_the_time_of_the_question(
    teller: Teller, sink: Sink, target: Target
) -> None:
    teller.heard(target, answered(7), 9)
    assert sink.told == [("offer", "/engine", {"incarnation": "run-1", "sequence": 7})]


def test_without_the_name_of_a_run_there_is_no_number(teller: Teller, sink: Sink) -> None:
    teller.heard(Target("/engine", 0), answered(7), 9)
    assert sink.told[0][2] == {"incarnation": "", "sequence": 0}


def test_a_hint_that_is_gone_was_a_goodbye_once(teller: Teller, sink: Sink, target: Target) -> None:
    teller.heard(target, answered(1), 1)
    for at_ns in (2, 3):
        teller.heard(target, answered(at_ns, ""), at_ns)
    assert sink.take() == ["offer", "goodbye"]
    assert teller.counts["goodbyes"] == 1


def test_who_was_not_taken_has_nothing_to_take_back(
    teller: Teller, sink: Sink, target: Target
) -> None:
    sink.takes = False
    teller.heard(target, answered(1), 1)
    teller.heard(target, answered(2, ""), 2)
    teller.left(target, "gone", 3)
    assert sink.take() == ["offer"]


def test_who_leaves_is_lost_and_why_is_told(teller: Teller, sink: Sink, target: Target) -> None:
    teller.heard(target, answered(1), 1)
    teller.left(target, "its cable is cut", 2)
    assert sink.told[-1] == (
        "lost",
        "engine",
        {"incarnation": "run-1", "reason": "its cable is cut"},
    )
    assert teller.counts["lost"] == 1


def test_who_told_that_it_leaves_and_does_so_said_goodbye(
    teller: Teller, sink: Sink, target: Target
) -> None:
    teller.heard(target, answered(1), 1)
    target.left_ns = 2
    teller.left(target, "gone", 3)
    assert sink.take() == ["offer", "goodbye"]


def test_who_told_that_it_leaves_and_falls_silent_said_goodbye(
    teller: Teller, sink: Sink, target: Target
) -> None:
    teller.heard(target, answered(1), 1)
    teller.unanswered(target, 2)
    assert sink.take() == ["offer"]
    target.left_ns = 3
    teller.unanswered(target, 4)
    assert sink.take() == ["goodbye"]


def test_an_answer_to_a_later_question_contradicts_an_event(
    teller: Teller, sink: Sink, target: Target
) -> None:
    teller.heard(target, answered(1), 1)
    target.left_ns = 5
    teller.heard(target, answered(4), 6)
    assert target.left_ns == 5
    teller.heard(target, answered(6), 7)
    assert target.left_ns == 0
    assert "goodbye" not in sink.take()


def test_what_is_left_out_is_logged_but_not_without_end(
    teller: Teller, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        for number in range(100):
            teller.heard(Target(f"/n{number}", 0), answered(1, colour="blue"), 1)
    assert caplog.messages[0].startswith(f"/n0: left out: '{PREFIX}.colour'")
    assert len(caplog.messages) == 20


def test_a_sink_that_raises_is_counted_and_a_goodbye_is_said_again(
    teller: Teller, sink: Sink, target: Target
) -> None:
    teller.heard(target, answered(1), 1)
    sink.raises = True
    teller.heard(target, answered(2, ""), 2)
    sink.raises = False
    teller.heard(target, answered(3, ""), 3)
    assert sink.take() == ["offer", "goodbye"]
    assert teller.counts["sink-errors"] == 1


def test_who_is_stopped_tells_nothing(teller: Teller, sink: Sink, target: Target) -> None:
    teller.heard(target, answered(1), 1)
    teller.stop()
    teller.heard(target, answered(2), 2)
    teller.left(target, "gone", 3)
    assert sink.take() == ["offer"]
