"""Zenoh keeps the contract that every adapter keeps, over real sockets."""

from __future__ import annotations

import pytest

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.contract.lifecycle import LifecycleChecks
from beacon_core.testing.harness import Harness
from beacon_zenoh.harness import OwnRouterHarness, ZenohHarness


class TestZenoh(AdapterContract):
    """With a router between announcers and sources: the general case."""

    def make_harness(self) -> Harness:
        return ZenohHarness()


class TestZenohAsItsOwnRouter(LifecycleChecks):
    """With the source as the router: the default, which differs in who comes back to whom."""

    def make_harness(self) -> Harness:
        return OwnRouterHarness()

    @pytest.mark.skip("the other source hears nothing while the first, its router, is closed")
    def test_a_restarted_source_hears_what_it_missed(self, harness: Harness) -> None: ...
