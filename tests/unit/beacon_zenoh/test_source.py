"""What the contract suite cannot see of the source: who is asked, how often, and what counts."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import count

import pytest
import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.testing.harness import Listener
from beacon_core.wire import json
from beacon_zenoh import wire
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import ZenohHarness
from beacon_zenoh.questions import ROLL_CALLS_AT_ONCE, ROLL_CALLS_PER_S

SLOW_CLOCK_NS = 3600 * 10**9


@pytest.fixture
def harness() -> Iterator[ZenohHarness]:
    made = ZenohHarness()
    yield made
    made.close()


@pytest.fixture
def robot(harness: ZenohHarness) -> Iterator[zenoh.Session]:
    """A robot in another language."""
    session = zenoh.open(session_config(harness.options(), "client").make())
    yield session
    session.close()


def eventually(harness: ZenohHarness, predicate: Callable[[], bool]) -> None:
    assert harness.wait_until(predicate, 5.0)


def attachment(sequence: int) -> bytes:
    return wire.encode("run-1", sequence, time.time_ns() - SLOW_CLOCK_NS // 60)


def test_an_answer_counts_as_said_now_whatever_the_clock_of_the_robot(
    harness: ZenohHarness, robot: zenoh.Session
) -> None:
    listener = Listener(harness).start()
    payload, numbers = json.encode(BeaconHint("engine")), count(2)

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply("beacon/hint/engine", payload, attachment=attachment(next(numbers)))

    robot.declare_queryable("beacon/hint/engine", answer)
    token = robot.liveliness().declare_token("beacon/live/engine/run-1")
    robot.put("beacon/hint/engine", payload, attachment=attachment(1))
    eventually(harness, lambda: listener.has("engine"))
    token.undeclare()
    eventually(harness, lambda: listener.has("engine", Status.STALE))
    back = robot.liveliness().declare_token("beacon/live/engine/run-1")
    eventually(harness, lambda: listener.has("engine"))
    assert listener.tap.calls[-1].sequence >= 2
    assert listener.tap.calls[-1].stamp_ns == 0
    back.undeclare()


def test_a_robot_that_cannot_be_asked_is_asked_three_times_and_then_waited_for(
    harness: ZenohHarness, robot: zenoh.Session
) -> None:
    listener = Listener(harness).start()

    def asked() -> int:
        return listener.source.health().counters["asked"]

    eventually(harness, lambda: asked() == 1)  # everybody, at the start
    token = robot.liveliness().declare_token("beacon/live/engine")
    eventually(harness, lambda: asked() == 4)
    assert not harness.wait_until(lambda: asked() > 4, 0.3)
    robot.put("beacon/hint/engine", b'{"entity_id":"engine"}')
    eventually(harness, lambda: listener.has("engine"))
    token.undeclare()


def test_invented_tokens_make_the_gateway_ask_no_oftener_than_it_may(
    harness: ZenohHarness, robot: zenoh.Session
) -> None:
    """Many tokens of nobody, new ones all the time."""
    listener = Listener(harness).start()
    answers = []

    def answer(query: zenoh.Query) -> None:
        with query:
            answers.append(time.monotonic())

    robot.declare_queryable("beacon/hint/engine", answer)
    live = robot.liveliness()
    began, tokens, rounds = time.monotonic(), [], 0
    while time.monotonic() - began < 3.0:
        rounds += 1
        tokens += [live.declare_token(f"beacon/live/nobody-{rounds}-{n}") for n in range(20)]
        harness.wait_until(lambda: False, 0.03)
    lasted = time.monotonic() - began
    allowed = ROLL_CALLS_AT_ONCE + ROLL_CALLS_PER_S * (lasted + 1.0)
    assert 3 <= len(answers) <= allowed
    counters = listener.source.health().counters
    assert counters["questions-postponed"] > 0
    assert counters["tokens-overlooked"] == 0
    # Nobody is forgotten for it.
    robot.put("beacon/hint/engine", b'{"entity_id":"engine"}')
    eventually(harness, lambda: listener.has("engine"))


def test_many_tokens_make_few_questions(harness: ZenohHarness, robot: zenoh.Session) -> None:
    listener = Listener(harness).start()
    tokens = [robot.liveliness().declare_token(f"beacon/live/part-{n}") for n in range(100)]
    eventually(harness, lambda: listener.source.health().counters["tokens"] == len(tokens))
    eventually(harness, lambda: listener.source.health().counters["asked"] >= 4)
    assert listener.source.health().counters["asked"] < 20
