"""Robots that run rmw_zenoh come, go, hang and crash; routers come back; the graph is right.

The robots are made as rmw_zenoh makes its nodes: of the same parts of Zenoh, with its settings.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Listener
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_zenoh import ZenohOptions
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.harness import ProcessAnnouncer, free_endpoint
from beacon_zenoh.rmw import RmwOptions
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw.lookalikes import KEEPS, Robot
from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.source import RmwTopicSource

AN_HOUR_S = 3600.0
"""A period in which nothing is repeated: what is seen was kept."""

IN_TIME_S = 2.0

TOPIC = "/ros2_medkit/discovery"
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


def in_time(
    harness: RmwHarness, predicate: Callable[[], bool], what: str, seconds: float = IN_TIME_S
) -> bool:
    """Did it come to hold in time? A busy machine may hold up one time or another, of which a test
    takes several; but in the end it must hold."""
    if harness.wait_until(predicate, seconds):
        return True
    within(harness, predicate, what, 30.0)
    return False


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


# Ends


def test_kill_9_makes_stale_at_once_and_says_why(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    robot = harness.announcer(AN_HOUR_S, mortal=True)
    assert isinstance(robot, ProcessAnnouncer)
    robot.announce(BeaconHint("engine"))
    within(harness, has(listener, "engine"), "its process is up", 20.0)
    within(harness, lambda: len(graph_of(listener).nodes()) == 2, "the graph is right")
    robot.end(signal.SIGKILL)
    within(harness, lambda: listener.has("engine", Status.STALE), "engine is stale", 1.0)
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.cause is Cause.LOST
    assert stored.detail == "its node left the ROS graph without a goodbye"
    # Each token goes by itself, and it was the publisher's that told.
    within(harness, lambda: len(graph_of(listener).nodes()) == 1, "the node has gone")


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
        within(harness, has(listener, "engine"), "its process is up", 20.0)
        within(harness, lambda: graph_of(listener).size() == 2, "the graph is right")

        def missed_and_back_in_time() -> bool:
            robot.process.send_signal(signal.SIGSTOP)
            missed = [
                in_time(harness, has(listener, "engine", Status.STALE), "engine is stale"),
                in_time(harness, lambda: graph_of(listener).size() == 1, "the graph is right"),
            ]
            robot.process.send_signal(signal.SIGCONT)
            back = [
                in_time(harness, has(listener, "engine"), "engine is active"),
                in_time(harness, lambda: graph_of(listener).size() == 2, "the graph is right"),
            ]
            return all(missed + back)

        assert any(missed_and_back_in_time() for _ in range(3))
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


@pytest.mark.system
def test_a_thousand_nodes_are_known_and_missed_in_time(
    harness: RmwHarness, request: pytest.FixtureRequest
) -> None:
    def fleet() -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            [sys.executable, "-c", FLEET, harness.endpoint, "20", "50"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        request.addfinalizer(process.communicate)
        request.addfinalizer(process.kill)
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        return process

    def known(listener: Listener, count: int) -> Callable[[], bool]:
        """Whether that many nodes are known, each with both its members: each has a token of its
        own, and those of the members come after their node's."""

        def check() -> bool:
            views = graph_of(listener).nodes()
            fleet = [view for view in views if view.node.namespace == "/fleet"]
            return len(fleet) == count and all(len(view.members) == 2 for view in fleet)

        return check

    def renewed(listener: Listener, times: int) -> Callable[[], bool]:
        return lambda: counters(listener)["renewals"] >= times

    early, late = Listener(harness).start(), Listener(harness)
    robots = fleet()
    late.start()
    known_in_time: list[bool] = []
    missed_in_time: list[bool] = []
    for generation in range(1, 5):
        came = [in_time(harness, known(one, 1000), "they are known") for one in (early, late)]
        known_in_time.append(all(came))
        robots.kill()
        robots.communicate()
        left = [in_time(harness, known(one, 0), "they are missed") for one in (early, late)]
        missed_in_time.append(all(left))
        for listener in (early, late):
            # Another session is taken when all is quiet: without, it would take longer each time.
            within(harness, renewed(listener, generation), "the session is renewed", 30.0)
        robots = fleet()
    # A busy machine may hold up one or another. The first were told on a session without a past.
    assert any(known_in_time[1:])
    assert any(missed_in_time[1:])


def test_a_robot_that_is_heard_in_both_dialects_is_one_entity_with_two_sources(
    harness: RmwHarness,
) -> None:
    connect = [harness.endpoint]
    sources = {
        "ros": {"adapter": "zenoh_rmw", "options": {"connect": connect}},
        "native": {"adapter": "zenoh", "options": {"mode": "client", "connect": connect}},
    }
    gateway = Gateway(parse_config({"sources": sources}).config)
    gateway.start()
    hint = BeaconHint("engine", hostname="robot-1", process_id=42, process_name="engine")
    announcers = [
        harness.announcer(),
        ZenohAnnouncer(ZenohOptions(connect=(harness.endpoint,))),
    ]
    for announcer in announcers:
        announcer.announce(hint)

    def heard_by() -> set[str]:
        beacon = gateway.directory.beacon("engine")
        return set() if beacon is None else {view.adapter for view in beacon.views}

    within(harness, lambda: heard_by() == {"zenoh_rmw", "zenoh"}, "both sources know it")
    assert list(gateway.directory.tree().apps) == ["engine"]
    beacon = gateway.directory.beacon("engine")
    assert beacon is not None
    assert not any(view.stored.conflict for view in beacon.views)
    for announcer in announcers:
        announcer.close()
    gateway.close()
