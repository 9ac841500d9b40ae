"""A ROS domain with peers on it for each test that asks for one, and topic sides that are ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import pytest

from beacon_core.testing.relay.topic_harness import Watching

if TYPE_CHECKING:
    from beacon_ros.participant import OwnNode
    from beacon_ros_topic.relay.harness import RosTopicSideHarness
    from beacon_ros_topic.relay.topic_side import RosTopicSide


@pytest.fixture
def ros() -> Iterator[RosTopicSideHarness]:
    """What needs rclpy is imported here: without it the tests that ask for this are skipped."""
    from beacon_ros_topic.relay.harness import RosTopicSideHarness  # noqa: PLC0415

    made = RosTopicSideHarness()
    yield made
    made.close()


@pytest.fixture
def own(ros: RosTopicSideHarness) -> Iterator[OwnNode]:
    """A node of ours on that domain."""
    from beacon_ros.participant import OwnNode  # noqa: PLC0415

    made = OwnNode("test", ros.domain_id)
    yield made
    made.close()


@pytest.fixture
def started(ros: RosTopicSideHarness) -> Callable[[], tuple[RosTopicSide, Watching]]:
    """Makes topic sides, started, with their watchers."""

    def start() -> tuple[RosTopicSide, Watching]:
        side, watching = ros.side(), Watching()
        side.start(watching)
        return side, watching

    return start
