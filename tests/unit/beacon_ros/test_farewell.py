"""Last words are said, and heard, when ROS would not say anything any more; and take their time
only."""

from __future__ import annotations

import ctypes as c
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to say farewell to")

from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.farewell import say_last
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.taking import Taken, taker

Eventually = Callable[..., None]

HEADER = b"\0\1\0\0"
DEEP = QoSProfile(depth=2000)

LISTENER = """
import sys, time
from rclpy.qos import QoSProfile
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.taking import taker
own = OwnNode("listener", None)
message = message_type(TYPE_NAME, TYPE_HASH)
subscription = own.node.create_subscription(message, "/topic", print, 2000, raw=True)
take = taker(subscription.handle)
while not take():
    time.sleep(0.01)
print("heard", flush=True)
sys.stdin.readline()
"""


class Ear:
    """Hears the topic from a context of its own, which outlives the speaker's."""

    def __init__(self) -> None:
        self.own = OwnNode("ear", None)
        subscription = self.own.node.create_subscription(
            message_type(TYPE_NAME, TYPE_HASH), "/topic", print, DEEP, raw=True
        )
        self._take: Callable[[], Taken | None] = taker(subscription.handle)
        self._heard: list[bytes] = []

    def heard(self) -> list[bytes]:
        while taken := self._take():
            self._heard.append(taken[0])
        return self._heard


@pytest.fixture(autouse=True)
def _environment(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))


@pytest.fixture
def ear() -> Iterator[Ear]:
    made = Ear()
    yield made
    made.own.close()


@pytest.fixture
def own(domain: int) -> Iterator[OwnNode]:
    made = OwnNode("speaker", domain)
    yield made
    made.close()


@pytest.fixture
def publisher(own: OwnNode) -> Publisher:
    return own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP)


@pytest.fixture
def hung(publisher: Publisher, eventually: Eventually) -> Iterator[None]:
    """A reader in another process, which has heard something and is then stopped.

    Matched is not enough: until a reader has answered once, nobody waits for it.
    """
    command = [sys.executable, "-c", LISTENER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as listener:
        assert listener.stdout is not None
        said = listener.stdout.fileno()
        os.set_blocking(said, False)

        def heard() -> bool:
            publisher.publish(HEADER + b"beat")
            try:
                return bool(os.read(said, 100))
            except BlockingIOError:
                return False

        eventually(heard)
        os.kill(listener.pid, signal.SIGSTOP)
        yield
        listener.kill()


def met(ear: Ear, publisher: Publisher, eventually: Eventually) -> None:
    """Both ends know each other: what is said from now on arrives."""

    def heard() -> list[bytes]:
        publisher.publish(HEADER + b"beat")
        return ear.heard()

    eventually(heard)


def test_they_are_said_when_the_context_was_shut_down(
    own: OwnNode, ear: Ear, publisher: Publisher, eventually: Eventually
) -> None:
    met(ear, publisher, eventually)
    own.context.shutdown()
    with pytest.raises(Exception, match="context is invalid"):
        publisher.publish(HEADER + b"beat")
    words = [HEADER + b"%04d" % number for number in range(400)]
    say_last(publisher, words, 0.5)
    eventually(lambda: ear.heard()[-400:] == words)


def test_with_nobody_there_they_take_no_time(publisher: Publisher) -> None:
    began_s = time.monotonic()
    assert say_last(publisher, [HEADER], 5.0)
    assert time.monotonic() - began_s < 1.0


def test_nobody_is_waited_for_who_need_not_say_that_it_heard(
    own: OwnNode, ear: Ear, eventually: Eventually
) -> None:
    lossy = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", lossy)
    began_s = time.monotonic()
    assert say_last(publisher, [HEADER], 5.0)
    assert time.monotonic() - began_s < 1.0


@pytest.mark.usefixtures("hung")
def test_who_hangs_is_waited_for_as_long_as_said(publisher: Publisher) -> None:
    began_s = time.monotonic()
    assert not say_last(publisher, [HEADER], 0.3)
    assert 0.3 <= time.monotonic() - began_s < 0.8


@pytest.mark.usefixtures("hung")
def test_many_words_to_somebody_who_hangs_are_cut_short(publisher: Publisher) -> None:
    word = HEADER + bytes(1000)
    began_s = time.monotonic()
    assert not say_last(publisher, (word for _ in range(10**9)), 0.3)
    assert 0.3 <= time.monotonic() - began_s < 0.8


def test_a_publisher_that_is_no_more_says_nothing(
    own: OwnNode, publisher: Publisher, capfd: pytest.CaptureFixture[str]
) -> None:
    own.node.destroy_publisher(publisher)
    assert not say_last(publisher, [HEADER], 5.0)
    assert capfd.readouterr().err == ""


def test_what_ros_cannot_say_is_told_by_the_result_alone(
    capfd: pytest.CaptureFixture[str],
) -> None:
    class Nobody(nullcontext[None]):
        memory = c.create_string_buffer(64)
        pointer = c.addressof(memory)

    publisher: Any = SimpleNamespace(handle=Nobody())
    for _ in range(2):
        assert not say_last(publisher, [HEADER], 5.0)
    assert capfd.readouterr().err == ""
