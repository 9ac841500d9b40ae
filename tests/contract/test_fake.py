"""The fake network keeps the contract that every adapter keeps."""

from __future__ import annotations

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Harness
from beacon_fake.harness import FakeHarness


class TestFake(AdapterContract):
    def make_harness(self) -> Harness:
        return FakeHarness()
