"""Robots that run rmw_zenoh and are asked for their parameters come, hang, crash and come back."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs
import httpx
import pytest
import yaml

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.parameters.fields import write
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Listener
from beacon_zenoh import ZenohOptions
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.harness import ProcessAnnouncer, free_endpoint
from beacon_zenoh.rmw import RmwOptions
from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer
from beacon_zenoh.rmw_param import RmwParamOptions
from beacon_zenoh.rmw_param.harness import RmwParamHarness
from beacon_zenoh.rmw_param.lookalikes import ParamRobot

IN_TIME_S = 2.0

ROUTER = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
print("up", flush=True)
sys.stdin.read()
"""

FLEET = """
import sys
from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import write
from beacon_zenoh.config import session_config
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw_param.lookalikes import ParamRobot
import zenoh
endpoint, first, count = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
robots = []
for number in range(first, first + count):
    session = zenoh.open(session_config(ZenohOptions(connect=(endpoint,)), "client").make())
    robots.append(ParamRobot("", write(BeaconHint(f"part-{number}")), name=f"n{number}",
        namespace="/fleet", session=session))
print("up", flush=True)
sys.stdin.readline()
"""


class Slow(RmwParamHarness):
    """Asks once in a minute, at an endpoint that may be given. Nobody is given up whom a busy
    machine lets answer late."""

    given = ""

    @property
    def endpoint(self) -> str:
        return self.given or super().endpoint

    def options(self, network: int = 0) -> RmwParamOptions:
        return attrs.evolve(
            super().options(network), interval_s=60.0, timeout_s=30.0, budget_s=60.0
        )


@pytest.fixture
def harness() -> Iterator[Slow]:
    made = Slow()
    yield made
    made.close()


def within(
    harness: RmwParamHarness, predicate: Callable[[], object], what: str, seconds: float = IN_TIME_S
) -> None:
    found = harness.wait_until(lambda: bool(predicate()), seconds)
    assert found, f"not within {seconds} s: {what}"


def in_time(
    harness: RmwParamHarness, predicate: Callable[[], bool], what: str, seconds: float = IN_TIME_S
) -> bool:
    """Did it come to hold in time? A busy machine may hold up one time or another, of which a test
    takes several; but in the end it must hold."""
    if harness.wait_until(predicate, seconds):
        return True
    within(harness, predicate, what, 30.0)
    return False


def has(listener: Listener, entity_id: str, status: Status = Status.ACTIVE) -> Callable[[], bool]:
    return lambda: listener.has(entity_id, status)


def cause_of(listener: Listener, entity_id: str) -> tuple[Cause, str]:
    stored = listener.store.get(entity_id)
    assert stored is not None
    return stored.cause, stored.detail


def test_a_robot_that_is_killed_is_missed_at_once(harness: Slow) -> None:
    listener = Listener(harness).start()
    robot = harness.announcer(mortal=True)
    assert isinstance(robot, ProcessAnnouncer)
    robot.announce(BeaconHint("engine"))
    within(harness, has(listener, "engine"), "its process is up", 20.0)
    robot.end(signal.SIGKILL)
    within(harness, has(listener, "engine", Status.STALE), "engine is stale", 1.0)
    assert cause_of(listener, "engine") == (
        Cause.LOST,
        "its node left the ROS graph without a goodbye",
    )


def test_a_robot_that_is_started_again_is_a_restart(harness: Slow) -> None:
    listener = Listener(harness).start()
    first = ParamRobot(harness.endpoint, write(BeaconHint("engine", display_name="first")))
    within(harness, has(listener, "engine"), "engine is known")
    first.close()
    second = ParamRobot(harness.endpoint, write(BeaconHint("engine", display_name="second")))
    within(harness, lambda: listener.says("engine", "second"), "the second is heard")
    stored = listener.store.get("engine")
    assert stored is not None
    assert (stored.status, stored.restarts, stored.conflict) == (Status.ACTIVE, 1, False)
    second.close()


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


