"""From tokens to topics: what concerns a relay, and whose messages they are."""

from __future__ import annotations

import threading
import time
from typing import Any

import attrs
import pytest

from beacon_core.relay.marks import CONDUIT_ROLE, role
from beacon_core.relay.values import Qos, TopicType
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw_relay import topics as module
from beacon_zenoh.rmw_relay.topics import Topics

TEXT = TopicType("std_msgs/msg/String", "RIHS01_1")
RELIABLE = Qos(True, False, 10)
OURS = "0123"


def member(kind: Kind = Kind.PUBLISHER, node: str = "talker", **changes: Any) -> Member:
    whole = Member(kind, 0, "abc", 1, 2, node, type_name=TEXT.name, type_hash=TEXT.digest)
    return attrs.evolve(whole, **{"name": "/t", **changes})


@attrs.define
class Fixture:
    topics: Topics
    news: list[None]

    def come(self, one: Member) -> bytes:
        self.topics.came(token_key(one), one, 0)
        return gid_of(token_key(one))

    def go(self, one: Member) -> None:
        self.topics.went(token_key(one), one, 0)


@pytest.fixture
def it() -> Fixture:
    news: list[None] = []
    return Fixture(Topics(lambda one: one.zid == OURS, lambda: news.append(None)), news)


def test_a_topic_has_those_who_publish_it(it: Fixture) -> None:
    one, two = member(), member(member_id=3)
    it.come(one)
    it.come(two)
    assert it.topics.changed() == {"/t": [one, two]}
    assert it.topics.changed() == {}
    it.go(one)
    assert it.topics.changed() == {"/t": [two]}
    it.go(two)
    assert it.topics.changed() == {"/t": []}
    assert len(it.news) == 4
    it.topics.came_again(token_key(two), 0)
    assert len(it.news) == 4


@pytest.mark.parametrize(
    "one",
    [
        member(Kind.NODE),
        member(Kind.SERVICE),
        member(Kind.CLIENT),
        member(zid=OURS),
        member(name="/turn/_action/feedback"),
        member(name="/add/_service_event"),
        member(node=f"_beacon_{CONDUIT_ROLE}_1_2"),
    ],
    ids=lambda one: f"{one.kind} {one.node_name} {one.name} {one.zid}",
)
def test_what_is_nothing_to_relay_is_none(it: Fixture, one: Member) -> None:
    it.come(one)
    it.go(one)
    assert it.topics.changed() == {}
    assert not it.news


def test_whom_a_publisher_can_reach_is_counted(it: Fixture) -> None:
    assert it.topics.could_have("/t", TEXT, RELIABLE) == 0
    ear = member(Kind.SUBSCRIBER)
    it.come(ear)
    it.come(member(Kind.SUBSCRIBER, member_id=3, type_hash="RIHS01_2"))
    it.come(member(Kind.SUBSCRIBER, member_id=4, zid=OURS))
    assert it.topics.could_have("/t", TEXT, RELIABLE) == 1
    assert it.topics.changed() == {"/t": []}
    assert it.topics.could_have("/t", TEXT, RELIABLE) == 1
    it.go(ear)
    assert it.topics.could_have("/t", TEXT, RELIABLE) == 0


def test_a_relays_messages_are_known_by_their_publishers_node(it: Fixture) -> None:
    relays = member(node=f"_beacon_{role((5, 2))}_abc")
    theirs, plain = it.come(relays), it.come(member())
    assert it.topics.mark(theirs) == (5, 2)
    assert it.topics.mark(plain) == (0, 0)
    it.go(relays)
    assert it.topics.mark(theirs) == (5, 2), "its last messages may come after it has gone"


def test_a_message_that_comes_before_its_publishers_token_waits_for_it(
    it: Fixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_NAMED_WITHIN_S", 10.0)
    relays = member(node=f"_beacon_{role((5, 2))}_abc")
    later = threading.Timer(0.02, lambda: it.come(relays))
    later.start()
    assert it.topics.mark(gid_of(token_key(relays))) == (5, 2)
    later.join()


def test_who_has_no_token_is_waited_for_once_and_a_flood_of_them_not_at_all(it: Fixture) -> None:
    began = time.monotonic()
    for number in range(1000):
        assert it.topics.mark(b"%16d" % number) == (0, 0)
    assert time.monotonic() - began < 50  # to wait for each would take 100 s


def test_so_many_are_remembered_and_no_more(it: Fixture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_MAX_TOKENLESS", 3)
    for number in range(10):
        it.topics.mark(b"%16d" % number)
    assert len(it.topics._tokenless) == 3
