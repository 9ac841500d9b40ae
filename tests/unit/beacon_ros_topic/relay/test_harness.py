"""The harnesses do what the suites ask of them: peers come, vanish, hang."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS")

from beacon_core.relay.values import Qos
from beacon_core.testing.relay.conduit_harness import End
from beacon_core.testing.relay.topic_harness import Watching
from beacon_ros_topic.relay.conduit_harness import RosConduitHarness
from beacon_ros_topic.relay.harness import BYTES, message
from beacon_ros_topic.relay.topic_side import RosTopicSide

if TYPE_CHECKING:
    from beacon_ros_topic.relay.harness import RosTopicSideHarness

Eventually = Callable[..., None]
Started = Callable[[], tuple[RosTopicSide, Watching]]


@pytest.fixture
def conduits() -> Iterator[RosConduitHarness]:
    made = RosConduitHarness()
    yield made
    made.close()


def test_a_mortal_publisher_comes_and_vanishes(
    ros: RosTopicSideHarness, started: Started, eventually: Eventually
) -> None:
    _, watching = started()
    mortal = ros.publisher("/topic", BYTES, Qos(), mortal=True)
    eventually(lambda: "/topic" in watching.topics)
    with pytest.raises(NotImplementedError):
        mortal.publish(b"")
    ros.crash(mortal)
    eventually(lambda: "/topic" not in watching.topics)


def test_a_peer_that_has_closed_hears_and_says_nothing(
    ros: RosTopicSideHarness, started: Started, eventually: Eventually
) -> None:
    _, watching = started()
    publisher = ros.publisher("/topic", BYTES, Qos())
    peer = ros.subscription("/topic", BYTES, Qos())
    publisher.publish(ros.message(b"x"))
    eventually(lambda: peer.received() == [message(b"x")])
    for one in (publisher, publisher, peer, peer):
        one.close()
    eventually(lambda: "/topic" not in watching.topics)


def test_another_end_of_a_conduit_is_stopped_and_goes_on(
    conduits: RosConduitHarness, eventually: Eventually
) -> None:
    end = End(conduits.conduit()).start()
    with conduits.frozen():
        eventually(lambda: not end.sink.up)
    eventually(lambda: end.sink.up)
