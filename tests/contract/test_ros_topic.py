"""A ROS topic keeps the contract that every adapter keeps, over real rclpy and DDS."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS to keep the contract over")

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Harness
from beacon_ros_topic.harness import RosTopicHarness

pytestmark = pytest.mark.system


class TestRosTopic(AdapterContract):
    def make_harness(self) -> Harness:
        return RosTopicHarness()
