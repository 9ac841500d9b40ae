"""What the ROS topic side does beyond what every one must: types, marks, trouble."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS to stand beside")

from beacon_core.errors import UsageError
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import Watching
from beacon_ros_topic.relay import nodes as nodes_module
from beacon_ros_topic.relay.harness import BYTES, TEXT, message
from beacon_ros_topic.relay.offer import Offer
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.topic_side import RosTopicSide
from beacon_ros_topic.relay.voice import Voice

if TYPE_CHECKING:
    from beacon_ros_topic.relay.harness import RosTopicSideHarness

Eventually = Callable[..., None]
Started = Callable[[], tuple[RosTopicSide, Watching]]

QOS = Qos(depth=10)
NEWER = TopicType(BYTES.name, f"RIHS01_{'5e' * 32}")


def publisher(handle: int, topic: str = "/topic", of: TopicType = BYTES) -> CreatePublisher:
    return CreatePublisher(handle, topic, of, QOS, 0xA)


def test_a_message_of_another_version_of_the_type_is_not_delivered(
    ros: RosTopicSideHarness, started: Started, eventually: Eventually
) -> None:
    side, watching = started()
    same, newer = (ros.publisher("/topic", of, QOS) for of in (BYTES, NEWER))
    side.subscribe(Subscribe(1, "/topic", BYTES, QOS))

    def heard() -> bool:
        newer.publish(message(b"newer"))
        same.publish(message(b"same"))
        return len(watching.heard) >= 3

    eventually(heard)
    eventually(lambda: "/topic" in side.remarks())
    assert {one.payload for one in watching.heard} == {message(b"same")}
    assert NEWER.digest[:15] in side.remarks()["/topic"]


def test_a_message_of_no_bytes_is_not_published_and_keeps_nothing_back(
    ros: RosTopicSideHarness,
    started: Started,
    eventually: Eventually,
    caplog: pytest.LogCaptureFixture,
) -> None:
    side, watching = started()
    side.create_publisher(publisher(1))
    listener = ros.subscription("/topic", BYTES, QOS)
    eventually(lambda: watching.last_match(1) == (1, 1))
    for payload in (b"", b"", message(b"said")):
        side.publish(Publish(1, payload, 0, 0xA, 1))
    eventually(lambda: listener.received() == [message(b"said")])
    assert "no bytes" in side.remarks()["/topic"]
    assert caplog.text.count("/topic: a message of no bytes") == 1


def test_the_graph_may_not_have_come_as_far_as_the_message(
    ros: RosTopicSideHarness,
    started: Started,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    side, watching = started()
    monkeypatch.setattr(side._watch, "speaker", lambda *_: None)
    peer = ros.publisher("/topic", BYTES, QOS)
    side.subscribe(Subscribe(1, "/topic", BYTES, QOS))

    def heard() -> bool:
        peer.publish(message(b"x"))
        return bool(watching.heard)

    eventually(heard)
    assert (watching.heard[0].first, watching.heard[0].hop) == (0, 0)


def test_what_cannot_be_subscribed_to_is_told_and_tried_again(
    ros: RosTopicSideHarness,
    started: Started,
    eventually: Eventually,
    caplog: pytest.LogCaptureFixture,
) -> None:
    side, watching = started()
    side.create_publisher(publisher(1, of=TEXT))
    eventually(lambda: watching.last_match(1) is not None)
    peer = ros.publisher("/topic", BYTES, QOS)
    side.subscribe(Subscribe(2, "/topic", BYTES, QOS))
    eventually(lambda: "ROS refuses to subscribe" in side.remarks().get("/topic", ""))
    side.destroy_publisher(1)
    for number in range(3):
        ros.publisher(f"/change_{number}", BYTES, QOS)

    def heard() -> bool:
        peer.publish(message(b"x"))
        return bool(watching.payloads(2))

    eventually(heard)
    assert side.remarks() == {}
    assert len([one for one in caplog.records if "cannot be subscribed to" in one.message]) == 1


def test_what_cannot_be_subscribed_to_may_be_given_up(
    started: Started, eventually: Eventually
) -> None:
    side, _ = started()
    side.subscribe(Subscribe(1, "no name!", BYTES, QOS))
    eventually(lambda: "no name!" in side.remarks())
    side.unsubscribe(1)
    eventually(lambda: not side.remarks())


def test_marks_beyond_the_most_go_out_under_that_of_the_route(
    ros: RosTopicSideHarness,
    started: Started,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(nodes_module, "MAX_MARKS", 1)
    (one, one_watching), (other, other_watching) = started(), started()
    one.create_publisher(publisher(1))
    eventually(lambda: "/topic" in other_watching.topics)
    other.subscribe(Subscribe(5, "/topic", BYTES, QOS))
    eventually(lambda: one_watching.last_match(1) == (1, 1))
    one.publish(Publish(1, message(b"x"), 0, 0xB, 2))
    eventually(lambda: other_watching.heard)
    assert (other_watching.heard[0].first, other_watching.heard[0].hop) == (0xA, 1)
    one.create_publisher(CreatePublisher(2, "/other", BYTES, QOS, 0xC))
    eventually(lambda: one_watching.last_match(2) is not None)


def test_a_name_that_ros_refuses_is_told_with_its_words(
    started: Started, eventually: Eventually, capfd: pytest.CaptureFixture[str]
) -> None:
    side, watching = started()
    side.create_publisher(publisher(1, "/no name"))
    side.create_publisher(publisher(2, of=TEXT))
    side.create_publisher(publisher(3, of=BYTES))
    eventually(lambda: len(watching.failures) == 2)
    told = dict(watching.failures)
    assert told[1].startswith("ROS makes no publisher of /no name: ")
    assert told[3].startswith("ROS makes no publisher of /topic: ")
    assert "\n" not in told[1] + told[3]
    assert capfd.readouterr() == ("", "")


def test_a_publisher_that_breaks_is_told(
    started: Started, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    side, watching = started()
    for handle in (1, 2):
        side.create_publisher(publisher(handle, f"/topic_{handle}"))
        eventually(lambda handle=handle: watching.last_match(handle) is not None)

    def refuse(*_: object) -> None:
        raise RuntimeError("publishing failed: no room")

    monkeypatch.setattr(Voice, "send", refuse)
    side.publish(Publish(1, message(b"x"), 0, 0xA, 1))
    side.publish(Publish(2, message(b"x"), 0, 0xB, 1))
    eventually(lambda: len(watching.failures) == 2)
    assert all("no room" in reason for _, reason in watching.failures)


def test_what_is_held_at_the_end_goes_out(
    ros: RosTopicSideHarness, started: Started, eventually: Eventually
) -> None:
    side, watching = started()
    peer = ros.subscription("/topic", BYTES, QOS)
    side.create_publisher(publisher(1))
    eventually(lambda: watching.last_match(1) == (1, 1))

    def heard() -> bool:
        side.publish(Publish(1, message(b"heard?"), 0, 0xA, 1))
        return bool(peer.received())

    eventually(heard)  # DDS may lose what is said right after a match
    side.publish(Publish(1, message(b"1"), 0, 0xA, 1))
    side.close()
    eventually(lambda: message(b"1") in peer.received())
    assert peer.received().count(message(b"1")) == 1


def test_what_ros_refuses_at_the_end_is_logged(
    started: Started,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    side, watching = started()
    side.create_publisher(publisher(1))
    eventually(lambda: watching.last_match(1) is not None)

    def refuse(*_: object, **__: object) -> bool:
        raise RuntimeError("no room")

    monkeypatch.setattr(Offer, "flush", refuse)
    side.close()
    assert "/topic: no room" in caplog.text


def test_it_is_started_once(ros: RosTopicSideHarness, started: Started) -> None:
    side, watching = started()
    with pytest.raises(UsageError, match="make a new one"):
        side.start(watching)
    closed = ros.side()
    closed.close()
    with pytest.raises(UsageError, match="make a new one"):
        closed.start(watching)
    assert closed.remarks() == {}


def test_in_a_forked_child_closing_does_nothing(started: Started, eventually: Eventually) -> None:
    side, watching = started()
    side._pid = os.getpid() + 1
    side.close()
    side._pid = os.getpid()
    side.create_publisher(publisher(1))
    eventually(lambda: watching.last_match(1) == (0, 0))


def test_nothing_is_left_of_it(
    ros: RosTopicSideHarness, eventually: Eventually, leaves_nothing: Callable[..., None]
) -> None:
    def once() -> None:
        side, watching = RosTopicSide(RosNetworkOptions(domain_id=ros.domain_id)), Watching()
        side.start(watching)
        side.create_publisher(publisher(1))
        side.subscribe(Subscribe(2, "/topic", BYTES, QOS))
        eventually(lambda: watching.last_match(1) is not None)
        side.publish(Publish(1, message(b"x"), 0, 0xB, 1))
        side.close()

    leaves_nothing(once, times=10)
