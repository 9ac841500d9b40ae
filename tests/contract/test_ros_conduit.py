"""A conduit over ROS topics keeps the promises of the port, over real rclpy and DDS."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS for frames to travel over")

from beacon_core.testing.relay.conduit_harness import ConduitHarness
from beacon_core.testing.relay.conduits import ConduitContract
from beacon_ros_topic.relay.conduit_harness import RosConduitHarness

pytestmark = pytest.mark.system


class TestRosConduit(ConduitContract):
    def make_harness(self) -> ConduitHarness:
        return RosConduitHarness()
