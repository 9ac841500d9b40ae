"""Zenoh keeps the contract that every adapter keeps, over real sockets."""

from __future__ import annotations

from beacon_zenoh.harness import ZenohHarness

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Harness


class TestZenoh(AdapterContract):
    def make_harness(self) -> Harness:
        return ZenohHarness()
