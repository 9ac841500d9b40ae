"""A thread that serves nodes: it takes changes at work, outlives faults, and ends in time."""

from __future__ import annotations

import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nothing to spin")

from rcl_interfaces.srv import ListParameters
from rclpy.node import Node

from beacon_ros.domains import DomainLease
from beacon_ros.participant import OwnNode
from beacon_ros.spinner import Spinner

DEADLINE_S = 20.0


@pytest.fixture
def own() -> Iterator[OwnNode]:
    with DomainLease() as lease:
        own = OwnNode("spinner_test", lease.domain_id)
        yield own
        own.close()


@pytest.fixture
def spinner(own: OwnNode) -> Iterator[Spinner]:
    spinner = Spinner(own.context, own.node)
    yield spinner
    assert spinner.close(5.0)


def wait_for(true: Callable[[], object], what: str) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not true():
        assert time.monotonic() < deadline, f"did not happen: {what}"
        time.sleep(0.005)


def test_nodes_come_and_go_while_others_are_served(own: OwnNode, spinner: Spinner) -> None:
    nodes: list[Node] = []
    for number in range(8):
        node = Node(f"served_{number}", context=own.context, use_global_arguments=False)
        nodes.append(node)
        spinner.add_node(node)
        client = own.node.create_client(ListParameters, f"/served_{number}/list_parameters")
        wait_for(client.service_is_ready, "the service is there")
        answer = client.call_async(ListParameters.Request())
        wait_for(answer.done, f"served_{number} answers")
        if number % 2:
            spinner.remove_node(nodes[0])
            nodes.pop(0).destroy_node()
    for node in nodes:
        spinner.remove_node(node)
        node.destroy_node()


def test_what_is_run_is_run_in_the_spinners_thread_between_two_callbacks(spinner: Spinner) -> None:
    threads: list[threading.Thread] = []

    def note() -> None:
        threads.append(threading.current_thread())

    assert spinner.run(lambda: spinner.run(note))
    assert [thread.name for thread in threads] == ["beacon-ros-spinner"]


def test_what_is_run_raises_where_it_was_asked_for_and_harms_nobody(spinner: Spinner) -> None:
    def fail() -> None:
        raise LookupError("from the action")

    with pytest.raises(LookupError, match="from the action"):
        spinner.run(fail)
    assert spinner.run(lambda: None)


def test_who_waits_for_a_busy_spinner_waits_no_longer_than_it_wants(spinner: Spinner) -> None:
    release, done = threading.Event(), threading.Event()
    assert not spinner.run(lambda: release.wait(DEADLINE_S), within_s=0.05)
    assert not spinner.run(done.set, within_s=0.05)
    release.set()
    assert done.wait(DEADLINE_S)


def test_a_callback_that_fails_is_logged_and_the_others_are_served(
    own: OwnNode, spinner: Spinner, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise RuntimeError("from a timer")

    with caplog.at_level(logging.ERROR):
        timer = own.node.create_timer(0.01, fail)
        # A record is there before its text is.
        wait_for(lambda: "from a timer" in caplog.text, "the failure is logged")
    own.node.destroy_timer(timer)
    assert spinner.run(lambda: None)


def test_closing_a_spinner_that_hangs_gives_up_in_time_and_can_be_done_again(own: OwnNode) -> None:
    spinner, begun, release = Spinner(own.context, own.node), threading.Event(), threading.Event()

    def hang() -> None:
        begun.set()
        release.wait(DEADLINE_S)

    spinner.run(hang, within_s=0.0)
    assert begun.wait(DEADLINE_S)
    began = time.monotonic()
    assert not spinner.close(0.1)
    assert time.monotonic() - began < 5.0
    release.set()
    assert spinner.close(DEADLINE_S)
    assert spinner.close(0.0)
    assert not spinner.run(lambda: None)


def test_a_spinner_ends_with_its_context(
    own: OwnNode, spinner: Spinner, caplog: pytest.LogCaptureFixture
) -> None:
    own.context.try_shutdown()
    wait_for(lambda: not spinner._thread.is_alive(), "the thread ends")
    assert not caplog.records
    assert not spinner.run(lambda: None)


def test_a_program_that_forgets_to_close_ends_without_a_word() -> None:
    code = (
        "from beacon_ros.domains import DomainLease; from beacon_ros.participant import OwnNode\n"
        "from beacon_ros.spinner import Spinner\n"
        "lease = DomainLease(); own = OwnNode('careless', lease.domain_id)\n"
        "spinner = Spinner(own.context, own.node)\n"
        "assert spinner.run(lambda: None)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
