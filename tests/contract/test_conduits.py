"""Every conduit keeps the promises of the port: in memory, and over real sockets."""

from __future__ import annotations

import pytest

from beacon_core.testing.relay.conduit_harness import ConduitHarness, RealTimeConduitHarness
from beacon_core.testing.relay.conduits import ConduitContract
from beacon_fake.cable_harness import FakeCableHarness
from beacon_local import LocalConduit
from beacon_zenoh.relay.harness import ZenohConduitHarness, ZenohRouterConduitHarness


class _LocalHarness(RealTimeConduitHarness):
    quiet_s = 0.02

    def conduit(self) -> LocalConduit:
        # A name that no other test of this process has.
        return LocalConduit(f"{id(self):x}")


class TestFake(ConduitContract):
    def make_harness(self) -> ConduitHarness:
        return FakeCableHarness()


class TestLocal(ConduitContract):
    def make_harness(self) -> ConduitHarness:
        return _LocalHarness()


class TestZenoh(ConduitContract):
    """The first end is the router of the others, as a base station is that of its robots."""

    def make_harness(self) -> ConduitHarness:
        return ZenohConduitHarness()

    @pytest.mark.system
    def test_an_end_that_hangs_holds_up_nobody_and_is_told(self, harness: ConduitHarness) -> None:
        super().test_an_end_that_hangs_holds_up_nobody_and_is_told(harness)


class TestZenohThroughARouter(TestZenoh):
    """All ends are clients of a router that stands between them."""

    def make_harness(self) -> ConduitHarness:
        return ZenohRouterConduitHarness()
