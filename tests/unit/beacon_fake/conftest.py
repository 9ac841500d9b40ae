"""A clock, a network on it, and a tap that writes down what a source calls."""

from __future__ import annotations

import pytest

from beacon_core.clock import ManualClock
from beacon_core.intake import Intake
from beacon_core.store import HintStore
from beacon_core.testing.harness import Tap
from beacon_core.wire import json
from beacon_fake import FakeNetwork


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def network(clock: ManualClock) -> FakeNetwork:
    return FakeNetwork(clock, seed=1)


@pytest.fixture
def store(clock: ManualClock) -> HintStore:
    return HintStore(clock)


@pytest.fixture
def tap(store: HintStore) -> Tap:
    return Tap(Intake(store, json.decode, source_rate=1e6, global_rate=1e6))
