"""Asking a real node, and giving up."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to ask")

from beacon_ros.participant import OwnNode
from beacon_ros.spinner import Spinner
from beacon_ros_param.clients import RosClients

if TYPE_CHECKING:
    from tests.unit.beacon_ros_param.conftest import Peers

D = "ros2_medkit.discovery."
WaitFor = Callable[..., None]
AnswerTo = Callable[[Any], Any]


@pytest.fixture
def own(domain_id: int) -> Iterator[OwnNode]:
    own = OwnNode("clients_test", domain_id)
    spinner = Spinner(own.context, own.node)
    yield own
    spinner.close(5.0)
    own.close()


def test_a_node_is_asked_for_the_names_and_the_values_of_its_parameters(
    own: OwnNode, peers: Peers, wait_for: WaitFor, answer_to: AnswerTo
) -> None:
    peers.new("engine", entity_id="engine", function_ids=["a", "b"], process_id=7, odd=[1.5])
    client = RosClients(own.node)("/engine")
    wait_for(client.ready, "the services are found")
    names = [D + field for field in ("entity_id", "function_ids", "process_id", "odd")]
    assert list(answer_to(client.list_names)) == names
    *values, odd = answer_to(partial(client.get_values, names))
    assert values == ["engine", ["a", "b"], 7]
    assert list(odd) == [1.5]
    client.close()


def test_who_is_asked_for_what_it_does_not_have_answers_without_values(
    own: OwnNode, peers: Peers, wait_for: WaitFor, answer_to: AnswerTo
) -> None:
    peers.new("engine", entity_id="engine")
    client = RosClients(own.node)("/engine")
    wait_for(client.ready, "the services are found")
    assert answer_to(partial(client.get_values, [D + "entity_id", D + "hostname"])) == []


def test_nobody_is_ready_where_nobody_is(own: OwnNode) -> None:
    assert not RosClients(own.node)("/nobody").ready()


@pytest.mark.parametrize("name", ["/bad name", "/2fast", "no-slash"])
def test_a_name_that_no_node_can_have_is_refused(own: OwnNode, name: str) -> None:
    with pytest.raises(Exception, match=r"(?i)invalid"):
        RosClients(own.node)(name)


def test_an_answer_that_is_not_wanted_any_more_does_not_come(
    own: OwnNode, peers: Peers, wait_for: WaitFor, answer_to: AnswerTo
) -> None:
    peers.new("engine", entity_id="engine")
    client = RosClients(own.node)("/engine")
    wait_for(client.ready, "the services are found")
    answer_to(client.list_names)  # from now on both know of each other
    release, answers = threading.Event(), list[Any]()
    peers.spinner.run(lambda: release.wait(20.0), within_s=0.0)
    drop = client.list_names(lambda _: answers.append("dropped"))
    client.list_names(lambda _: answers.append("wanted"))
    drop()
    release.set()
    wait_for(lambda: answers, "the other answer comes")
    assert answers == ["wanted"]


def test_a_call_that_ends_in_an_error_is_an_answer_that_is_none(
    own: OwnNode, peers: Peers, wait_for: WaitFor, answer_to: AnswerTo
) -> None:
    peers.new("engine", entity_id="engine")
    client = RosClients(own.node)("/engine")
    wait_for(client.ready, "the services are found")
    answer_to(client.list_names)  # from now on both know of each other
    release, answers = threading.Event(), list[Any]()
    peers.spinner.run(lambda: release.wait(20.0), within_s=0.0)
    client.list_names(answers.append)
    *_, pending = client._list._pending_requests.values()  # type: ignore[attr-defined]
    pending.set_exception(RuntimeError("broken"))
    release.set()
    wait_for(lambda: answers == [None], "the error is told")
