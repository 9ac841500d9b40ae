"""Questions: who is asked when, and how often at most."""

from __future__ import annotations

from beacon_zenoh.questions import (
    ASK_ALL_ABOVE,
    EVERYBODY,
    QUESTIONS_AT_ONCE,
    QUESTIONS_PER_S,
    ROLL_CALLS_AT_ONCE,
    ROLL_CALLS_PER_S,
    Questions,
)
from beacon_zenoh.roster import ASK_AGAIN_NS, SETTLE_NS

S = 1_000_000_000


def names(count: int, prefix: str = "e") -> list[str]:
    return [f"{prefix}{number}" for number in range(count)]


def test_while_nobody_should_be_asked_there_is_nothing_to_wait_for() -> None:
    questions = Questions(0)
    assert questions.take(0) == []
    assert questions.next_due_ns() is None


def test_a_few_are_asked_one_by_one_and_once() -> None:
    questions = Questions(0)
    questions.want(["a", "b"])
    questions.want(["a"])
    assert questions.take(0) == ["a", "b"]
    assert questions.take(0) == []
    assert questions.next_due_ns() is None


def test_many_are_asked_by_one_question_to_everybody() -> None:
    questions = Questions(0)
    questions.want(names(ASK_ALL_ABOVE))
    questions.want(["one more"])
    assert questions.take(0) == [EVERYBODY]
    questions.want([EVERYBODY])
    questions.want(["a"])
    assert questions.take(0) == [EVERYBODY]
    assert questions.take(0) == []


def test_a_gateway_that_starts_may_ask_everybody_as_often_as_it_needs() -> None:
    questions = Questions(0)
    at_ns = 0
    for wait_ns in (0, SETTLE_NS, *ASK_AGAIN_NS):
        at_ns += wait_ns
        questions.want([EVERYBODY])
        assert questions.take(at_ns) == [EVERYBODY]
    assert questions.postponed == 0


def test_as_many_as_may_be_asked_alone_are_asked_three_times_without_waiting() -> None:
    questions = Questions(0)
    for _ in range(3):
        questions.want(names(ASK_ALL_ABOVE))
        assert len(questions.take(0)) == ASK_ALL_ABOVE


def test_whatever_is_wanted_only_so_many_questions_are_put_in_any_time() -> None:
    questions = Questions(0)
    asked = {True: 0, False: 0}
    seconds = 60
    for step in range(seconds * 40):
        now_ns = step * S // 40
        questions.want(names(1 + step % 20, prefix=f"invented-{step}-"))
        for name in questions.take(now_ns):
            asked[name == EVERYBODY] += 1
    assert 50 < asked[True] <= ROLL_CALLS_AT_ONCE + ROLL_CALLS_PER_S * seconds
    assert asked[False] <= QUESTIONS_AT_ONCE + QUESTIONS_PER_S * seconds
    assert questions.postponed > 1000


def test_what_has_to_wait_is_asked_as_soon_as_it_may() -> None:
    questions = Questions(0)
    for _ in range(int(ROLL_CALLS_AT_ONCE)):
        questions.want([EVERYBODY])
        questions.take(0)
    questions.want([EVERYBODY])
    assert questions.take(0) == []
    assert questions.postponed == 1
    due_ns = questions.next_due_ns()
    assert due_ns is not None
    assert questions.take(due_ns - 2) == []
    assert questions.take(questions.next_due_ns() or 0) == [EVERYBODY]
    assert due_ns == S // ROLL_CALLS_PER_S + 1


def test_of_those_who_wait_singly_nobody_is_forgotten() -> None:
    questions = Questions(0)
    for number in range(int(QUESTIONS_AT_ONCE)):
        questions.want([f"e{number}"])
        assert questions.take(0) == [f"e{number}"]
    questions.want(["x", "y"])
    asked: list[str] = []
    while (due_ns := questions.next_due_ns()) is not None:
        asked += questions.take(due_ns)
    assert asked == ["x", "y"]
    assert due_ns is None


def test_without_a_session_nobody_waits() -> None:
    questions = Questions(0)
    questions.want(["a"])
    questions.drop()
    assert questions.take(0) == []
