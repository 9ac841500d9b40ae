"""What the conduit over ROS topics does beyond what every one must."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS for frames to travel over")

from beacon_core.errors import ConfigError, UsageError
from beacon_core.relay.values import Qos
from beacon_core.testing.relay.conduit_harness import End, Recorder
from beacon_core.testing.waiting import wait_until
from beacon_ros_topic.relay import conduit as conduit_module
from beacon_ros_topic.relay.conduit import FRAME_TYPE, LIMITS, RosConduit
from beacon_ros_topic.relay.harness import BYTES, message
from beacon_ros_topic.relay.options import RosConduitOptions
from beacon_ros_topic.relay.voice import Voice

if TYPE_CHECKING:
    from beacon_ros_topic.relay.harness import RosTopicSideHarness

Eventually = Callable[..., None]

TOPIC = "/beacon_relay/frames"


@pytest.fixture
def ends(ros: RosTopicSideHarness, eventually: Eventually) -> Iterator[tuple[End, End]]:
    made = tuple(
        End(RosConduit(RosConduitOptions(domain_id=ros.domain_id))).start() for _ in range(2)
    )
    eventually(lambda: all(one.sink.up for one in made))
    yield made[0], made[1]
    for one in made:
        one.conduit.close()


def test_frames_are_messages_of_a_type_that_ros_has(
    ros: RosTopicSideHarness, ends: tuple[End, End], eventually: Eventually
) -> None:
    peer = ros.subscription(TOPIC, FRAME_TYPE, Qos())

    def seen() -> bool:
        ends[0].conduit.send(b"header", b"payload")
        return any(b"headerpayload" in one for one in peer.received())

    eventually(seen)


def test_what_is_no_frame_is_not_told(
    ros: RosTopicSideHarness, ends: tuple[End, End], eventually: Eventually
) -> None:
    stranger = ros.publisher(TOPIC, BYTES, Qos(depth=100))
    frame = struct.pack("<4sIII", b"\0\1\0\0", 0, 6, 9)
    good = frame + b"header" + b"end" + bytes(3)

    def heard() -> bool:
        stranger.publish(good)
        return any(end.heard((b"header", b"end")) for end in ends)

    eventually(heard)
    for bad in (
        b"\0\1\0\0",
        good[:-4],
        struct.pack("<4sIII", b"\0\0\0\0", 0, 6, 9) + b"headerbig",
        struct.pack("<4sIII", b"\0\1\0\0", 1, 6, 9) + b"headerdim",
        struct.pack("<4sIII", b"\0\1\0\0", 0, 10, 9) + b"headerlen",
        message(b"no header"),
    ):
        stranger.publish(bad)
    stranger.publish(frame + b"header" + b"bye")
    eventually(lambda: ends[0].heard((b"header", b"bye")))
    assert set(ends[0].sink.frames) == {(b"header", b"end"), (b"header", b"bye")}


def test_who_falls_silent_is_gone_and_who_says_goodbye_at_once(
    ros: RosTopicSideHarness, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = End(RosConduit(RosConduitOptions(domain_id=ros.domain_id))).start()
    stranger = ros.publisher(TOPIC, BYTES, Qos(depth=100))

    def up() -> bool:
        stranger.publish(message(b""))
        return alone.sink.up

    # Not by when it was told: the clock goes on while a machine stands still.
    eventually(up)
    assert wait_until(lambda: not alone.sink.up, 2.0)
    eventually(up)
    stranger.publish(message(b"goodbye"))
    assert wait_until(lambda: not alone.sink.up, 1.0)
    alone.conduit.close()


def test_what_ros_does_not_take_is_refused_and_logged(
    ends: tuple[End, End], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise RuntimeError("no room")

    with monkeypatch.context() as broken:
        broken.setattr(Voice, "send", refuse)
        assert ends[0].conduit.send(b"header", b"") is False
    assert f"{TOPIC}: no room" in caplog.text


def test_it_is_started_once(ends: tuple[End, End]) -> None:
    with pytest.raises(UsageError, match="make a new one"):
        ends[0].start()


def test_a_topic_that_ros_refuses_is_told_at_the_start(
    ros: RosTopicSideHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conduit_module, "_TOPIC", "/no name")
    conduit = RosConduit(RosConduitOptions(domain_id=ros.domain_id))
    with pytest.raises(ConfigError, match=r"^prefix: ROS refuses '/beacon_relay/no name'"):
        conduit.start(Recorder())


def test_in_a_forked_child_nothing_is_sent_and_nothing_closed(
    ends: tuple[End, End], eventually: Eventually
) -> None:
    conduit = ends[0].conduit
    assert isinstance(conduit, RosConduit)
    conduit._pid = os.getpid() + 1
    assert conduit.send(b"header", b"") is False
    conduit.close()
    conduit._pid = os.getpid()
    assert conduit.send(b"header", b"") is True


def test_it_carries_the_largest_digest_and_the_largest_message() -> None:
    assert LIMITS.max_header_bytes >= 128 * 1024
    assert LIMITS.max_payload_bytes == 16 * 1024 * 1024
