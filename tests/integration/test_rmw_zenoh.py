"""Robots that run rmw_zenoh come, go, hang and crash; routers come back; the graph is right.

The robots are made as rmw_zenoh makes its nodes: of the same parts of Zenoh, with its settings.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import pytest
import zenoh
import zenoh.ext

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.outcome import Verdict
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Listener
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME, farewell
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import ProcessAnnouncer, free_endpoint
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw import RmwOptions, attachment
from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.qos import DEFAULT_QOS, Qos
from beacon_zenoh.rmw.source import RmwTopicSource
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key

AN_HOUR_S = 3600.0
"""A period in which nothing is repeated: what is seen was kept."""

IN_TIME_S = 2.0

TOPIC = "/ros2_medkit/discovery"
KEEPS = Qos(durability=1, depth=5)
SHORT_LEASE = {"transport": {"link": {"tx": {"lease": 600}}}}

ROUTER = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
print("up", flush=True)
sys.stdin.read()
"""

FLEET = """
import sys, attrs, zenoh
from beacon_zenoh import ZenohOptions
from beacon_zenoh.config import session_config
from beacon_zenoh.rmw.tokens import Kind, Member, token_key
endpoint, sessions, nodes = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
tokens = []
for number in range(sessions):
    config = session_config(ZenohOptions(connect=(endpoint,)), "client")
    session = zenoh.open(config.make())
    zid = str(session.zid())
    for one in range(nodes):
        node = Member(Kind.NODE, 0, zid, 3 * one, 3 * one, f"node_{number}_{one}", "/fleet")
        topic = attrs.evolve(node, kind=Kind.PUBLISHER, member_id=3 * one + 1, name="/rosout",
            type_name="rcl_interfaces/msg/Log", type_hash="RIHS01_0")
        service = attrs.evolve(topic, kind=Kind.SERVICE, member_id=3 * one + 2,
            name=f"/fleet/node_{number}_{one}/get_parameters",
            type_name="rcl_interfaces/srv/GetParameters")
        for member in (node, topic, service):
            tokens.append(session.liveliness().declare_token(token_key(member)))
    tokens.append(session)
print("up", flush=True)
sys.stdin.readline()
"""


class Robot:
    """A node with a publisher of hints, as rmw_zenoh makes them."""

    def __init__(
        self,
        endpoint: str,
        qos: Qos = KEEPS,
        *,
        domain: int = 0,
        type_name: str = TYPE_NAME,
        type_hash: str = TYPE_HASH,
    ) -> None:
        config = session_config(
            ZenohOptions(connect=(endpoint,), config={"timestamping": {"enabled": True}}), "client"
        )
        self.session = zenoh.open(config.make())
        zid = str(self.session.zid())
        self.node = Member(Kind.NODE, domain, zid, 0, 0, "talker", "/fleet/r1")
        self.member = attrs.evolve(
            self.node,
            kind=Kind.PUBLISHER,
            member_id=10,
            name=TOPIC,
            type_name=type_name,
            type_hash=type_hash,
            qos=qos,
        )
        self.key = data_key(self.member.data_key)
        self.gid = gid_of(token_key(self.member))
        self.sequence = 0
        self.publisher: Any = self._publisher(qos)
        declare = self.session.liveliness().declare_token
        self.tokens = [declare(token_key(one)) for one in (self.node, self.member)]

    def _publisher(self, qos: Qos) -> Any:
        if not qos.keeps:
            return self.session.declare_publisher(self.key)
        return zenoh.ext.declare_advanced_publisher(
            self.session,
            self.key,
            cache=zenoh.ext.CacheConfig(max_samples=qos.depth),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=0.5
            ),
            publisher_detection=True,
        )

    def say(self, entity_id: str, display_name: str = "") -> None:
        self.put(cdr.encode(BeaconHint(entity_id, display_name=display_name)))

    def put(self, payload: bytes) -> None:
        self.sequence += 1
        beside = attachment.encode(self.gid, self.sequence, time.time_ns())
        self.publisher.put(payload, attachment=beside)

    def close(self) -> None:
        self.session.close()


