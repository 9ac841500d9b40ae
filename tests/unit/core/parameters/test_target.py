"""What a node last answered is kept, and read anew only when it is another."""

from __future__ import annotations

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_core.parameters.target import Poll, Target
from beacon_core.wire import json


def test_an_answer_with_a_hint_gives_its_payload() -> None:
    target = Target("/engine", 0)
    assert not target.learn({ENTITY_ID: "engine"})
    assert (target.hint_id, target.payload) == ("engine", json.encode(BeaconHint("engine")))


def test_an_answer_without_a_hint_takes_it_away() -> None:
    target = Target("/engine", 0)
    target.learn({ENTITY_ID: "engine"})
    target.learn({})
    assert (target.hint_id, target.payload) == ("", b"")


def test_what_is_left_out_is_news_once() -> None:
    target, bad = Target("/engine", 0), {ENTITY_ID: "engine", f"{PREFIX}.colour": "blue"}
    assert len(target.learn(bad)) == 1
    assert target.learn(dict(bad)) == ()
    assert not target.learn({**bad, f"{PREFIX}.hostname": "robot"})
    assert len(target.skipped) == 1


def test_a_poll_that_is_dropped_drops_all_its_questions() -> None:
    dropped: list[str] = []
    poll = Poll(7)
    poll.drops += [lambda: dropped.append("names"), lambda: dropped.append("values")]
    poll.drop()
    assert dropped == ["names", "values"]
