"""An announcer is asked: it gives each entity a node, and notices who asks."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to ask")

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import PREFIX
from beacon_core.ports.health import Condition
from beacon_ros.graph import node_names
from beacon_ros.participant import OwnNode
from beacon_ros.spinner import Spinner
from beacon_ros_param.announcer import RosParamAnnouncer
from beacon_ros_param.clients import RosClients
from beacon_ros_param.options import RosParamOptions

if TYPE_CHECKING:
    from beacon_core.ports.asking import NodeClient

WaitFor = Callable[..., None]
AnswerTo = Callable[[Any], Any]


@pytest.fixture
def announcer(domain_id: int) -> Iterator[RosParamAnnouncer]:
    made = RosParamAnnouncer(RosParamOptions(domain_id=domain_id, interval_s=0.1))
    yield made
    made.close()


@pytest.fixture
def patient(domain_id: int) -> Iterator[RosParamAnnouncer]:
    """One that does not clear away nodes during a test: it keeps them for two intervals."""
    made = RosParamAnnouncer(RosParamOptions(domain_id=domain_id, interval_s=60.0))
    yield made
    made.close()


class Asker:
    """Asks the announcer's nodes, when told."""

    def __init__(self, domain_id: int, answer_to: AnswerTo) -> None:
        self._answer_to = answer_to
        self.own = OwnNode("asking_test", domain_id)
        self.spinner = Spinner(self.own.context, self.own.node)
        self.clients: dict[str, NodeClient] = {}

    def nodes(self) -> list[str]:
        return [name for name in node_names(self.own.node) if name.startswith("/beacon_param_")]

    def ask(self, name: str, wait_for: WaitFor) -> list[str]:
        client = self.clients.setdefault(name, RosClients(self.own.node)(name))
        wait_for(client.ready, "the services are found")
        return list(self._answer_to(client.list_names))

    def close(self) -> None:
        assert self.spinner.close(20.0)
        self.own.close()


def calling(client: Client, request: Any) -> Callable[[Callable[[Any], None]], None]:
    """What asks a service, for ``answer_to``."""

    def ask(done: Callable[[Any], None]) -> None:
        client.call_async(request).add_done_callback(lambda future: done(future.result()))

    return ask


@pytest.fixture
def asker(domain_id: int, answer_to: AnswerTo) -> Iterator[Asker]:
    made = Asker(domain_id, answer_to)
    yield made
    made.close()