class Ear:
    """A transient-local subscriber, as rmw_zenoh makes it: takes nothing without attachment."""

    def __init__(self, endpoint: str, depth: int = 10) -> None:
        self.session = zenoh.open(
            session_config(ZenohOptions(connect=(endpoint,)), "client").make()
        )
        self.heard: list[tuple[bytes, int, BeaconHint]] = []
        key = f"0{TOPIC}/ros2_medkit_msgs::msg::dds_::MedkitDiscoveryHint_/{TYPE_HASH}"
        self.subscriber = zenoh.ext.declare_advanced_subscriber(
            self.session,
            key,
            self._take,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=depth),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            subscriber_detection=True,
        )

    def _take(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        beside = sample.attachment.to_bytes()
        assert len(beside) == 33
        envelope = attachment.decode(beside)
        read = cdr.decode(sample.payload.to_bytes())
        assert envelope is not None
        assert isinstance(read, Announcement)
        self.heard.append((envelope[0], envelope[1], read.hint))

    def names(self) -> list[str]:
        return [hint.entity_id for _, _, hint in self.heard]

    def close(self) -> None:
        self.session.close()


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


# What rmw_zenoh's subscribers hear of ours


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


def test_its_gid_is_that_of_the_token(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    ear = Ear(harness.endpoint)
    harness.announcer().announce(BeaconHint("engine"))
    within(harness, lambda: bool(ear.heard), "it is heard")
    within(harness, lambda: graph_of(listener).size() >= 2, "the graph is known")
    publishers = [one for view in graph_of(listener).nodes() for one in view.of(Kind.PUBLISHER)]
    assert [gid_of(token_key(one)) for one in publishers] == [ear.heard[0][0]]
    ear.close()


def test_a_subscriber_that_comes_late_is_told_the_present_hint_of_each(
    harness: RmwHarness,
) -> None:
    announcer, listener = harness.announcer(AN_HOUR_S), Listener(harness).start()
    for name in ("gone", "engine", "brake", "engine"):
        announcer.announce(BeaconHint(name))
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


# Gateway and robots in any order


def test_a_gateway_that_starts_before_its_robots_knows_them(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    listener = Listener(harness).start()
    robots().say("engine")
    active(harness, listener, "engine")
    within(harness, lambda: node_names(listener) == ["/fleet/r1/talker"], "the graph is right")


@pytest.mark.parametrize("qos", [KEEPS, attrs.evolve(KEEPS, reliability=2)])
def test_a_gateway_that_starts_after_its_robots_is_told_what_they_keep(
    harness: RmwHarness, robots: Callable[..., Robot], qos: Qos
) -> None:
    robot = robots(qos)
    robot.say("engine", "first")
    robot.say("engine", "second")
    listener = Listener(harness).start()
    within(harness, lambda: listener.says("engine", "second"), "engine is known")
    assert listener.has("engine")
    within(harness, lambda: node_names(listener) == ["/fleet/r1/talker"], "the graph is right")


def test_a_gateway_that_starts_with_its_robots_knows_all_of_them(
    harness: RmwHarness, robots: Callable[..., Robot]
) -> None:
    for number in range(5):
        robots().say(f"before-{number}")
    listener = Listener(harness).start()
    for number in range(5):
        robots().say(f"after-{number}")
    within(harness, lambda: listener.store.stats().active == 10, "all are known")
    within(harness, lambda: len(node_names(listener)) == 10, "the graph is right")


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


# Ends


def test_kill_9_makes_stale_at_once_and_says_why(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    robot = harness.announcer(AN_HOUR_S, mortal=True)
    assert isinstance(robot, ProcessAnnouncer)
    robot.announce(BeaconHint("engine"))
    active(harness, listener, "engine")
    within(harness, lambda: len(graph_of(listener).nodes()) == 2, "the graph is right")
    robot.end(signal.SIGKILL)
    within(harness, lambda: listener.has("engine", Status.STALE), "engine is stale", 1.0)
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.cause is Cause.LOST
    assert stored.detail == "its node left the ROS graph without a goodbye"
    assert len(graph_of(listener).nodes()) == 1


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
    robot.close()
    within(harness, lambda: listener.has("engine", Status.LEFT), "engine has left")
    assert not harness.wait_until(lambda: not listener.has("engine", Status.LEFT), 0.3)
    assert counters(listener)["lost"] == 0


def test_who_hangs_is_missed_after_the_lease_and_back_when_it_goes_on() -> None:
    class Hasty(RmwHarness):
        def options(self, network: int = 0) -> RmwOptions:
            return attrs.evolve(super().options(network), config=SHORT_LEASE)

    harness = Hasty()
    try:
        listener = Listener(harness).start()
        robot = harness.announcer(AN_HOUR_S, mortal=True)
        assert isinstance(robot, ProcessAnnouncer)
        robot.announce(BeaconHint("engine"))
        active(harness, listener, "engine")
        within(harness, lambda: graph_of(listener).size() == 2, "the graph is right")
        robot.process.send_signal(signal.SIGSTOP)
        within(harness, lambda: listener.has("engine", Status.STALE), "engine is stale")
        within(harness, lambda: graph_of(listener).size() == 1, "the graph is right")
        robot.process.send_signal(signal.SIGCONT)
        active(harness, listener, "engine")
        within(harness, lambda: graph_of(listener).size() == 2, "the graph is right")
    finally:
        harness.close()


class Router:
    """A router in a process of its own."""

    def __init__(self) -> None:
        self.endpoint = free_endpoint()
        self.start()

    def start(self) -> None:
        config = f'{{mode: "router", listen: {{endpoints: ["{self.endpoint}"]}}, scouting: {{multicast: {{enabled: false}}, delay: 0}}}}'  # noqa: E501
        self.process = subprocess.Popen(
            [sys.executable, "-c", ROUTER, config], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == b"up\n"

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def router() -> Iterator[Router]:
    made = Router()
    yield made
    made.kill()


def test_a_router_that_comes_back_brings_graph_and_hints_back(router: Router) -> None:
    class Behind(RmwHarness):
        @property
        def endpoint(self) -> str:
            return router.endpoint

    harness = Behind()
    robot = Robot(router.endpoint)
    try:
        listener = Listener(harness).start()
        harness.announcer(AN_HOUR_S).announce(BeaconHint("ours"))
        robot.say("theirs", "first")
        robot.say("theirs", "second")
        active(harness, listener, "ours", "theirs")
        within(harness, lambda: graph_of(listener).size() == 3, "the graph is right")
        router.kill()
        for one in ("ours", "theirs"):
            within(harness, has(listener, one, Status.STALE), f"{one} is stale")
        stored = listener.store.get("theirs")
        assert stored is not None
        assert stored.detail == "the gateway itself lost its connection to the router"
        assert listener.source.health().condition is Condition.DOWN
        within(harness, lambda: graph_of(listener).size() <= 1, "the graph is right")
        router.start()
        active(harness, listener, "ours", "theirs")
        within(harness, lambda: graph_of(listener).size() == 3, "the graph is right")
        assert listener.says("theirs", "second")
        assert listener.source.health().condition is Condition.UP
    finally:
        robot.close()
        harness.close()


def test_a_thousand_nodes_are_known_and_missed_in_time(harness: RmwHarness) -> None:
    def fleet() -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-c", FLEET, harness.endpoint, "20", "50"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        return process

    def nodes(listener: Listener, count: int) -> Callable[[], bool]:
        return lambda: graph_of(listener).size() - 2 == count  # but for our own

    def renewed(listener: Listener, times: int) -> Callable[[], bool]:
        return lambda: counters(listener)["renewals"] == times

    early, late = Listener(harness).start(), Listener(harness)
    robots = fleet()
    late.start()
    for generation in range(1, 5):
        for listener in (early, late):
            within(harness, nodes(listener, 1000), "they are known")
        views = [view for view in graph_of(late).nodes() if view.node.namespace == "/fleet"]
        assert len(views) == 1000
        assert all(len(view.members) == 2 for view in views)
        robots.kill()
        robots.communicate()
        for listener in (early, late):
            within(harness, nodes(listener, 0), "they are missed")
            # Another session is taken when all is quiet: without, it would take longer each time.
            within(harness, renewed(listener, generation), "the session is renewed", 5.0)
        robots = fleet()
    robots.kill()
    robots.communicate()


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


# What is odd, and what is hostile


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
    began = time.monotonic()
    announcer.announce(BeaconHint("engine", display_name="first"))
    announcer.announce(BeaconHint("engine", display_name="second"))
    assert time.monotonic() - began < 0.1
    harness = RmwHarness()
    listener = Listener(harness)
    listener.source = harness.adapter.source(RmwOptions(mode="router", listen=(endpoint,)))
    listener.start()
    within(harness, lambda: listener.says("engine", "second"), "the last word is heard")
    announcer.close()
    listener.source.close()
    harness.close()
