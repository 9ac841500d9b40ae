"""The harness: networks that do not hear each other, strangers that differ, and a real death."""

from __future__ import annotations

import signal
from collections.abc import Callable

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no topic to test with")

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Harness, Listener
from beacon_core.wire import cdr
from beacon_ros.mortal import MortalAnnouncer
from beacon_ros_topic import ADAPTER
from beacon_ros_topic.harness import RosTopicHarness

Eventually = Callable[..., None]


def test_it_is_a_harness_of_the_adapter(harness: RosTopicHarness) -> None:
    made: Harness = harness
    assert made.adapter is ADAPTER
    assert harness.encode(BeaconHint("engine"), 7) == cdr.encode(BeaconHint("engine"), 7)


def test_each_network_is_a_domain_of_its_own(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    assert harness.options() == harness.options(0)
    assert harness.options(0).domain_id != harness.options(1).domain_id
    here, there = (Listener(harness, network=network).start() for network in (0, 1))
    harness.announcer(network=1).announce(BeaconHint("engine"))
    eventually(lambda: there.has("engine"))
    assert here.status("engine") is None


def test_each_stranger_is_a_sender_of_its_own(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    listener = Listener(harness).start()
    for sender in ("one", "two", "one"):
        harness.send_raw("engine", cdr.encode(BeaconHint("engine")), sender=sender)
    eventually(lambda: len(listener.tap.calls) == 3)
    assert len({call.source for call in listener.tap.calls}) == 2


def test_a_mortal_announcer_is_a_process_that_can_be_killed(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    listener = Listener(harness).start()
    announcer = harness.announcer(mortal=True)
    assert isinstance(announcer, MortalAnnouncer)
    announcer.announce(BeaconHint("engine"))
    eventually(lambda: listener.has("engine"))
    harness.crash(announcer)
    assert announcer.process.returncode == -signal.SIGKILL
    eventually(lambda: listener.has("engine", Status.STALE))


def test_closed_it_leaves_nobody_behind(harness: RosTopicHarness) -> None:
    source, announcer = harness.source(), harness.announcer(mortal=True)
    harness.close()
    assert source.health().condition is Condition.CLOSED
    assert announcer.health().condition is Condition.CLOSED
