"""ROS 2 over Zenoh keeps the contract that every adapter keeps, over real sockets, without ROS."""

from __future__ import annotations

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Harness
from beacon_zenoh.rmw.harness import RmwHarness


class TestZenohRmw(AdapterContract):
    def make_harness(self) -> Harness:
        return RmwHarness()
