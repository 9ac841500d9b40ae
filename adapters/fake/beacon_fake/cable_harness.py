"""A fake cable as the conduits' suite wants it: whoever waits lets the frames through."""

from __future__ import annotations

from collections.abc import Callable

from beacon_core.testing.relay.conduit_harness import ConduitCapabilities, RealTimeConduitHarness
from beacon_fake.cable import FakeCable, FakeEnd

__all__ = ["FakeCableHarness"]


class FakeCableHarness(RealTimeConduitHarness):
    """A :class:`beacon_core.testing.relay.conduit_harness.ConduitHarness`."""

    capabilities = ConduitCapabilities(freezes=False)
    quiet_s = 0.02

    def __init__(self) -> None:
        self.cable = FakeCable()

    def conduit(self) -> FakeEnd:
        return self.cable.end()

    def cut(self) -> None:
        self.cable.cut()

    def mend(self) -> None:
        self.cable.mend()

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        def delivered() -> bool:
            self.cable.deliver_all()
            return predicate()

        return super().wait_until(delivered, deadline_s)
