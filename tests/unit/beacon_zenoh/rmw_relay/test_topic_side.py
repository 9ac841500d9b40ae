"""What the topic side over Zenoh does beyond what every one must: sessions that come and go,
marks, stamps, and whoever does not keep to rmw_zenoh's rules."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import attrs
import pytest
import zenoh

from beacon_core.errors import ConfigError, UsageError
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import (
    PeerPublisher,
    Watching,
)
from beacon_core.testing.waiting import wait_until
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw.keys import DataKey, data_key, kept_by
from beacon_zenoh.rmw_relay import RmwNetworkOptions, station, topic_side
from beacon_zenoh.rmw_relay.harness import BYTES, TEXT, Peers, RmwTopicSideHarness, text
from beacon_zenoh.rmw_relay.topic_side import RmwTopicSide

RELIABLE = Qos(reliable=True, durable=False, depth=100)
LATCHED = Qos(reliable=True, durable=True, depth=3)
FIRST, OTHER = 0x1234_5678_9ABC_DEF0, 0xFEDC_BA98_7654_3210

Started = Callable[[], tuple[RmwTopicSide, Watching]]


def eventually(predicate: Callable[[], Any], what: str = "it is so") -> None:
    assert wait_until(predicate, 10.0), what


def said(side: RmwTopicSide, words: str, first: int = FIRST, hop: int = 1) -> bytes:
    payload = text(words)
    side.publish(Publish(1, payload, 0, first, hop))
    return payload


def offered(side: RmwTopicSide, watching: Watching, qos: Qos = RELIABLE, *, to: int = 0) -> None:
    side.create_publisher(CreatePublisher(1, "/t", TEXT, qos, FIRST))
    eventually(lambda: watching.last_match(1) == (to, to), f"{to} have matched")


def hears(peer: PeerPublisher, words: str, heard: object) -> bool:
    """Was something heard before the peer says this?"""
    peer.publish(text(words))
    return bool(heard)


def renewed(side: RmwTopicSide) -> None:
    """Another session takes the place of the first one."""
    before = side._keeper.renewed
    side._keeper.renew()
    eventually(lambda: side._keeper.renewed > before and len(side._stations) > 1)


def restarted(robot: RmwTopicSideHarness) -> None:
    """The router is another one, at the same place."""
    robot.router.close()
    options = ZenohOptions(listen=(robot.endpoint,))
    robot.router = zenoh.open(session_config(options, "router").make())


def test_it_begins_once(robot: RmwTopicSideHarness, started: Started) -> None:
    side, watching = started()
    with pytest.raises(UsageError, match="make a new one"):
        side.start(Watching())
    robot.publisher("/t", TEXT, RELIABLE)
    eventually(lambda: "/t" in watching.topics)
    side.close()
    with pytest.raises(UsageError, match="make a new one"):
        side.start(watching)


def test_where_it_cannot_listen_it_says_so(
    robot: RmwTopicSideHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_zenoh.session._FIRST_ATTEMPT_S", 30.0)
    side = RmwTopicSide(RmwNetworkOptions(mode="router", listen=(robot.endpoint,)))
    with pytest.raises(ConfigError, match="cannot listen"):
        side.start(Watching())
    side.close()


def test_it_can_be_the_router_itself() -> None:
    endpoint = free_endpoint()
    side = RmwTopicSide(RmwNetworkOptions(mode="router", listen=(endpoint,)))
    watching = Watching()
    side.start(watching)
    peers = Peers(endpoint)
    peers.publisher("/t", TEXT, RELIABLE)
    eventually(lambda: "/t" in watching.topics)
    peers.close()
    eventually(lambda: "/t" not in watching.topics)
    side.close()


def test_only_its_own_domain_is_seen(robot: RmwTopicSideHarness, started: Started) -> None:
    _, watching = started()
    other = Peers(robot.endpoint, domain=7)
    other.publisher("/elsewhere", TEXT, RELIABLE)
    robot.publisher("/here", TEXT, RELIABLE)
    eventually(lambda: "/here" in watching.topics)
    assert set(watching.topics) == {"/here"}
    other.close()


def test_the_depth_is_that_of_the_token(robot: RmwTopicSideHarness, started: Started) -> None:
    _, watching = started()
    robot.publisher("/t", TEXT, attrs.evolve(RELIABLE, depth=17))
    eventually(lambda: "/t" in watching.topics)
    assert watching.topics["/t"].qos == Qos(True, False, 17)


# Stamps and numbers


def test_the_original_stamp_goes_on_and_numbers_have_no_gap(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    ear = robot.subscription("/t", TEXT, RELIABLE)
    offered(side, watching, to=1)
    began = time.time_ns()
    for stamp_ns in (0, 12345, -1):
        side.publish(Publish(1, text("x"), stamp_ns, FIRST, 1))
    eventually(lambda: len(ear.received()) == 3)
    now, given, also_now = ear.stamps
    assert given == 12345
    assert began <= now <= also_now
    assert ear.numbers == [1, 2, 3]


def test_each_mark_is_a_publisher_of_its_own_in_the_graph(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    ear = robot.subscription("/t", TEXT, RELIABLE)
    offered(side, watching, to=1)
    for first in (FIRST, OTHER, FIRST):
        said(side, "x", first)
    eventually(lambda: len(ear.received()) == 3)
    assert sorted(ear.numbers) == [1, 1, 2]


def test_marks_beyond_the_most_go_out_under_that_of_the_route(
    robot: RmwTopicSideHarness, started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(station, "MAX_MARKS", 1)
    (speaking, spoken), (hearing, heard) = started(), started()
    speaking.create_publisher(CreatePublisher(2, "/u", TEXT, LATCHED, OTHER))
    offered(speaking, spoken)
    eventually(lambda: "/t" in heard.topics and "/u" in heard.topics)
    hearing.subscribe(Subscribe(1, "/t", TEXT, RELIABLE))
    hearing.subscribe(Subscribe(2, "/u", TEXT, LATCHED))
    eventually(lambda: spoken.last_match(1) == (1, 1) and spoken.last_match(2) == (1, 1))
    said(speaking, "no mark is left")
    for first in (OTHER, FIRST):
        speaking.publish(Publish(2, text(f"{first}"), 0, first, 1))
    eventually(lambda: len(heard.heard) == 3)
    assert {(one.handle, one.first, one.hop) for one in heard.heard} == {(1, 0, 0), (2, OTHER, 1)}
    renewed(speaking)
    late = robot.subscription("/u", TEXT, LATCHED)
    eventually(lambda: len(late.received()) == 2, "it is kept, whatever its mark")


def test_a_latched_publisher_that_has_ended_is_asked_no_more(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    offered(side, watching, LATCHED)
    said(side, "old")
    side.destroy_publisher(1)
    side.create_publisher(CreatePublisher(1, "/t", TEXT, LATCHED, FIRST))
    eventually(lambda: watching.matches[1] == [(0, 0), (0, 0)])
    new = said(side, "new")
    ear = robot.subscription("/t", TEXT, LATCHED)
    eventually(ear.received)
    assert not wait_until(lambda: ear.received() != [new], 0.2)


# Sessions that come and go


def test_another_session_takes_over_and_nothing_is_lost_or_told_twice(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    peer = robot.publisher("/in", TEXT, LATCHED)
    peer.publish(text("in 1"))
    eventually(lambda: "/in" in watching.topics)
    side.subscribe(Subscribe(2, "/in", TEXT, LATCHED))
    ear = robot.subscription("/t", TEXT, LATCHED)
    offered(side, watching, LATCHED, to=1)
    out = [said(side, "out 1"), said(side, "out 2", OTHER)]
    eventually(lambda: watching.payloads(2) == [text("in 1")])
    renewed(side)
    peer.publish(text("in 2"))
    out.append(said(side, "out 3"))
    eventually(lambda: watching.payloads(2) == [text("in 1"), text("in 2")], "it hears on")
    eventually(lambda: ear.received() == out, "it is heard on")
    late = robot.subscription("/t", TEXT, LATCHED)
    eventually(lambda: late.received() == out, "what was kept before is kept")
    assert not wait_until(lambda: len(watching.heard) > 2 or len(ear.received()) > 3, 0.2)
    assert late.received() == out
    assert ("/in", None) not in watching.tellings
    assert not watching.failures


def test_two_relays_whose_sessions_are_both_replaced_repeat_no_state(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    (speaking, spoken), (hearing, heard) = started(), started()
    speaking.create_publisher(CreatePublisher(1, "/t", TEXT, LATCHED, FIRST))
    eventually(lambda: "/t" in heard.topics)
    hearing.subscribe(Subscribe(2, "/t", TEXT, LATCHED))
    eventually(lambda: spoken.last_match(1) == (1, 1))
    said(speaking, "map")
    eventually(lambda: len(heard.heard) == 1)
    renewed(speaking)
    renewed(hearing)
    said(speaking, "new map")
    eventually(lambda: len(heard.heard) == 2)
    assert not wait_until(lambda: len(heard.heard) > 2, 0.2)
    assert [(one.payload, one.first, one.hop) for one in heard.heard] == [
        (text("map"), FIRST, 1),
        (text("new map"), FIRST, 1),
    ]


def test_it_goes_on_when_the_router_has_been_away(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    peer = robot.publisher("/in", TEXT, RELIABLE)
    ear = robot.subscription("/t", TEXT, RELIABLE)
    eventually(lambda: "/in" in watching.topics)
    side.subscribe(Subscribe(2, "/in", TEXT, RELIABLE))
    offered(side, watching, to=1)
    robot.router.close()
    eventually(lambda: "/in" not in watching.topics, "nobody is there")
    eventually(lambda: watching.last_match(1) == (0, 0))
    restarted(robot)
    eventually(lambda: "/in" in watching.topics, "they are back")
    eventually(lambda: watching.last_match(1) == (1, 1))

    def both() -> bool:
        peer.publish(text("in"))
        said(side, "out")
        return bool(watching.payloads(2)) and bool(ear.received())

    eventually(both, "both ways")


def test_state_said_before_there_is_a_router_is_kept_for_who_comes(
    robot: RmwTopicSideHarness,
) -> None:
    endpoint = free_endpoint()
    side, watching = RmwTopicSide(RmwNetworkOptions(connect=(endpoint,))), Watching()
    side.start(watching)
    side.create_publisher(CreatePublisher(1, "/t", TEXT, LATCHED, FIRST))
    side.create_publisher(CreatePublisher(2, "/v", TEXT, RELIABLE, FIRST))
    side.subscribe(Subscribe(3, "/in", TEXT, RELIABLE))
    words = [said(side, f"{number}") for number in range(5)]
    side.publish(Publish(2, text("lost"), 0, FIRST, 1))
    robot.endpoint = endpoint
    restarted(robot)
    ear = robot.subscription("/t", TEXT, LATCHED)
    eventually(lambda: ear.received() == words[-3:])
    eventually(lambda: watching.last_match(1) == (1, 1))
    peer = robot.publisher("/in", TEXT, RELIABLE)
    eventually(lambda: hears(peer, "in", watching.payloads(3)))
    side.close()


def test_a_session_that_is_found_closed_is_no_trouble(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    offered(side, watching, LATCHED)
    side.subscribe(Subscribe(2, "/in", TEXT, RELIABLE))
    side._stations[0].session.close()
    kept = said(side, "kept")
    side.create_publisher(CreatePublisher(3, "/u", TEXT, RELIABLE, FIRST))
    side.unsubscribe(2)
    side.destroy_publisher(3)
    side.subscribe(Subscribe(4, "/in", TEXT, RELIABLE))
    ear = robot.subscription("/t", TEXT, LATCHED)
    eventually(lambda: ear.received() == [kept], "it is said on the next session")
    peer = robot.publisher("/in", TEXT, RELIABLE)
    eventually(lambda: hears(peer, "in", watching.payloads(4)))
    assert not watching.payloads(2)


def test_what_was_said_last_goes_out_though_it_is_closed_at_once(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    ear = robot.subscription("/t", TEXT, RELIABLE)
    offered(side, watching, to=1)
    words = [said(side, f"{number}") for number in range(100)]
    side.close()
    eventually(lambda: ear.received() == words)


# Whoever does not keep to the rules


def test_a_publisher_whose_number_is_not_its_tokens_is_heard(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    side, watching = started()
    peer = robot.peers.publisher("/t", TEXT, RELIABLE)
    eventually(lambda: "/t" in watching.topics)
    side.subscribe(Subscribe(1, "/t", TEXT, RELIABLE))
    peer.gid = b"x" * 16
    eventually(lambda: hears(peer, "x", watching.heard))
    assert (watching.heard[0].first, watching.heard[0].hop) == (0, 0)


def test_a_publisher_without_a_hash_is_carried_as_such(
    robot: RmwTopicSideHarness, started: Started
) -> None:
    """ROS before Iron has none: relays between such robots carry their topics all the same."""
    (hearing, heard), (speaking, spoken) = started(), started()
    of = TopicType("std_msgs/msg/String", "TypeHashNotSupported")
    peer = robot.publisher("/t", of, RELIABLE)
    eventually(lambda: "/t" in heard.topics)
    assert heard.topics["/t"].type == of
    hearing.subscribe(Subscribe(1, "/t", of, RELIABLE))
    eventually(lambda: hears(peer, "x", heard.heard))
    speaking.create_publisher(CreatePublisher(1, "/u", of, RELIABLE, FIRST))
    eventually(lambda: spoken.last_match(1) == (0, 0))


def test_a_name_that_cannot_be_is_refused(started: Started) -> None:
    side, watching = started()
    side.create_publisher(CreatePublisher(1, "no name!", TEXT, RELIABLE, FIRST))
    eventually(lambda: watching.failures)
    assert watching.failures == [(1, "'no name!' is no full name of a topic, such as /chatter")]
    side.subscribe(Subscribe(2, "/t", TopicType("no type", "x"), RELIABLE))
    side.unsubscribe(2)


def test_questions_that_cannot_be_answered_and_too_many_of_them_are_no_trouble(
    robot: RmwTopicSideHarness, started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    side, watching = started()
    offered(side, watching, LATCHED)
    kept = said(side, "kept")
    key = data_key(DataKey(0, "/t", TEXT.name, TEXT.digest))
    ask = partial(robot.peers.session.get, timeout=2.0)
    deaf = ask(kept_by(key).partition("?")[0], target=zenoh.QueryTarget.ALL)
    assert [one for one in deaf if one.ok is not None] == []
    (reply,) = ask(f"{kept_by(key)};_max=1", target=zenoh.QueryTarget.ALL)
    assert reply.ok is not None
    assert reply.ok.payload.to_bytes() == kept
    monkeypatch.setattr(topic_side, "_MAX_QUESTIONS", 0)
    refused = ask(f"{kept_by(key)};_max=1", target=zenoh.QueryTarget.ALL)
    assert [one for one in refused if one.ok is not None] == []


def test_in_a_forked_child_it_does_nothing(
    robot: RmwTopicSideHarness, started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    side, watching = started()
    offered(side, watching)
    monkeypatch.setattr(side._keeper, "_pid", -1)
    said(side, "x")
    side.subscribe(Subscribe(2, "/t", BYTES, RELIABLE))
    side.create_publisher(CreatePublisher(3, "/t", TEXT, RELIABLE, FIRST))
    side.close()
    assert not side._closed
    assert not side._intakes
    assert set(side._offers) == {1}
    monkeypatch.undo()
