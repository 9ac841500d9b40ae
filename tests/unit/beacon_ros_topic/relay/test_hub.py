"""One thread for all: it sleeps until somebody rings, keeps the order, and ends in order."""

from __future__ import annotations

import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no context")

from beacon_ros_topic.relay.bells import Bell
from beacon_ros_topic.relay.hub import Hub

if TYPE_CHECKING:
    from beacon_ros.participant import OwnNode

Eventually = Callable[..., None]


class Owner:
    """Counts, and keeps the threads in which it was called."""

    def __init__(self, own: OwnNode) -> None:
        self.steps = 0
        self.wait_s: float | None = None
        self.ends = 0
        self.threads: set[str] = set()
        self.fault: Exception | None = None
        self.hub = Hub(own.context, self._step, self._end)

    def _step(self) -> float | None:
        self.steps += 1
        self.threads.add(threading.current_thread().name)
        if self.fault is not None:
            raise self.fault
        return self.wait_s

    def _end(self) -> None:
        self.ends += 1
        self.threads.add(threading.current_thread().name)


@pytest.fixture
def owner(own: OwnNode) -> Iterator[Owner]:
    made = Owner(own)
    yield made
    made.hub.close(5.0)


def test_it_does_what_it_is_asked_in_order_and_in_its_thread(
    owner: Owner, eventually: Eventually
) -> None:
    done: list[int] = []
    for number in range(5):
        owner.hub.do(partial(done.append, number))
    owner.hub.start()
    eventually(lambda: len(done) == 5)
    owner.hub.do(lambda: owner.threads.add(threading.current_thread().name))
    assert owner.hub.close(5.0)
    assert done == [0, 1, 2, 3, 4]
    assert owner.threads == {"beacon-ros-relay"}
    assert owner.ends == 1


def test_it_steps_first_when_woken_and_when_it_said(owner: Owner, eventually: Eventually) -> None:
    owner.hub.start()
    eventually(lambda: owner.steps == 1)
    owner.hub.wake()
    eventually(lambda: owner.steps == 2)
    owner.wait_s = 0.001
    owner.hub.wake()
    eventually(lambda: owner.steps > 20)


def test_a_bell_has_what_hangs_on_it_drained_as_long_as_there_is_more(
    owner: Owner, eventually: Eventually
) -> None:
    left = [3, 0]
    calls = [0, 0]

    def drain(which: int) -> bool:
        calls[which] += 1
        left[which] -= 1
        return left[which] > 0

    bells = [owner.hub.add(partial(drain, which)) for which in (0, 1)]
    owner.hub.start()
    bells[0].ring()
    eventually(lambda: calls[0] == 3)
    assert calls[1] == 0


def test_hundreds_share_a_few_bells(owner: Owner, eventually: Eventually) -> None:
    called: set[int] = set()

    def drain(which: int) -> bool:
        called.add(which)
        return False

    bells = [owner.hub.add(partial(drain, which)) for which in range(500)]
    assert len({bell.fd for bell in bells}) == 64
    owner.hub.start()
    bells[77].ring()
    eventually(lambda: 77 in called)
    assert len(called) <= 8
    bells[78].ring()
    eventually(lambda: 78 in called)


def test_what_was_removed_is_not_called_any_more(owner: Owner, eventually: Eventually) -> None:
    calls: list[int] = []

    def endless() -> bool:
        calls.append(1)
        return True

    bell = owner.hub.add(endless)
    owner.hub.start()
    bell.ring()
    eventually(lambda: len(calls) > 10)
    owner.hub.do(lambda: owner.hub.remove(endless))
    eventually(lambda: not owner.hub._places)
    told = len(calls)
    before = owner.steps
    owner.hub.wake()
    eventually(lambda: owner.steps > before)
    assert len(calls) == told


def test_the_trouble_of_one_is_logged_and_not_that_of_the_others(
    owner: Owner, eventually: Eventually, caplog: pytest.LogCaptureFixture
) -> None:
    def broken() -> bool:
        raise ValueError("broken")

    drained = threading.Event()

    def drain() -> bool:
        drained.set()
        return False

    one, other = owner.hub.add(broken), owner.hub.add(drain)
    owner.hub.start()
    one.ring()
    owner.hub.do(broken)
    eventually(lambda: len(caplog.records) == 2)
    other.ring()
    eventually(drained.is_set)
    assert owner.hub.close(5.0)
    assert [record.message for record in caplog.records] == ["a topic side had trouble"] * 2


def test_it_ends_in_order_even_if_its_owner_fails(
    owner: Owner, eventually: Eventually, caplog: pytest.LogCaptureFixture
) -> None:
    owner.fault = ValueError("a defect")
    owner.hub.start()
    eventually(lambda: owner.ends == 1)
    assert "the thread of a topic side ended" in caplog.text


def test_it_closes_from_its_own_thread(owner: Owner, eventually: Eventually) -> None:
    owner.hub.start()
    owner.hub.do(lambda: owner.hub.close(5.0))
    eventually(lambda: owner.ends == 1)


def test_after_its_end_nothing_is_done_and_nothing_is_wrong(owner: Owner) -> None:
    owner.hub.start()
    assert owner.hub.close(5.0)
    done: list[int] = []
    owner.hub.do(lambda: done.append(1))
    owner.hub.wake()
    assert owner.hub.close(5.0)
    assert not done


def test_a_thread_that_is_held_up_is_not_waited_for_too_long(owner: Owner) -> None:
    entered, release = threading.Event(), threading.Event()

    def hold() -> None:
        entered.set()
        release.wait(10.0)

    owner.hub.start()
    owner.hub.do(hold)
    assert entered.wait(10.0)
    began = time.monotonic()
    assert not owner.hub.close(0.05)
    assert time.monotonic() - began < 2.0
    release.set()


def test_it_ends_with_its_context(owner: Owner, own: OwnNode, eventually: Eventually) -> None:
    owner.hub.start()
    own.context.try_shutdown()
    eventually(lambda: owner.ends == 1)


def test_nothing_is_left_of_it(own: OwnNode, leaves_nothing: Callable[..., None]) -> None:
    def once() -> None:
        owner = Owner(own)
        owner.hub.add(lambda: False)
        owner.hub.start()
        assert owner.hub.close(5.0)

    leaves_nothing(once)


def test_a_program_that_forgets_to_close_ends_in_order(
    run_script: Callable[[str], tuple[int, str, str]],
) -> None:
    code, out, err = run_script(FORGETS)
    assert (code, err) == (0, "")
    assert out == "made\n"


FORGETS = """
from beacon_core.testing.relay.topic_harness import Watching
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.topic_side import RosTopicSide
side = RosTopicSide(RosNetworkOptions())
side.start(Watching())
print("made")
"""


def test_a_bell_is_a_file_that_can_be_waited_for(owner: Owner) -> None:
    assert isinstance(owner.hub.add(lambda: False), Bell)


def test_a_child_process_does_not_inherit_bells(owner: Owner) -> None:
    bell = owner.hub.add(lambda: False)
    with pytest.raises(subprocess.CalledProcessError):
        subprocess.run(
            ["/bin/sh", "-c", f"true <&{bell.fd}"], check=True, stderr=subprocess.DEVNULL
        )
