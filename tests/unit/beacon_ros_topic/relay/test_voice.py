"""A publisher of bytes: they arrive as they are, with its GID; what ROS refuses is raised."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: nothing can be published")

from rclpy.qos import QoSProfile

from beacon_core.relay.values import Qos
from beacon_ros.taking import Buffer
from beacon_ros_topic.relay.endpoints import publishers_of
from beacon_ros_topic.relay.harness import BYTES, message
from beacon_ros_topic.relay.hub import Hub
from beacon_ros_topic.relay.intake import Intake
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.voice import Voice

if TYPE_CHECKING:
    from beacon_ros.participant import OwnNode
    from beacon_ros_topic.relay.harness import RosTopicSideHarness

Eventually = Callable[..., None]

QOS = QoSProfile(depth=100)


@pytest.fixture
def voice(own: OwnNode) -> Iterator[Voice]:
    made = Voice(own.node, type_for(BYTES), "/topic", QOS)
    yield made
    made.close()


def test_its_gid_is_that_of_the_graph(own: OwnNode, voice: Voice) -> None:
    assert [one.gid for one in publishers_of(own.node, "/topic")] == [voice.gid]


def test_it_counts_who_has_matched_and_knows_when_all_have_it(
    ros: RosTopicSideHarness, voice: Voice, eventually: Eventually
) -> None:
    assert voice.count() == 0
    peer = ros.subscription("/topic", BYTES, Qos())
    eventually(lambda: voice.count() == 1)
    voice.send(message(b"hello"))
    eventually(voice.acknowledged)
    eventually(lambda: peer.received() == [message(b"hello")])


@pytest.mark.parametrize("topic", ["no slash!", "/2", "", "/a//b"])
def test_a_name_that_ros_refuses_is_raised(own: OwnNode, topic: str) -> None:
    with pytest.raises(Exception, match=r"."):
        Voice(own.node, type_for(BYTES), topic, QOS)


def test_a_message_that_ros_refuses_is_raised_in_its_words(
    own: OwnNode, voice: Voice, capfd: pytest.CaptureFixture[str]
) -> None:
    own.context.try_shutdown()
    with pytest.raises(RuntimeError, match=r"^publishing failed: .*context"):
        voice.send(message(b"late"))
    assert capfd.readouterr().err == ""


def test_a_middleware_without_gids_is_told(own: OwnNode, monkeypatch: pytest.MonkeyPatch) -> None:
    class Refuses:
        argtypes: object = None
        restype: object = None

        def __call__(self, *_: object) -> int:
            return 1

    class Library:
        rmw_get_gid_for_publisher = Refuses()

    real = c.CDLL

    def library(name: str) -> object:
        return Library() if name.startswith("librmw_") else real(name)

    monkeypatch.setattr(c, "CDLL", library)
    with pytest.raises(RuntimeError, match="a publisher has no GID"):
        Voice(own.node, type_for(BYTES), "/other", QOS)


def test_a_thousand_messages_are_taken_in_turns(
    own: OwnNode, ros: RosTopicSideHarness, eventually: Eventually
) -> None:
    heard: dict[str, list[bytes]] = {"/one": [], "/two": []}
    intakes: list[Intake] = []

    def end() -> None:
        for intake in intakes:
            intake.close()

    hub = Hub(own.context, lambda: None, end)
    buffer, qos = Buffer(), QoSProfile(depth=1000)
    for topic, some in heard.items():
        tell = partial(keep, some)
        intakes.append(Intake(own.node, type_for(BYTES), topic, qos, buffer, tell))
    voices = [Voice(own.node, type_for(BYTES), topic, qos) for topic in heard]
    eventually(lambda: all(voice.count() for voice in voices))
    for number in range(500):
        for voice in voices:
            voice.send(message(b"%d" % number))
    for intake in intakes:
        hub.do(partial(intake.open, hub))
    hub.start()
    eventually(lambda: all(len(some) == 500 for some in heard.values()))
    assert heard["/one"] == heard["/two"] == [message(b"%d" % number) for number in range(500)]
    assert hub.close(5.0)
    for voice in voices:
        voice.close()


def keep(some: list[bytes], payload: bytes, _gid: bytes, _stamp_ns: int) -> None:
    some.append(payload)
