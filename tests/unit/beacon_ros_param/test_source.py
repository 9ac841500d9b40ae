"""Whom a source asks, what its health says, and how it ends; on real nodes."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to ask")

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events

from beacon_core.clock import SystemClock
from beacon_core.errors import ConfigError
from beacon_core.intake import Intake
from beacon_core.ports.graph import Graph
from beacon_core.ports.health import Condition
from beacon_core.store import HintStore
from beacon_core.wire import json
from beacon_ros.participant import OwnNode
from beacon_ros_param import source as module
from beacon_ros_param.events import EVENTS_TOPIC, runs
from beacon_ros_param.options import RosParamOptions
from beacon_ros_param.source import RosParamSource

if TYPE_CHECKING:
    from tests.unit.beacon_ros_param.conftest import Peers

pytestmark = pytest.mark.system

WaitFor = Callable[..., None]
D = "ros2_medkit.discovery."


class Listening:
    """A source, and what the store made of it."""

    def __init__(self, source: RosParamSource) -> None:
        self.source = source
        self.store = HintStore(SystemClock(), ttl_s=600, expiry_s=6000)
        self.intake = Intake(self.store, json.decode)
        source.start(self.intake)

    def known(self) -> set[str]:
        return {stored.entity_id for stored in self.store.snapshot()}

    def status(self, entity_id: str) -> str:
        stored = self.store.get(entity_id)
        return "" if stored is None else str(stored.status)


Listen = Callable[..., Listening]


@pytest.fixture
def listen(domain_id: int) -> Iterator[Listen]:
    """Starts a source with these options, and closes it in the end."""
    made: list[Listening] = []

    def listen(node: Any = None, apps: frozenset[str] | None = None, **given: Any) -> Listening:
        options = RosParamOptions(**{"domain_id": domain_id, "interval_s": 0.1, **given})
        source = RosParamSource(options, node=node)
        if apps is not None:
            source.set_targets(apps)
        made.append(Listening(source))
        return made[-1]

    yield listen
    for one in made:
        one.source.close()


# Whom it asks


def test_without_targets_it_asks_every_visible_node_of_the_graph(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    peers.new("engine", entity_id="engine")
    peers.new("_hidden", entity_id="hidden")
    peers.new("plain")
    listening = listen()
    wait_for(lambda: listening.known() == {"engine"}, "the visible one is heard")
    wait_for(lambda: listening.source.health().counters["targets"] == 2, "both are asked")
    assert listening.known() == {"engine"}


def test_the_apps_nodes_come_before_the_graph_and_given_targets_before_those(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    for name in ("engine", "brake", "_hidden"):
        peers.new(name, entity_id=name)
    of_apps = listen(apps=frozenset({"/engine", "/not_there"}))
    given = listen(apps=frozenset({"/engine"}), targets=("/_hidden", "/brake"))
    nobody = listen(apps=frozenset())
    wait_for(lambda: of_apps.known() == {"engine"}, "the app's node is heard")
    wait_for(lambda: given.known() == {"_hidden", "brake"}, "the given ones are heard")
    assert not nobody.known()
    assert of_apps.known() == {"engine"}


def test_it_tells_the_nodes_of_the_graph_until_it_is_closed(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    source = listen(interval_s=60.0).source
    assert isinstance(source, Graph)
    node = peers.new("arm_driver")
    wait_for(lambda: "/arm_driver" in source.nodes(), "a node that came is seen")
    peers.remove(node)
    wait_for(lambda: "/arm_driver" not in source.nodes(), "a node that went is seen")
    source.close()
    assert source.nodes() == frozenset()


def test_whom_to_ask_may_change_at_any_time(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    for name in ("engine", "brake"):
        peers.new(name, entity_id=name)
    listening = listen(apps=frozenset({"/engine"}), interval_s=60.0)
    wait_for(lambda: listening.known() == {"engine"}, "the first is heard")
    listening.source.set_targets(frozenset({"/brake"}))
    wait_for(lambda: listening.known() == {"engine", "brake"}, "the second is heard")
    peers.new("light", entity_id="light")
    listening.source.set_targets(None)
    wait_for(lambda: "light" in listening.known(), "all are heard")


def test_a_source_that_joins_a_node_leaves_it_as_it_was_and_does_not_ask_it(
    listen: Listen, peers: Peers, domain_id: int, wait_for: WaitFor
) -> None:
    peers.new("engine", entity_id="engine")
    gateway = peers.new("gateway", entity_id="gateway")
    listening = listen(gateway)
    wait_for(lambda: listening.known() == {"engine"}, "the other node is heard")
    listening.source.close()
    assert not list(gateway.clients)
    assert gateway.get_parameter(D + "entity_id").value == "gateway"
    again = listen(gateway)
    wait_for(lambda: again.known() == {"engine"}, "the node can be joined again")


# What it hears


@pytest.mark.parametrize("parameter_events", [True, False])
def test_a_change_is_heard_and_with_events_without_waiting_for_the_poll(
    listen: Listen, peers: Peers, wait_for: WaitFor, *, parameter_events: bool
) -> None:
    node = peers.new("engine", entity_id="engine", display_name="cold")
    interval_s = 60.0 if parameter_events else 0.2
    listening = listen(interval_s=interval_s, parameter_events=parameter_events)

    def said() -> str:
        stored = listening.store.get("engine")
        return "" if stored is None else stored.hint.display_name

    wait_for(lambda: said() == "cold", "the node is heard")
    peers.spinner.run(lambda: node.set_parameters([Parameter(D + "display_name", value="warm")]))
    wait_for(lambda: said() == "warm", "the change is heard")


@pytest.mark.parametrize("parameter_events", [True, False])
def test_a_node_that_leaves_is_lost_and_one_that_comes_back_is_a_restart(
    listen: Listen, peers: Peers, wait_for: WaitFor, *, parameter_events: bool
) -> None:
    node = peers.new("engine", entity_id="engine")
    listening = listen(parameter_events=parameter_events)
    wait_for(lambda: listening.status("engine") == "active", "the node is heard")
    peers.remove(node)
    wait_for(lambda: listening.status("engine") == "stale", "the node is lost")
    stored = listening.store.get("engine")
    assert stored is not None
    assert stored.detail == "its node left the ROS graph"
    peers.new("engine", entity_id="engine")
    wait_for(lambda: listening.status("engine") == "active", "the node is back")
    stored = listening.store.get("engine")
    assert stored is not None
    assert (stored.restarts, stored.source) == (1, "/engine")


def test_events_of_nodes_that_are_not_there_cost_little(
    listen: Listen, peers: Peers, wait_for: WaitFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[float] = []

    def counted(node: Any) -> dict[str, set[str]]:
        looks.append(time.monotonic())
        return runs(node)

    monkeypatch.setattr(module, "runs", counted)
    forger = peers.new("forger")
    listening = listen()
    publisher = forger.create_publisher(ParameterEvent, EVENTS_TOPIC, qos_profile_parameter_events)
    forged = Parameter(D + "entity_id", value="x").to_parameter_msg()
    event = ParameterEvent(node="/nobody", new_parameters=[forged])

    def flooded() -> bool:
        publisher.publish(event)
        return listening.source.health().counters["events"] >= 300

    wait_for(flooded, "300 events are heard")
    # Names that change are looked at without a pause: of the forger there are two.
    assert len(looks) <= (looks[-1] - looks[0]) / 0.1 + 4


def test_the_sender_is_the_full_name_of_the_node(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    from rclpy.node import Node  # noqa: PLC0415 - the fixture's nodes have no namespace

    node = Node("driver", namespace="/arm/left", context=peers.context)
    node.declare_parameter(D + "entity_id", "driver")
    peers.nodes.append(node)
    peers.spinner.add_node(node)
    listening = listen()
    wait_for(lambda: listening.known() == {"driver"}, "the node is heard")
    assert [report.name for report in listening.intake.sources()] == ["/arm/left/driver"]


# Health


def test_health_names_who_does_not_answer_but_not_all_of_many(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    for number in range(5):
        peers.new(f"n{number}", entity_id=f"n{number}")
    listening = listen(timeout_s=0.2)
    wait_for(lambda: len(listening.known()) == 5, "all are heard")
    release = threading.Event()
    peers.spinner.run(lambda: release.wait(30.0), within_s=0.0)
    wait_for(lambda: "do not answer" in listening.source.health().detail, "that is told")
    wait_for(lambda: listening.source.health().counters["silent"] == 5, "of all")
    health = listening.source.health()
    assert health.condition is Condition.DEGRADED
    assert health.detail.endswith(" and 2 more do not answer")
    assert health.detail.count("/n") == 3
    release.set()
    wait_for(lambda: listening.source.health().condition is Condition.UP, "all answer again")
    assert not listening.source.health().detail


def test_health_names_targets_that_are_not_there(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    listening = listen(targets=("/engine", "/brake"))
    detail = "/engine, /brake are not in the ROS graph"
    wait_for(lambda: listening.source.health().detail == detail, "both are named")
    peers.new("engine", entity_id="engine")
    detail = "/brake is not in the ROS graph"
    wait_for(lambda: listening.source.health().detail == detail, "one is named")


def test_health_names_nodes_that_share_a_name(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    peers.new("twin", entity_id="one")
    peers.new("twin", entity_id="two")
    listening = listen()
    detail = "/twin is the name of several nodes; rename them"
    wait_for(lambda: detail in listening.source.health().detail, "the name is told")


def test_a_budget_that_one_hung_node_uses_up_is_warned_of(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        RosParamSource(RosParamOptions(budget_s=2.0))
        RosParamSource(RosParamOptions(budget_s=2.1))
    (line,) = caplog.messages
    assert line.startswith("budget_s: 2 is not above timeout_s (2)")


# The end


@pytest.mark.filterwarnings("ignore:failed to send response:RuntimeWarning")
def test_close_takes_no_second_whatever_hangs(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    for number in range(10):
        peers.new(f"n{number}", entity_id=f"n{number}")
    listening = listen(timeout_s=30.0)
    wait_for(lambda: len(listening.known()) == 10, "all are heard")
    release = threading.Event()
    peers.spinner.run(lambda: release.wait(30.0), within_s=0.0)
    wait_for(lambda: listening.source.health().counters["in-flight"] == 10, "all hang")
    began = time.monotonic()
    listening.source.close()
    took = time.monotonic() - began
    heard = listening.intake.totals()
    release.set()
    assert took < 1.0
    assert listening.source.health().condition is Condition.CLOSED
    assert peers.spinner.run(lambda: None, within_s=20.0)
    assert listening.intake.totals() == heard


def test_a_sink_that_hangs_does_not_hold_up_close(
    peers: Peers, domain_id: int, wait_for: WaitFor
) -> None:
    entered, release = threading.Event(), threading.Event()

    class Hangs(Intake):
        def offer(self, *args: Any, **envelope: Any) -> Any:
            entered.set()
            release.wait(30.0)
            return super().offer(*args, **envelope)

    peers.new("engine", entity_id="engine")
    source = RosParamSource(RosParamOptions(domain_id=domain_id))
    source.start(Hangs(HintStore(SystemClock()), json.decode))
    assert entered.wait(20.0)
    began = time.monotonic()
    source.close()
    assert time.monotonic() - began < 1.0
    release.set()
    wait_for(lambda: not source._waiter._thread.is_alive(), "its thread ends")  # type: ignore[union-attr]


def test_a_source_whose_context_is_shut_down_says_so(
    listen: Listen, peers: Peers, wait_for: WaitFor
) -> None:
    gateway = peers.new("gateway")
    listening = listen(gateway)
    wait_for(lambda: listening.source.health().condition is Condition.UP, "it is up")
    peers.context.try_shutdown()
    wait_for(lambda: listening.source.health().condition is Condition.DOWN, "it is down")
    detail = "the ROS context was shut down; start the gateway again"
    assert listening.source.health().detail == detail
    listening.source.close()


def test_what_cannot_be_opened_leaves_nothing_behind(domain_id: int) -> None:
    own = OwnNode("closed_node", domain_id)
    own.close()
    source = RosParamSource(RosParamOptions(), node=own.node)
    with pytest.raises(ConfigError, match="node"):
        source.start(Intake(HintStore(SystemClock()), json.decode))
    source.close()


def test_a_forked_child_leaves_the_source_alone(listen: Listen) -> None:
    listening = listen()
    child = os.fork()
    if not child:  # in the child
        listening.source.close()
        os._exit(0 if listening.source.health().condition is Condition.UP else 1)
    deadline = time.monotonic() + 10.0
    while (ended := os.waitpid(child, os.WNOHANG)) == (0, 0) and time.monotonic() < deadline:
        time.sleep(0.01)
    if ended == (0, 0):
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert ended == (child, 0)
