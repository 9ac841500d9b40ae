"""A source hands over what arrives, until it is closed, whatever its sink does."""

from __future__ import annotations

import logging
import threading

import pytest

from beacon_core.clock import ManualClock
from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import CLOSE_WITHIN_S, Tap, within
from beacon_fake import FakeAnnouncer, FakeNetwork, FakeSource, Kind, Message

SECOND_NS = 1_000_000_000


def test_health_tells_the_state_and_counts_the_calls(network: FakeNetwork, tap: Tap) -> None:
    source = FakeSource(network)
    assert source.health().condition is Condition.STARTING
    source.start(tap)
    assert source.health().condition is Condition.UP
    FakeAnnouncer(network).announce(BeaconHint("a"))
    network.run_until_idle()
    assert source.health().counters == {"calls": 1, "sink-faults": 0}
    source.close()
    assert source.health().condition is Condition.CLOSED


def test_health_says_so_when_nobody_drives_the_network(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    source = FakeSource(network)
    source.start(tap)
    FakeAnnouncer(network).announce(BeaconHint("a"))
    clock.advance(3 * SECOND_NS)
    health = source.health()
    assert health.condition is Condition.DEGRADED
    assert "deliver_due" in health.detail
    network.deliver_due()
    assert source.health().condition is Condition.UP


def test_a_sink_that_raises_is_reported_once_counted_and_called_again(
    network: FakeNetwork, tap: Tap, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        raise RuntimeError("broken sink")

    source = FakeSource(network, "gateway")
    source.start(tap)
    tap.hook = fail
    announcer = FakeAnnouncer(network)
    with caplog.at_level(logging.ERROR, "beacon_fake.source"):
        for number in range(3):
            announcer.announce(BeaconHint(f"e{number}"))
        network.run_until_idle()
    assert len(caplog.records) == 1
    assert "gateway" in caplog.text
    assert source.health().counters == {"calls": 3, "sink-faults": 3}
    assert source.health().condition is Condition.DEGRADED
    tap.hook = None
    announcer.announce(BeaconHint("after"))
    network.run_until_idle()
    assert [call.outcome.entity_id for call in tap.calls] == ["after"]


def test_a_source_starts_once_and_not_after_close(network: FakeNetwork, tap: Tap) -> None:
    source = FakeSource(network)
    source.start(tap)
    with pytest.raises(UsageError, match="started before"):
        source.start(tap)
    source.close()
    with pytest.raises(UsageError, match="closed"):
        source.start(tap)


def test_a_source_whose_name_is_taken_may_start_once_it_is_free(
    network: FakeNetwork, tap: Tap
) -> None:
    first, second = FakeSource(network, "gateway"), FakeSource(network, "gateway")
    first.start(tap)
    with pytest.raises(ConfigError, match="gateway"):
        second.start(tap)
    first.close()
    second.start(tap)
    FakeAnnouncer(network).announce(BeaconHint("a"))
    network.run_until_idle()
    assert second.health().counters["calls"] == 1


def test_a_message_to_a_closed_source_does_not_reach_its_successor(
    network: FakeNetwork, tap: Tap
) -> None:
    first = FakeSource(network, "gateway")
    first.start(tap)
    announcer = FakeAnnouncer(network)
    announcer.announce(BeaconHint("a"))
    first.close()
    announcer.withdraw("a")
    FakeSource(network, "gateway").start(tap)
    network.run_until_idle()
    assert not tap.calls
    assert network.counters()["unheard"] == 1


def test_a_message_in_hand_when_the_source_closes_is_not_passed_on(
    network: FakeNetwork, tap: Tap
) -> None:
    source = FakeSource(network)
    source.receive(Message(Kind.HINT, "early"))
    source.start(tap)
    source.close()
    source.receive(Message(Kind.HINT, "late"))
    assert not tap.calls


def test_close_gives_up_on_a_callback_that_does_not_end(network: FakeNetwork, tap: Tap) -> None:
    entered, release = threading.Event(), threading.Event()

    def hold() -> None:
        entered.set()
        release.wait(10 * CLOSE_WITHIN_S)

    source = FakeSource(network)
    source.start(tap)
    tap.hook = hold
    FakeAnnouncer(network).announce(BeaconHint("a"))
    driver = threading.Thread(target=network.run_until_idle)
    driver.start()
    assert entered.wait(10)
    within(9 * CLOSE_WITHIN_S, source.close)
    assert driver.is_alive()
    release.set()
    within(10, driver.join)