@pytest.mark.parametrize("period_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_that_is_none_is_refused_though_it_has_no_meaning(period_s: float) -> None:
    with pytest.raises(ConfigError, match="period_s"):
        RosParamAnnouncer(RosParamOptions(), period_s)


def test_an_id_that_is_none_is_a_mistake_of_the_caller(announcer: RosParamAnnouncer) -> None:
    with pytest.raises(UsageError, match="entity_id"):
        announcer.announce(BeaconHint("no id"))


def test_each_entity_has_a_visible_node_of_its_own(
    announcer: RosParamAnnouncer, asker: Asker, wait_for: WaitFor
) -> None:
    for name in ("engine", "brake", "engine"):
        announcer.announce(BeaconHint(name))
    wait_for(lambda: len(asker.nodes()) == 2, "two nodes are there")
    assert announcer.health().counters["entities"] == 2


def test_a_node_answers_what_a_source_asks_and_nothing_else(
    announcer: RosParamAnnouncer, asker: Asker, wait_for: WaitFor, answer_to: AnswerTo
) -> None:
    announcer.announce(BeaconHint("engine", display_name="Engine"))
    wait_for(asker.nodes, "the node is there")
    (name,) = asker.nodes()
    assert asker.ask(name, wait_for) == [f"{PREFIX}.display_name", f"{PREFIX}.entity_id"]
    get = asker.own.node.create_client(GetParameters, f"{name}/get_parameters")
    wait_for(get.service_is_ready, "the service is found")
    for wanted, count in (([f"{PREFIX}.entity_id"], 1), (["nothing"], 0)):
        answer = answer_to(calling(get, GetParameters.Request(names=wanted)))
        assert len(answer.values) == count
    everything = asker.own.node.create_client(ListParameters, f"{name}/list_parameters")
    answer = answer_to(calling(everything, ListParameters.Request()))
    assert "use_sim_time" in answer.result.names
    services = dict(asker.own.node.get_service_names_and_types_by_node(name[1:], "/"))
    assert set(services) == {f"{name}/get_parameters", f"{name}/list_parameters"}


def test_who_is_withdrawn_is_still_there_to_be_asked_and_comes_back_on_the_same_node(
    patient: RosParamAnnouncer, asker: Asker, wait_for: WaitFor
) -> None:
    patient.announce(BeaconHint("engine"))
    wait_for(asker.nodes, "the node is there")
    (name,) = asker.nodes()
    patient.withdraw("engine")
    patient.withdraw("engine")
    assert patient.health().counters["entities"] == 0
    assert asker.ask(name, wait_for) == []
    patient.announce(BeaconHint("engine"))
    assert asker.ask(name, wait_for) == [f"{PREFIX}.entity_id"]
    assert asker.nodes() == [name]


def test_nodes_of_who_was_withdrawn_long_ago_are_cleared_away(
    announcer: RosParamAnnouncer, asker: Asker, wait_for: WaitFor
) -> None:
    announcer.announce(BeaconHint("engine"))
    announcer.withdraw("engine")
    time.sleep(0.25)  # twice the interval, and a little
    announcer.announce(BeaconHint("brake"))
    wait_for(lambda: len(asker.nodes()) == 1, "the first node is gone")


def test_an_announcer_is_up_while_somebody_asks_and_else_says_that_nobody_does(
    announcer: RosParamAnnouncer,
    asker: Asker,
    wait_for: WaitFor,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert announcer.health().condition is Condition.UP
    announcer.announce(BeaconHint("engine"))
    wait_for(asker.nodes, "the node is there")
    (name,) = asker.nodes()
    health = announcer.health()
    assert health.condition is Condition.STARTING
    assert health.detail.startswith(f"nobody asks for the parameters of {name}; ")
    asker.ask(name, wait_for)
    health = announcer.health()
    assert (health.condition, health.detail) == (Condition.UP, "")
    announcer._missed_ns = 0
    assert announcer.health().condition is Condition.DOWN
    announcer.close()
    assert announcer.health().condition is Condition.CLOSED


def test_an_announcer_whose_context_is_shut_down_says_so(announcer: RosParamAnnouncer) -> None:
    announcer.announce(BeaconHint("engine"))
    announcer._own.context.try_shutdown()
    health = announcer.health()
    assert health.condition is Condition.DOWN
    assert health.detail == "the ROS context was shut down; make a new announcer"


def test_closing_lets_those_who_ask_ask_once_more(
    announcer: RosParamAnnouncer, asker: Asker, wait_for: WaitFor
) -> None:
    announcer.announce(BeaconHint("engine"))
    wait_for(asker.nodes, "the node is there")
    (name,) = asker.nodes()
    asker.ask(name, wait_for)
    closing = threading.Thread(target=announcer.close)
    closing.start()
    wait_for(lambda: announcer.health().condition is Condition.CLOSED, "it is closing")
    assert asker.ask(name, wait_for) == []
    closing.join(20.0)
    wait_for(lambda: not asker.nodes(), "the node is gone")


def test_closing_does_not_wait_for_long_for_those_who_do_not_ask_again(
    announcer: RosParamAnnouncer, asker: Asker, wait_for: WaitFor
) -> None:
    announcer.announce(BeaconHint("engine"))
    wait_for(asker.nodes, "the node is there")
    asker.ask(asker.nodes()[0], wait_for)
    began = time.monotonic()
    announcer.close()
    assert 0.4 < time.monotonic() - began < 1.0


def test_closing_takes_no_second_also_if_the_spinner_hangs(announcer: RosParamAnnouncer) -> None:
    announcer.announce(BeaconHint("engine"))
    release = threading.Event()
    announcer.spinner.run(lambda: release.wait(20.0), within_s=0.0)
    began = time.monotonic()
    announcer.close()
    took = time.monotonic() - began
    release.set()
    assert took < 1.0


def test_in_a_forked_child_an_announcer_says_nothing(
    announcer: RosParamAnnouncer, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer.announce(BeaconHint("engine"))
    with monkeypatch.context() as child:
        child.setattr(os, "getpid", lambda: -1)
        with pytest.raises(UsageError, match="fork"):
            announcer.announce(BeaconHint("brake"))
        announcer.withdraw("engine")
        announcer.close()
    assert announcer.health().counters["entities"] == 1
