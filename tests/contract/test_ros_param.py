"""ROS parameters keep the contract that every adapter keeps, over real rclpy and DDS."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no ROS to keep the contract over")

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.contract.lifecycle import LifecycleChecks
from beacon_core.testing.harness import Harness
from beacon_ros_param.harness import RosParamHarness

pytestmark = pytest.mark.system


class TestRosParam(AdapterContract):
    """As by default: a source also listens to what nodes tell of their parameters."""

    def make_harness(self) -> Harness:
        return RosParamHarness()

    @pytest.mark.timeout(400)
    def test_a_source_that_starts_late_sees_all_of_many(self, harness: Harness) -> None:
        # To create 400 nodes takes 20 s, and a multiple of that on a busy machine.
        super().test_a_source_that_starts_late_sees_all_of_many(harness)


class TestRosParamByPollsAlone(LifecycleChecks):
    """Without parameter events, which differs in how comings and goings are seen."""

    def make_harness(self) -> Harness:
        return RosParamHarness(parameter_events=False)

    @pytest.mark.skip("takes 20 s to create 400 nodes, and nothing in it depends on events")
    def test_a_source_that_starts_late_sees_all_of_many(self, harness: Harness) -> None: ...
