"""A node's own parameters as its beacon: declared, changed by anybody, taken back."""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no node to declare it on")

from rcl_interfaces.msg import ParameterEvent, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, read
from beacon_ros.participant import OwnNode
from beacon_ros.spinner import Spinner
from beacon_ros_param.beacon import declare_beacon
from beacon_ros_param.events import EVENTS_TOPIC

if TYPE_CHECKING:
    from tests.unit.beacon_ros_param.conftest import Peers

D = f"{PREFIX}."
WaitFor = Callable[..., None]


def said(node: Node) -> BeaconHint | None:
    """What a source would read."""
    found: dict[str, Any] = node.get_parameters_by_prefix("")
    return read({name: one.value for name, one in found.items()}).hint


@pytest.fixture
def node(peers: Peers) -> Iterator[Node]:
    """Not served by anybody."""
    node = Node("engine", context=peers.context, use_global_arguments=False, enable_rosout=False)
    yield node
    node.destroy_node()


# Declaring


def test_a_beacon_is_declared_with_who_this_process_is(node: Node) -> None:
    declare_beacon(node, BeaconHint("engine", metadata={"vendor": "acme"}))
    hint = said(node)
    assert hint is not None
    assert (hint.entity_id, hint.metadata) == ("engine", {"vendor": "acme"})
    assert (hint.process_id, hint.hostname) == (os.getpid(), os.uname().nodename)
    assert hint.process_name == Path(sys.argv[0]).name


def test_what_the_hint_gives_is_not_filled_in(node: Node) -> None:
    given = BeaconHint("engine", process_id=7, process_name="p", hostname="h")
    declare_beacon(node, given)
    assert said(node) == given


@pytest.mark.parametrize("entity_id", ["", "no id", "é", "x" * 257])
def test_an_id_that_is_none_is_a_mistake_of_the_caller(node: Node, entity_id: str) -> None:
    with pytest.raises(UsageError, match="entity_id"):
        declare_beacon(node, BeaconHint(entity_id))
    beacon = declare_beacon(node, BeaconHint("engine"))
    with pytest.raises(UsageError, match="entity_id"):
        beacon.update(BeaconHint(entity_id))


def test_a_value_in_the_parameter_file_comes_before_the_programs(peers: Peers) -> None:
    overrides = [
        Parameter(D + "display_name", value="From the file"),
        Parameter(D + "process_id", value=9),
    ]
    node = Node("engine", context=peers.context, parameter_overrides=overrides)
    beacon = declare_beacon(node, BeaconHint("engine", display_name="From the program"))
    hint = said(node)
    assert hint is not None
    assert (hint.display_name, hint.process_id) == ("From the file", 9)
    beacon.update(BeaconHint("engine", display_name="Later"))
    hint = said(node)
    assert hint is not None
    assert hint.display_name == "Later"
    node.destroy_node()


def test_a_value_of_another_type_in_the_parameter_file_is_said_by_ros(peers: Peers) -> None:
    overrides = [Parameter(D + "display_name", value=7)]
    node = Node("engine", context=peers.context, parameter_overrides=overrides)
    with pytest.raises(InvalidParameterTypeException, match="display_name"):
        declare_beacon(node, BeaconHint("engine", display_name="Engine"))
    node.destroy_node()


def test_what_the_node_has_declared_already_is_set(peers: Peers) -> None:
    node = Node(
        "engine",
        context=peers.context,
        automatically_declare_parameters_from_overrides=True,
        parameter_overrides=[
            Parameter(ENTITY_ID, value="file"),
            Parameter(D + "hostname", value="h"),
        ],
    )
    beacon = declare_beacon(node, BeaconHint("engine", hostname="robot"))
    hint = said(node)
    assert hint is not None
    assert (hint.entity_id, hint.hostname) == ("engine", "robot")
    beacon.close()
    assert said(node) is None
    node.destroy_node()


# Changing


def test_an_update_replaces_the_hint_as_a_whole(node: Node) -> None:
    fixed: dict[str, Any] = {"process_id": 7, "process_name": "p", "hostname": "h"}
    beacon = declare_beacon(node, BeaconHint("engine", display_name="A", stable_id="s", **fixed))
    then = BeaconHint("motor", display_name="B", function_ids=("f",), metadata={"k": "v"}, **fixed)
    beacon.update(then)
    assert said(node) == then
    assert not node.has_parameter(D + "stable_id")


def test_what_somebody_sets_is_what_is_said(node: Node) -> None:
    declare_beacon(node, BeaconHint("engine", display_name="cold"))
    node.set_parameters([Parameter(D + "display_name", value="warm")])
    hint = said(node)
    assert hint is not None
    assert hint.display_name == "warm"
    (refused,) = node.set_parameters([Parameter(D + "display_name", value=7)])
    assert not refused.successful


