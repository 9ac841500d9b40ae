"""What source and announcer promise beside the contract, to nodes as rmw_zenoh makes them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import attrs
import pytest
import zenoh
import zenoh.ext

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.outcome import Verdict
from beacon_core.ports.graph import Graph as GraphPort
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Listener
from beacon_core.testing.harness import within as ends_within
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, farewell
from beacon_zenoh import questions
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.rmw import RmwOptions, attachment
from beacon_zenoh.rmw import announcer as module
from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw.lookalikes import KEEPS, Ear, Robot
from beacon_zenoh.rmw.qos import DEFAULT_QOS
from beacon_zenoh.rmw.session import hint_member, node_member
from beacon_zenoh.rmw.source import RmwTopicSource
from beacon_zenoh.rmw.tokens import Kind, gid_of, token_key

AN_HOUR_S = 3600.0
"""A period in which nothing is repeated: what is seen was kept."""

IN_TIME_S = 2.0

TOPIC = "/ros2_medkit/discovery"


@pytest.fixture
def harness() -> Iterator[RmwHarness]:
    made = RmwHarness()
    yield made
    made.close()


@pytest.fixture
def robots(harness: RmwHarness) -> Iterator[Callable[..., Robot]]:
    made: list[Robot] = []

    def make(*args: Any, **kwargs: Any) -> Robot:
        made.append(Robot(harness.endpoint, *args, **kwargs))
        return made[-1]

    yield make
    for robot in made:
        robot.close()


def within(
    harness: RmwHarness, predicate: Callable[[], bool], what: str, seconds: float = IN_TIME_S
) -> None:
    assert harness.wait_until(predicate, seconds), f"not within {seconds} s: {what}"


def has(listener: Listener, entity_id: str, status: Status = Status.ACTIVE) -> Callable[[], bool]:
    return lambda: listener.has(entity_id, status)


def active(harness: RmwHarness, listener: Listener, *entity_ids: str) -> None:
    for one in entity_ids:
        within(harness, has(listener, one), f"{one} is active")


def graph_of(listener: Listener) -> Graph:
    assert isinstance(listener.source, RmwTopicSource)
    return listener.source.graph


def node_names(listener: Listener) -> list[str]:
    views = graph_of(listener).nodes()
    return [view.node.node_name for view in views if "beacon_" not in view.node.node]


def counters(listener: Listener) -> dict[str, int]:
    return dict(listener.source.health().counters)


def test_a_subscriber_of_rmw_zenoh_hears_what_is_announced_in_order(harness: RmwHarness) -> None:
    ear = Ear(harness.endpoint)
    announcer = harness.announcer()
    names = [f"part-{number}" for number in range(50)]
    for name in names:
        announcer.announce(BeaconHint(name))
    within(harness, lambda: len(ear.heard) >= 50, "all are heard")
    assert ear.names() == names
    assert [number for _, number, _ in ear.heard] == list(range(1, 51))
    ear.close()


def test_the_nodes_it_knows_are_told_by_name(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness)
    source = listener.source
    assert isinstance(source, GraphPort)
    assert source.nodes() == frozenset()
    listener.start()
    robot = robots()
    within(harness, lambda: "/fleet/r1/talker" in source.nodes(), "the node is known")
    robot.close()
    within(harness, lambda: "/fleet/r1/talker" not in source.nodes(), "the node has gone")
    source.close()
    assert source.nodes() == frozenset()


def test_its_gid_is_that_of_the_token(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    ear = Ear(harness.endpoint)
    harness.announcer().announce(BeaconHint("engine"))
    within(harness, lambda: bool(ear.heard), "it is heard")

    def gids() -> list[bytes]:
        views = graph_of(listener).nodes()
        return [gid_of(token_key(one)) for view in views for one in view.of(Kind.PUBLISHER)]

    within(harness, lambda: gids() == [ear.heard[0][0]], "the graph has the same")
    ear.close()


def test_a_subscriber_that_comes_late_is_told_the_present_hint_of_each(
    harness: RmwHarness,
) -> None:
    announcer, listener = harness.announcer(AN_HOUR_S), Listener(harness).start()
    for name in ("gone", "engine", "brake", "engine"):
        announcer.announce(BeaconHint(name))
    within(harness, lambda: listener.has("gone", Status.ACTIVE), "it is heard")
    announcer.withdraw("gone")
    within(harness, lambda: listener.has("gone", Status.LEFT), "all is said")
    late = Ear(harness.endpoint)
    within(harness, lambda: len(late.heard) >= 2, "the present is told")
    assert not harness.wait_until(lambda: len(late.heard) > 2, 0.3)
    assert late.names() == ["brake", "engine"]
    late.close()


def test_a_subscriber_is_told_no_more_than_its_depth(harness: RmwHarness) -> None:
    announcer, listener = harness.announcer(AN_HOUR_S), Listener(harness).start()
    for number in range(5):
        announcer.announce(BeaconHint(f"part-{number}"))
    active(harness, listener, *(f"part-{number}" for number in range(5)))
    late = Ear(harness.endpoint, depth=2)
    within(harness, lambda: len(late.heard) >= 2, "the last are told")
    assert not harness.wait_until(lambda: len(late.heard) > 2, 0.3)
    assert late.names() == ["part-3", "part-4"]
    late.close()


def test_a_subscriber_that_waits_for_publishers_is_told_once_one_comes(
    harness: RmwHarness,
) -> None:
    ear = Ear(harness.endpoint)
    announcer = harness.announcer(AN_HOUR_S)
    announcer.announce(BeaconHint("engine"))
    within(harness, lambda: "engine" in ear.names(), "it is heard")
    ear.close()


def test_a_question_that_wants_no_other_key_gets_no_answer_and_harms_nobody(
    harness: RmwHarness,
) -> None:
    announcer, listener = harness.announcer(), Listener(harness).start()
    announcer.announce(BeaconHint("engine"))
    active(harness, listener, "engine")
    session = zenoh.open(session_config(harness.options(), "client").make())
    assert list(session.get(f"0{TOPIC}/*/*/@adv/**", timeout=1.0)) == []
    announcer.announce(BeaconHint("brake"))
    active(harness, listener, "brake")
    session.close()


def test_volatile_publishers_keep_nothing_and_are_not_asked(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    robot = robots(DEFAULT_QOS)
    robot.say("engine")
    listener = Listener(harness).start()
    within(harness, lambda: counters(listener)["publishers"] == 1, "its publisher is known")
    assert not harness.wait_until(lambda: counters(listener)["asked"] > 0, 0.5)
    robot.say("engine")
    active(harness, listener, "engine")


def test_several_domains_are_heard_at_once_and_others_not(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness)
    options = RmwOptions(connect=(harness.endpoint,), ros_domain_ids=(0, 7))
    listener.source = harness.adapter.source(options)
    listener.start()
    for domain in (0, 7, 8):
        robots(domain=domain).say(f"in-{domain}")
    active(harness, listener, "in-0", "in-7")
    assert listener.status("in-8") is None
    assert {view.node.domain for view in graph_of(listener).nodes()} == {0, 7}
    announcer = RmwTopicAnnouncer(options)
    announcer.announce(BeaconHint("everywhere"))
    active(harness, listener, "everywhere")
    within(
        harness,
        lambda: sum(call.outcome.entity_id == "everywhere" for call in listener.tap.calls) == 2,
        "it is said in both domains",
    )
    announcer.close()
    listener.source.close()


def test_a_node_that_goes_without_its_publishers_is_missed_and_comes_back(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robot = robots()
    robot.say("engine")
    active(harness, listener, "engine")
    within(harness, lambda: node_names(listener) == ["/fleet/r1/talker"], "the graph is right")
    robot.tokens[0].undeclare()
    within(harness, lambda: listener.has("engine", Status.STALE), "engine is stale")
    assert node_names(listener) == []
    robot.tokens[0] = robot.session.liveliness().declare_token(token_key(robot.node))
    active(harness, listener, "engine")
    assert node_names(listener) == ["/fleet/r1/talker"]


def test_a_goodbye_of_a_node_of_ros_is_one(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robot = robots()
    robot.say("engine")
    active(harness, listener, "engine")
    robot.put(farewell("engine"))
    # The end of its node is told by another thread, and must not overtake it.
    within(harness, lambda: listener.has("engine", Status.LEFT), "engine has left")
    robot.close()
    assert not harness.wait_until(lambda: not listener.has("engine", Status.LEFT), 0.3)
    assert counters(listener)["lost"] == 0


def test_another_session_is_taken_without_anybody_being_missed(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robot = robots()
    robot.say("engine", "before")
    active(harness, listener, "engine")
    within(harness, lambda: graph_of(listener).size() == 2, "the graph is right")
    assert isinstance(listener.source, RmwTopicSource)
    listener.source._keeper.renew()
    within(harness, lambda: counters(listener)["renewals"] == 1, "it is renewed")
    robot.say("engine", "meanwhile")
    within(harness, lambda: listener.says("engine", "meanwhile"), "it is heard")
    # Longer than it takes until those are missed whom the new session did not report.
    assert not harness.wait_until(lambda: not listener.has("engine"), 1.3)
    assert graph_of(listener).size() == 2
    assert counters(listener)["lost"] == 0


def test_another_definition_of_the_message_is_heard_and_named(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robots(type_hash="RIHS01_" + "0" * 64).say("engine")
    active(harness, listener, "engine")
    degraded = lambda: listener.source.health().condition is Condition.DEGRADED  # noqa: E731
    within(harness, degraded, "health tells")
    detail = listener.source.health().detail
    assert detail.startswith("/fleet/r1/talker has another definition of the message")
    assert "RIHS01_" + "0" * 64 in detail


def test_another_message_on_the_topic_is_not_heard_and_named(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    made = [robots(type_name="std_msgs/msg/String") for _ in range(5)]
    made[0].say("engine")
    all_named = lambda: listener.source.health().detail.endswith("; and 2 more")  # noqa: E731
    within(harness, all_named, "health tells")
    detail = listener.source.health().detail
    assert "/fleet/r1/talker is not heard: it publishes std_msgs/msg/String" in detail
    assert listener.status("engine") is None
    for robot in made:
        robot.close()
    up = lambda: listener.source.health().condition is Condition.UP  # noqa: E731
    within(harness, up, "health forgets them")


def test_hostile_keys_tokens_and_attachments_are_counted_and_harm_nobody(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robot = robots(DEFAULT_QOS)
    key = robot.key
    put = robot.session.put
    good = cdr.encode(BeaconHint("hostile"))
    for beside in (None, b"", b"\0" * 32, b"\xff" * 33, b"\0" * 5000):
        put(key, good, attachment=beside)
    put(f"{key}x/*", good, attachment=attachment.encode(bytes(16), 1, 1))
    put(key.replace(TYPE_HASH, "§ no hash"), good, attachment=attachment.encode(b"g" * 16, 1, 1))
    declare = robot.session.liveliness().declare_token
    tokens = [declare(f"@ros2_lv/0/{one}") for one in ("x", "§/%/%", "ab/0/0/NN/%/%/a b")]
    tokens.append(declare(token_key(robot.member).replace("/MP/", "/XX/")))
    put(key, b"garbage", attachment=attachment.encode(b"h" * 16, 1, 1))
    robot.say("engine")
    active(harness, listener, "engine")
    within(harness, lambda: counters(listener)["bad-tokens"] == 4, "tokens are counted")
    assert counters(listener)["bad-attachments"] == 5
    assert counters(listener)["bad-keys"] == 1
    assert listener.count(Verdict.MALFORMED) == 1
    assert listener.status("hostile") is None
    for one in tokens:
        one.undeclare()


def test_an_announcer_waits_for_its_router_and_never_for_the_network() -> None:
    endpoint = free_endpoint()
    announcer = RmwTopicAnnouncer(RmwOptions(connect=(endpoint,)), AN_HOUR_S)
    for name in ("first", "second"):
        hint = BeaconHint("engine", display_name=name)
        ends_within(1.0, partial(announcer.announce, hint))
    harness = RmwHarness()
    listener = Listener(harness)
    listener.source = harness.adapter.source(RmwOptions(mode="router", listen=(endpoint,)))
    listener.start()
    within(harness, lambda: listener.says("engine", "second"), "the last word is heard")
    announcer.close()
    listener.source.close()
    harness.close()


def test_a_gateway_may_take_the_place_of_the_nodes_router(harness: RmwHarness) -> None:
    endpoint = free_endpoint()
    listener = Listener(harness)
    listener.source = harness.adapter.source(RmwOptions(mode="router", listen=(endpoint,)))
    listener.start()
    robot, ear = Robot(endpoint), Ear(endpoint)
    robot.say("engine")
    active(harness, listener, "engine")
    # Nodes connect to each other, once they know of each other from the router.
    within(harness, lambda: ear.names() == ["engine"], "the nodes hear each other")
    robot.close()
    within(harness, has(listener, "engine", Status.STALE), "engine is stale")
    ear.close()
    listener.source.close()


def ask(session: zenoh.Session, announcer: RmwTopicAnnouncer, parameters: str) -> int:
    key = announcer._stands[0].topic_key
    selector = f"{key}/@adv/pub/**?_anyke{parameters}"
    none = zenoh.ConsolidationMode.NONE
    return len([one for one in session.get(selector, consolidation=none) if one.ok is not None])


@pytest.mark.parametrize("above", [0, 100])
def test_those_who_keep_their_words_are_asked_together_or_one_by_one(
    harness: RmwHarness, monkeypatch: pytest.MonkeyPatch, above: int
) -> None:
    monkeypatch.setattr(questions, "ASK_ALL_ABOVE", above)
    announcers = [harness.announcer() for _ in range(10)]
    for number, announcer in enumerate(announcers):
        announcer.announce(BeaconHint(f"robot-{number}"))
    early, late = Listener(harness).start(), Listener(harness)
    within(harness, lambda: early.store.size() == 10, "all have spoken", 10.0)
    late.start()
    within(harness, lambda: late.store.size() == 10, "all are known")


def test_who_invents_publishers_does_not_make_us_ask_all_the_time(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    session = zenoh.open(session_config(harness.options(), "client").make())
    node = node_member(0, str(session.zid()), 0, "inventor")
    invented = [hint_member(node, Kind.PUBLISHER, n + 1, TOPIC, KEEPS) for n in range(500)]
    declare = session.liveliness().declare_token
    tokens = [declare(token_key(one)) for one in invented]
    within(harness, lambda: counters(listener)["publishers"] == 500, "they are seen", 10.0)
    assert not harness.wait_until(lambda: counters(listener)["asked"] > 70, 1.5)
    assert counters(listener)["asked"] > 0
    assert counters(listener)["questions-postponed"] > 0
    assert len(tokens) == 500
    session.close()


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
    within(harness, lambda: ask(session, announcer, parameters) == answers, "it happens")
    session.close()


def test_a_flood_of_questions_is_dropped_and_not_kept(
    harness: RmwHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer = harness.announcer()
    assert isinstance(announcer, RmwTopicAnnouncer)
    announcer.announce(BeaconHint("a"))
    session = zenoh.open(session_config(harness.options(), "client").make())
    within(harness, lambda: ask(session, announcer, "") == 1, "it happens")
    monkeypatch.setattr(module, "_MAX_QUESTIONS", 0)
    assert ask(session, announcer, "") == 0
    session.close()


def test_a_second_start_leads_nobody_astray(harness: RmwHarness) -> None:
    first, second = Listener(harness), Listener(harness)
    first.start()
    with pytest.raises(UsageError):
        first.source.start(second.tap)
    harness.announcer().announce(BeaconHint("engine"))
    within(harness, lambda: first.has("engine"), "it happens")
    assert not second.tap.calls


def test_in_a_forked_child_closing_does_nothing(
    harness: RmwHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = harness.source()
    assert isinstance(source, RmwTopicSource)
    monkeypatch.setattr(source._keeper, "_pid", os.getpid() + 1)
    source.close()
    assert not source._gate.is_shut


def test_a_publisher_that_is_there_by_its_token_alone_is_seen_through_on_another_session(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    robot = robots()
    robot.say("engine")
    listener = Listener(harness).start()
    within(harness, lambda: listener.has("engine"), "engine is active")
    source = listener.source
    assert isinstance(source, RmwTopicSource)
    ghost = node_member(0, "dead", 0, "ghost")
    publisher = hint_member(ghost, Kind.PUBLISHER, 1, TOPIC, DEFAULT_QOS)
    old = attrs.evolve(publisher, type_hash="RIHS01_0")
    for member in (ghost, old):
        source.graph.appeared(token_key(member))
        source.came(token_key(member), member, time.monotonic_ns())
    assert source.health().counters["publishers"] == 2
    assert source.health().condition is Condition.DEGRADED
    source._keeper.renew()
    within(harness, lambda: source.health().counters["publishers"] == 1, "one publisher is left")
    within(harness, lambda: source.health().condition is Condition.UP, "nothing is odd any more")
    assert listener.has("engine")
    assert not any(call.kind == "lost" for call in listener.tap.calls)