def test_a_router_that_comes_back_brings_the_nodes_back(harness: Slow, router: Router) -> None:
    harness.given = router.endpoint
    robot = ParamRobot(router.endpoint, write(BeaconHint("engine")))
    listener = Listener(harness).start()
    within(harness, has(listener, "engine"), "engine is known")
    router.kill()
    within(harness, has(listener, "engine", Status.STALE), "engine is stale")
    assert cause_of(listener, "engine")[1] == (
        "the gateway itself lost its connection to the router"
    )
    assert listener.source.health().condition is Condition.DOWN
    router.start()
    within(harness, has(listener, "engine"), "engine is back")
    assert listener.source.health().condition is Condition.UP
    robot.close()


def test_two_hundred_nodes_are_known_and_missed_in_time(
    harness: Slow, request: pytest.FixtureRequest
) -> None:
    def fleet(first: int) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-c", FLEET, harness.endpoint, str(first), "100"]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        request.addfinalizer(process.communicate)
        request.addfinalizer(process.kill)
        return process

    processes = [fleet(0), fleet(100)]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
    listeners: list[Listener] = []

    def known_in_time() -> bool:
        for one in listeners:
            one.source.close()
        listeners.append(last := Listener(harness).start())
        return in_time(harness, lambda: last.store.stats().active == 200, "all are known", 4.0)

    assert any(known_in_time() for _ in range(3))
    stats = listeners[-1].store.stats
    processes[0].kill()
    half = in_time(harness, lambda: stats().stale == 100, "half of them are missed")
    assert stats().active == 100
    processes[1].kill()
    others = in_time(harness, lambda: stats().stale == 200, "the others, too")
    assert half or others


@pytest.mark.system
def test_a_robot_that_is_heard_in_three_ways_is_one_entity_with_three_sources(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    endpoint = free_endpoint()
    connect = {"connect": [endpoint]}
    sources: dict[str, Any] = {
        "native": {"adapter": "zenoh", "options": {"listen": [endpoint]}},
        "topics": {"adapter": "zenoh_rmw", "options": connect},
        "nodes": {"adapter": "zenoh_rmw_param", "options": {**connect, "interval_s": 0.2}},
    }
    config = tmp_path / "beacon.yaml"
    config.write_text(yaml.safe_dump({"sources": sources, "http": {"port": 0}}))
    command = [sys.executable, "-m", "beacon_gateway", "run", "-c", str(config), "--json"]
    gateway = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    request.addfinalizer(gateway.communicate)
    request.addfinalizer(gateway.kill)
    assert gateway.stdout is not None
    url = yaml.safe_load(gateway.stdout.readline())["url"]
    hint = BeaconHint("engine", hostname="robot-1", process_id=42, process_name="engine")
    announcers: list[Announcer] = [
        ZenohAnnouncer(ZenohOptions(connect=(endpoint,)), 0.5),
        RmwTopicAnnouncer(RmwOptions(connect=(endpoint,)), 0.5),
    ]
    for announcer in announcers:
        announcer.announce(hint)
    robot = ParamRobot(endpoint, write(hint))

    def beacon(what: str = "x-medkit-beacon") -> dict[str, Any]:
        response = httpx.get(f"{url}/api/v1/apps/engine/{what}", timeout=10)
        return dict(response.json()) if response.is_success else {}

    harness = RmwParamHarness()
    within(harness, lambda: len(beacon().get("sources", ())) == 3, "all three know it", 20.0)
    known = beacon()
    assert {one["adapter"] for one in known["sources"]} == {
        source["adapter"] for source in sources.values()
    }
    assert {one["status"] for one in known["sources"]} == {"active"}
    assert not known["conflict"]
    for what in ("x-medkit-topic-beacon", "x-medkit-param-beacon"):
        assert beacon(what)["process_id"] == 42
    apps = httpx.get(f"{url}/api/v1/apps", timeout=10).json()["items"]
    assert [one["id"] for one in apps] == ["engine"]
    robot.close()
    within(
        harness,
        lambda: (
            {one["adapter"]: one["status"] for one in beacon()["sources"]}["zenoh_rmw_param"]
            == "stale"
        ),
        "one of them misses it",
    )
    # A loss is what was seen last, until the next beat of the others.
    within(harness, lambda: beacon()["status"] == "active", "the others still speak")
    for announcer in announcers:
        announcer.close()
    gateway.send_signal(signal.SIGTERM)
    gateway.communicate(timeout=20)