def test_a_node_that_refuses_the_hint_is_reported(
    node: Node, caplog: pytest.LogCaptureFixture
) -> None:
    beacon = declare_beacon(node, BeaconHint("engine", display_name="A"))
    node.add_on_set_parameters_callback(
        lambda _: SetParametersResult(successful=False, reason="not now")
    )
    with caplog.at_level(logging.WARNING):
        beacon.update(BeaconHint("engine", display_name="B"))
    assert "/engine: its own callback refuses the hint: not now" in caplog.messages


@pytest.mark.parametrize("executor", ["events", "single", "multi"])
def test_on_a_node_that_is_served_a_change_waits_for_its_turn(
    peers: Peers, node: Node, wait_for: WaitFor, executor: str
) -> None:
    beacon = declare_beacon(node, BeaconHint("engine", display_name="0"))
    threads: set[str] = set()

    def note(_: object) -> SetParametersResult:
        threads.add(threading.current_thread().name)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(note)
    with served(peers, node, executor):
        for number in range(1, 30):
            beacon.update(
                BeaconHint("engine", display_name=str(number), metadata={f"k{number}": ""})
            )

        def last() -> bool:
            hint = said(node)
            return hint is not None and (hint.display_name, [*hint.metadata]) == ("29", ["k29"])

        wait_for(last, "the last word is said")
        wait_for(lambda: not [*node.timers], "and nothing is left behind")
    assert threading.current_thread().name not in threads


@contextmanager
def served(peers: Peers, node: Node, kind: str) -> Iterator[None]:
    if kind == "events":
        spinner = Spinner(peers.context, node)
        yield
        assert spinner.close(20.0)
        return
    made = {"single": SingleThreadedExecutor, "multi": MultiThreadedExecutor}[kind]
    executor, over = made(context=peers.context), threading.Event()
    executor.add_node(node)

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=spin)
    thread.start()
    yield
    over.set()
    thread.join()
    executor.shutdown()


def test_a_hint_that_cannot_be_declared_does_not_end_the_program_that_spins_the_node(
    peers: Peers, wait_for: WaitFor, caplog: pytest.LogCaptureFixture
) -> None:
    overrides = [Parameter(D + "display_name", value=7)]
    node = Node("engine", context=peers.context, parameter_overrides=overrides)
    spinner = Spinner(peers.context, node)
    with caplog.at_level(logging.ERROR):
        declare_beacon(node, BeaconHint("engine", display_name="Engine"))
        wait_for(lambda: caplog.messages, "that is logged")
    assert caplog.messages == ["engine: its hint is not declared"]
    assert spinner.close(20.0)
    node.destroy_node()


# Taking back


def test_closing_takes_the_hint_back_and_undeclares_it(node: Node) -> None:
    beacon = declare_beacon(node, BeaconHint("engine", metadata={"k": "v"}))
    beacon.close()
    beacon.close()
    assert said(node) is None
    assert not node.get_parameters_by_prefix(PREFIX)
    with pytest.raises(UsageError, match="closed"):
        beacon.update(BeaconHint("engine"))


@pytest.mark.parametrize("shut_down", [False, True])
def test_that_a_hint_is_taken_back_is_told_also_after_ros_was_shut_down(
    peers: Peers, domain_id: int, wait_for: WaitFor, *, shut_down: bool
) -> None:
    own = OwnNode("beacon_test", domain_id)
    heard: list[str] = []
    emptied: list[str] = []

    def on_event(event: Any) -> None:
        heard.append(event.node)
        emptied.extend(
            event.node
            for one in event.changed_parameters
            if one.name == ENTITY_ID and not one.value.string_value
        )

    own.node.create_subscription(
        ParameterEvent, EVENTS_TOPIC, on_event, qos_profile_parameter_events
    )
    spinner = Spinner(own.context, own.node)
    node = peers.new("engine")
    beacon = declare_beacon(node, BeaconHint("engine"))
    wait_for(lambda: said(node), "it is declared")

    def is_heard() -> bool:
        node.set_parameters([Parameter("use_sim_time", value=False)])
        return bool(heard)

    wait_for(is_heard, "somebody listens")
    if shut_down:
        peers.context.try_shutdown()
    beacon.close()
    wait_for(lambda: emptied == ["/engine"], "the event comes")
    assert spinner.close(20.0)
    own.close()


def test_what_somebody_undeclared_is_not_missed(node: Node) -> None:
    beacon = declare_beacon(node, BeaconHint("engine", display_name="Engine"))
    for name in (ENTITY_ID, D + "display_name"):
        node.undeclare_parameter(name)
    beacon.close()
    assert not node.get_parameters_by_prefix(PREFIX)


def test_a_beacon_whose_node_is_gone_closes_without_a_word(peers: Peers) -> None:
    node = Node("engine", context=peers.context, use_global_arguments=False)
    beacon = declare_beacon(node, BeaconHint("engine"))
    node.destroy_node()
    beacon.close()


def test_in_a_forked_child_a_beacon_says_nothing(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    beacon = declare_beacon(node, BeaconHint("engine"))
    monkeypatch.setattr(os, "getpid", lambda: -1)
    with pytest.raises(UsageError, match="fork"):
        beacon.update(BeaconHint("engine"))
    beacon.close()
    assert said(node) is not None
