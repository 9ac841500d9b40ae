"""Each topic side keeps what its port promises: the fake one, ROS over real rclpy and DDS, and the
dialect of rmw_zenoh over real Zenoh."""

from __future__ import annotations

import pytest

from beacon_core.testing.relay.topic_harness import TopicHarness
from beacon_core.testing.relay.topic_sides import TopicSideContract
from beacon_fake.topic_harness import FakeTopicHarness


class TestFakeTopicSide(TopicSideContract):
    def make_harness(self) -> TopicHarness:
        return FakeTopicHarness()


class TestRmwZenohTopicSide(TopicSideContract):
    def make_harness(self) -> TopicHarness:
        pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed")
        pytest.importorskip("xxhash", reason="xxhash is not installed")
        from beacon_zenoh.rmw_relay.harness import RmwTopicSideHarness  # noqa: PLC0415

        return RmwTopicSideHarness()


@pytest.mark.system
class TestRosTopicSide(TopicSideContract):
    def make_harness(self) -> TopicHarness:
        pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS to stand beside")
        from beacon_ros_topic.relay.harness import RosTopicSideHarness  # noqa: PLC0415

        return RosTopicSideHarness()
