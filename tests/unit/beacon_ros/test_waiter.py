"""A thread that waits: called when it should be, ended whatever happens around it."""

from __future__ import annotations

import logging
import subprocess
import threading
import time
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nothing to wait for")

from rclpy.exceptions import InvalidHandle

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.waiter import CONTEXT_ENDED, NODE_ENDED, Waiter

Eventually = Callable[..., None]


class Owner:
    """Counts its steps, and keeps what it was told at the end."""

    def __init__(self, own: OwnNode) -> None:
        self.next_s: float | None = None
        self.doing: Callable[[], object] = lambda: None
        self.steps = 0
        self.threads: set[str] = set()
        self.ends: list[str] = []
        self.waiter = Waiter(own.context, self.step, self.ends.append)

    def step(self) -> float | None:
        self.steps += 1
        self.threads.add(threading.current_thread().name)
        self.doing()
        return self.next_s


@pytest.fixture
def own(domain: int) -> Iterator[OwnNode]:
    made = OwnNode("waiter", domain)
    yield made
    made.close()


@pytest.fixture
def owner(own: OwnNode) -> Iterator[Owner]:
    made = Owner(own)
    yield made
    made.waiter.close(1.0)


def test_it_steps_first_and_then_when_it_is_woken(owner: Owner, eventually: Eventually) -> None:
    owner.waiter.start()
    for steps in (1, 2, 3):
        eventually(lambda steps=steps: owner.steps == steps)
        owner.waiter.wake()
    assert owner.threads == {"beacon-ros"}


def test_it_steps_again_after_the_time_that_it_said(owner: Owner, eventually: Eventually) -> None:
    owner.next_s = 0.02
    began_s = time.monotonic()
    owner.waiter.start()
    eventually(lambda: owner.steps >= 5)
    assert time.monotonic() - began_s >= 0.08


def test_a_time_that_is_over_is_no_fault(owner: Owner, eventually: Eventually) -> None:
    owner.next_s = -1.0
    owner.waiter.start()
    eventually(lambda: owner.steps >= 3)


def test_closed_it_has_ended_without_an_error_and_does_nothing_more(
    owner: Owner, eventually: Eventually
) -> None:
    owner.waiter.start()
    eventually(lambda: owner.steps)
    assert not owner.waiter.closing
    assert owner.waiter.close(1.0)
    assert owner.waiter.closing
    assert owner.ends == [""]
    steps = owner.steps
    owner.waiter.wake()
    assert owner.waiter.close(1.0)
    assert (owner.steps, owner.ends) == (steps, [""])


def test_one_that_never_began_is_closed_at_once(owner: Owner) -> None:
    owner.waiter.wake()
    assert owner.waiter.close(0.0)
    assert (owner.steps, owner.ends) == (0, [])


def test_closed_from_within_it_ends_afterwards(owner: Owner, eventually: Eventually) -> None:
    owner.doing = lambda: owner.waiter.close(1.0)
    owner.waiter.start()
    eventually(lambda: owner.ends == [""])
    assert owner.steps == 1


def test_a_step_that_hangs_holds_nobody_up_for_longer_than_said(owner: Owner) -> None:
    go_on = threading.Event()
    entered = threading.Event()

    def hang() -> None:
        entered.set()
        go_on.wait()

    owner.doing = hang
    owner.waiter.start()
    assert entered.wait(5)
    began_s = time.monotonic()
    assert not owner.waiter.close(0.1)
    assert time.monotonic() - began_s < 1.0
    go_on.set()
    assert owner.waiter.close(5.0)
    assert owner.ends == [""]


def test_a_context_that_is_shut_down_ends_it_at_once(
    own: OwnNode, owner: Owner, eventually: Eventually
) -> None:
    owner.waiter.start()
    eventually(lambda: owner.steps)
    own.context.shutdown()
    eventually(lambda: owner.ends == [CONTEXT_ENDED], 1.0)
    assert not owner.waiter.closing


def test_so_does_a_context_that_ros_shut_down_without_a_word(
    own: OwnNode, owner: Owner, eventually: Eventually
) -> None:
    def find_out() -> None:
        if owner.steps == 2:
            raise RuntimeError("the given context is not valid")

    owner.doing = find_out
    owner.waiter.start()
    eventually(lambda: owner.steps == 1)
    handle = own.context.handle
    assert handle is not None
    with handle:
        handle.shutdown()  # as ROS's signal handler does
    owner.waiter.wake()
    eventually(lambda: owner.ends == [CONTEXT_ENDED])


def test_somebody_else_may_have_found_that_out(owner: Owner, eventually: Eventually) -> None:
    owner.waiter.start()
    eventually(lambda: owner.steps)
    owner.waiter.end_with_context()
    eventually(lambda: owner.ends == [CONTEXT_ENDED])


def test_a_node_that_is_destroyed_ends_it(owner: Owner, eventually: Eventually) -> None:
    def fail() -> None:
        raise InvalidHandle("destruction was requested")

    owner.doing = fail
    owner.waiter.start()
    eventually(lambda: owner.ends == [NODE_ENDED])


def test_whatever_else_ends_it_is_logged_and_told(
    owner: Owner, eventually: Eventually, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise OSError("no more descriptors")

    owner.doing = fail
    owner.waiter.start()
    eventually(lambda: owner.ends == ["reading ended: no more descriptors"])
    (record,) = caplog.records
    assert (record.levelno, record.name) == (logging.ERROR, "beacon_ros.waiter")
    assert record.exc_info


def test_what_fails_while_it_is_closed_is_nobodys_business(
    owner: Owner, eventually: Eventually, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        owner.waiter.close(0.0)
        raise OSError("no more descriptors")

    owner.doing = fail
    owner.waiter.start()
    eventually(lambda: owner.ends == [""])
    assert caplog.records == []


def test_a_program_that_ends_ends_it_in_time(
    run_script: Callable[[str], subprocess.CompletedProcess[str]],
) -> None:
    ended = run_script(
        "from beacon_ros.participant import OwnNode\n"
        "from beacon_ros.waiter import Waiter\n"
        "own = OwnNode('waiter', None)\n"
        "kept = [Waiter(own.context, lambda: 0.001, print) for _ in range(3)]\n"
        "for waiter in kept: waiter.start()\n"
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "\n\n\n", "")


def test_fifty_of_them_leave_nothing(own: OwnNode, leaves_nothing: Callable[..., None]) -> None:
    def come_and_go() -> None:
        owner = Owner(own)
        owner.waiter.start()
        assert owner.waiter.close(5.0)

    leaves_nothing(come_and_go)


def test_a_change_of_the_graph_wakes_it(own: OwnNode, eventually: Eventually) -> None:
    steps: list[int] = []
    waiter = Waiter(own.context, lambda: steps.append(1), lambda _: None, graph_of=own.node)
    waiter.start()
    eventually(lambda: steps)
    before = len(steps)
    publisher = own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", 1)
    eventually(lambda: len(steps) > before)
    before = len(steps)
    own.node.destroy_publisher(publisher)
    eventually(lambda: len(steps) > before)
    assert waiter.close(5.0)
