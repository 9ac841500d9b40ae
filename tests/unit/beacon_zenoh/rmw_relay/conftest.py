"""A router with peers for each test that asks for one, and topic sides that are ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from beacon_core.testing.relay.topic_harness import Watching
from beacon_zenoh.rmw_relay.harness import RmwTopicSideHarness
from beacon_zenoh.rmw_relay.topic_side import RmwTopicSide


@pytest.fixture
def robot() -> Iterator[RmwTopicSideHarness]:
    """A network."""
    made = RmwTopicSideHarness()
    yield made
    made.close()


@pytest.fixture
def started(robot: RmwTopicSideHarness) -> Callable[[], tuple[RmwTopicSide, Watching]]:
    """Makes topic sides, started, with their watchers."""

    def start() -> tuple[RmwTopicSide, Watching]:
        side, watching = robot.side(), Watching()
        side.start(watching)
        return side, watching

    return start
