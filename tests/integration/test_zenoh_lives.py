"""Real announcer processes come, go, hang and crash; routers and gateways come back.

Each test says in how much time the gateway must know.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Harness, Listener
from beacon_core.testing.harness import within as ends_within
from beacon_zenoh import ADAPTER, ZenohOptions
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.harness import OwnRouterHarness, ProcessAnnouncer, ZenohHarness, free_endpoint
from beacon_zenoh.options import Mode

AN_HOUR_S = 3600.0
"""A period in which nothing is repeated: what is seen was asked for."""

SHORT_LEASE = {"transport": {"link": {"tx": {"lease": 600}}}}

ROUTER = """
import sys, zenoh
session = zenoh.open(zenoh.Config.from_json5(sys.argv[1]))
print("up", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def harness() -> Iterator[OwnRouterHarness]:
    """The gateway is the router."""
    made = OwnRouterHarness()
    yield made
    made.close()


def within(harness: Harness, seconds: float, predicate: Callable[[], bool], what: str) -> None:
    assert harness.wait_until(predicate, seconds), f"not within {seconds} s: {what}"


def in_time(harness: Harness, seconds: float, predicate: Callable[[], bool], what: str) -> bool:
    """Did it come to hold in time? A busy machine may hold up one time or another, of which a test
    takes several; but in the end it must hold."""
    if harness.wait_until(predicate, seconds):
        return True
    within(harness, 30.0, predicate, what)
    return False


def active(harness: Harness, listener: Listener, entity_id: str, seconds: float = 30.0) -> None:
    within(harness, seconds, lambda: listener.has(entity_id), f"{entity_id} is active")


def mortal(harness: ZenohHarness, entity_id: str) -> ProcessAnnouncer:
    announcer = harness.announcer(AN_HOUR_S, mortal=True)
    assert isinstance(announcer, ProcessAnnouncer)
    announcer.announce(BeaconHint(entity_id))
    return announcer


def test_kill_9_makes_stale_within_a_second_and_says_why(harness: OwnRouterHarness) -> None:
    listener = Listener(harness).start()
    robot = mortal(harness, "engine")
    active(harness, listener, "engine")
    robot.end(signal.SIGKILL)
    within(harness, 1.0, lambda: listener.has("engine", Status.STALE), "engine is stale")
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.cause is Cause.LOST
    assert stored.detail == "its connection ended without a goodbye"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_announcer_has_left_within_a_second(
    harness: OwnRouterHarness, number: signal.Signals
) -> None:
    listener = Listener(harness).start()
    robot = mortal(harness, "engine")
    active(harness, listener, "engine")
    assert robot.end(number) == 0
    within(harness, 1.0, lambda: listener.has("engine", Status.LEFT), "engine has left")
    kinds = [call.kind for call in listener.tap.calls if call.kind != "offer"]
    # On a busy machine the end of its connection may be told first, by another thread.
    assert kinds in (["goodbye"], ["lost", "goodbye"])


def test_who_ends_without_close_has_vanished_and_ends_at_once(harness: OwnRouterHarness) -> None:
    listener = Listener(harness).start()
    robot = mortal(harness, "engine")
    active(harness, listener, "engine")
    began = time.monotonic()
    assert robot.end(None) == 0
    assert time.monotonic() - began < 2.0
    within(harness, 1.0, lambda: listener.has("engine", Status.STALE), "engine is stale")


def test_who_hangs_is_stale_after_the_lease_and_active_again_when_it_goes_on() -> None:
    class Hasty(OwnRouterHarness):
        def options(self, network: int = 0) -> ZenohOptions:
            connect = super().options(network).connect
            return ZenohOptions(mode="client", connect=connect, config=SHORT_LEASE)

    harness = Hasty()
    try:
        listener = Listener(harness).start()
        robot = mortal(harness, "engine")
        active(harness, listener, "engine")

        def missed_and_back_in_time() -> bool:
            stale = lambda: listener.has("engine", Status.STALE)  # noqa: E731
            robot.process.send_signal(signal.SIGSTOP)
            missed = in_time(harness, 2.0, stale, "engine is stale")
            robot.process.send_signal(signal.SIGCONT)
            back = in_time(harness, 2.0, lambda: listener.has("engine"), "engine is active")
            return missed and back

        assert any(missed_and_back_in_time() for _ in range(3))
    finally:
        harness.close()


def test_a_gateway_that_comes_back_knows_everybody_within_a_second(
    harness: OwnRouterHarness,
) -> None:
    first = Listener(harness).start()
    robots = [ZenohAnnouncer(harness.options(), AN_HOUR_S) for _ in range(5)]
    for number, robot in enumerate(robots):
        robot.announce(BeaconHint(f"robot-{number}"))
    within(harness, 10.0, lambda: first.store.size() == 5, "all are known")
    gateways = [first]

    def back_in_time() -> bool:
        gateways[-1].source.close()
        down = lambda: all(one.health().condition is Condition.DOWN for one in robots)  # noqa: E731
        within(harness, 1.0, down, "the robots notice")
        gateways.append(second := Listener(harness).start())
        return in_time(harness, 1.0, lambda: second.store.size() == 5, "all are known again")

    assert any(back_in_time() for _ in range(3))
    for robot in robots:
        robot.close()


def test_an_announcer_waits_for_its_gateway_and_never_for_the_network(
    harness: OwnRouterHarness,
) -> None:
    announcer = harness.announcer(AN_HOUR_S)
    for hint in (
        BeaconHint("engine", display_name="first"),
        BeaconHint("engine", display_name="second"),
        BeaconHint("brake"),
    ):
        ends_within(1.0, partial(announcer.announce, hint))
    ends_within(1.0, partial(announcer.withdraw, "brake"))
    listener = Listener(harness).start()
    within(harness, 1.5, lambda: listener.says("engine", "second"), "the last word is heard")
    assert listener.status("brake") is None


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


def test_a_router_that_crashes_and_comes_back_costs_less_than_a_second(router: Router) -> None:
    class Behind(ZenohHarness):
        def options(self, network: int = 0) -> ZenohOptions:
            return ZenohOptions(mode="client", connect=(router.endpoint,))

    harness = Behind()
    try:
        listener = Listener(harness).start()
        harness.announcer(AN_HOUR_S).announce(BeaconHint("engine"))
        active(harness, listener, "engine")

        def back_in_time() -> bool:
            router.kill()
            within(harness, 1.0, lambda: listener.has("engine", Status.STALE), "engine is stale")
            stored = listener.store.get("engine")
            assert stored is not None
            assert stored.detail == "the gateway itself lost its connection to the router"
            health = listener.source.health()
            assert health.condition is Condition.DOWN
            assert router.endpoint in health.detail
            router.start()
            back = in_time(harness, 1.0, lambda: listener.has("engine"), "engine is active")
            assert listener.source.health().condition is Condition.UP
            return back

        assert any(back_in_time() for _ in range(3))
    finally:
        harness.close()


def test_a_client_source_starts_without_its_router_and_says_so() -> None:
    endpoint = free_endpoint()
    source = ADAPTER.source(ZenohOptions(mode="client", connect=(endpoint,)))
    harness = ZenohHarness()
    listener = Listener(harness)
    began = time.monotonic()
    source.start(listener.tap)
    assert time.monotonic() - began < 1.0
    health = source.health()
    assert health.condition is Condition.STARTING
    assert endpoint in health.detail
    router = ADAPTER.source(ZenohOptions(listen=(endpoint,)))
    router.start(listener.tap)
    up = lambda: source.health().condition is Condition.UP  # noqa: E731
    within(harness, 1.0, up, "the source is up")
    source.close()
    router.close()


@pytest.mark.parametrize("mode", ["peer", "client"])
def test_a_peer_hears_who_connects_to_it(mode: Mode) -> None:
    harness = ZenohHarness()
    try:
        listener = Listener(harness)
        endpoint = free_endpoint()
        listener.source = ADAPTER.source(ZenohOptions(mode="peer", listen=(endpoint,)))
        listener.start()
        announcer = ZenohAnnouncer(ZenohOptions(mode=mode, connect=(endpoint,)), AN_HOUR_S)
        announcer.announce(BeaconHint("engine"))
        active(harness, listener, "engine", 2.0)
        announcer.close()
        within(harness, 1.0, lambda: listener.has("engine", Status.LEFT), "engine has left")
        listener.source.close()
    finally:
        harness.close()


def test_a_client_with_two_routers_goes_to_the_other_when_one_fails() -> None:
    one, other = Router(), Router()
    endpoints = (one.endpoint, other.endpoint)

    class Behind(ZenohHarness):
        def options(self, network: int = 0) -> ZenohOptions:
            return ZenohOptions(mode="client", connect=endpoints)

    harness = Behind()
    try:
        listener = Listener(harness).start()
        harness.announcer(AN_HOUR_S).announce(BeaconHint("engine"))
        active(harness, listener, "engine")
        one.kill()
        other_is_used = lambda: listener.source.health().condition is Condition.UP  # noqa: E731
        within(harness, 1.0, other_is_used, "the source is up")
        active(harness, listener, "engine", 1.0)
    finally:
        harness.close()
        one.kill()
        other.kill()


def test_a_child_of_a_fork_is_told_to_make_its_own_announcer(harness: OwnRouterHarness) -> None:
    script = f"""
import os, sys
from beacon_core.clock import SystemClock
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.store import HintStore
from beacon_zenoh import ADAPTER, ZenohOptions
announcer = ADAPTER.announcer(ZenohOptions(connect={harness.options().connect!r}), None)
source = ADAPTER.source(ZenohOptions(mode="client", connect={harness.options().connect!r}))
source.start(Intake(HintStore(SystemClock()), ADAPTER.decode))
announcer._lock.acquire()  # as another thread may at the moment of the fork
source._gate.acquire()
child = os.fork()
if child == 0:
    try:
        announcer.announce(BeaconHint("engine"))
    except UsageError as error:
        print(error, flush=True)
    announcer.withdraw("engine")
    announcer.close()
    source.close()
    sys.exit(0)
announcer._lock.release()
source._gate.release()
source.close()
print("exit code", os.waitpid(child, 0)[1], flush=True)
announcer.close()
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", script], capture_output=True, timeout=20, check=True
    )
    assert done.stdout.decode().splitlines() == [
        "announce: made before a fork; make an announcer in the child",
        "exit code 0",
    ]
