"""What source and announcer promise of themselves; the rest is in the contract suite."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import pytest
import zenoh

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.testing.harness import Listener
from beacon_zenoh.config import session_config
from beacon_zenoh.rmw import announcer as module
from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw.source import RmwTopicSource


@pytest.fixture
def harness() -> Iterator[RmwHarness]:
    made = RmwHarness()
    yield made
    made.close()


def eventually(harness: RmwHarness, predicate: Callable[[], bool]) -> None:
    assert harness.wait_until(predicate, 5.0)


def ask(session: zenoh.Session, announcer: RmwTopicAnnouncer, parameters: str) -> int:
    key = announcer._stands[0].topic_key
    selector = f"{key}/@adv/pub/**?_anyke{parameters}"
    none = zenoh.ConsolidationMode.NONE
    return len([one for one in session.get(selector, consolidation=none) if one.ok is not None])


def test_many_that_keep_their_words_are_asked_with_one_question(harness: RmwHarness) -> None:
    announcers = [harness.announcer() for _ in range(20)]
    for number, announcer in enumerate(announcers):
        announcer.announce(BeaconHint(f"robot-{number}"))
    listener = Listener(harness).start()
    eventually(harness, lambda: listener.store.size() == 20)
    assert listener.source.health().counters["asked"] < 5


@pytest.mark.parametrize(
    ("parameters", "answers"), [("", 3), (";_max=2", 2), (";_max=x", 3), (";_max=" + "9" * 20, 3)]
)
def test_a_question_may_say_how_many_answers_it_wants(
    harness: RmwHarness, parameters: str, answers: int
) -> None:
    announcer = harness.announcer()
    assert isinstance(announcer, RmwTopicAnnouncer)
    for name in ("a", "b", "c"):
        announcer.announce(BeaconHint(name))
    session = zenoh.open(session_config(harness.options(), "client").make())
    eventually(harness, lambda: ask(session, announcer, parameters) == answers)
    session.close()


def test_a_flood_of_questions_is_dropped_and_not_kept(
    harness: RmwHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer = harness.announcer()
    assert isinstance(announcer, RmwTopicAnnouncer)
    announcer.announce(BeaconHint("a"))
    session = zenoh.open(session_config(harness.options(), "client").make())
    eventually(harness, lambda: ask(session, announcer, "") == 1)
    monkeypatch.setattr(module, "_MAX_QUESTIONS", 0)
    assert ask(session, announcer, "") == 0
    session.close()


def test_a_second_start_leads_nobody_astray(harness: RmwHarness) -> None:
    first, second = Listener(harness), Listener(harness)
    first.start()
    with pytest.raises(UsageError):
        first.source.start(second.tap)
    harness.announcer().announce(BeaconHint("engine"))
    eventually(harness, lambda: first.has("engine"))
    assert not second.tap.calls


def test_in_a_forked_child_closing_does_nothing(
    harness: RmwHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = harness.source()
    assert isinstance(source, RmwTopicSource)
    monkeypatch.setattr(source._keeper, "_pid", os.getpid() + 1)
    source.close()
    assert not source._gate.is_shut
