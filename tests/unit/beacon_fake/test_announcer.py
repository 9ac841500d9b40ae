"""An announcer speaks when told and each period, and what it says can be told apart."""

from __future__ import annotations

import pytest

from beacon_core.clock import ManualClock
from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import Tap
from beacon_fake import FakeAnnouncer, FakeNetwork, FakeSource, Link

SECOND_NS = 1_000_000_000


@pytest.fixture(autouse=True)
def source(network: FakeNetwork, tap: Tap) -> FakeSource:
    source = FakeSource(network)
    source.start(tap)
    return source


def test_sequence_numbers_rise_by_one_over_all_entities(network: FakeNetwork, tap: Tap) -> None:
    announcer = FakeAnnouncer(network)
    for entity in ("a", "b", "a"):
        announcer.announce(BeaconHint(entity))
    announcer.withdraw("b")
    network.run_until_idle()
    assert [call.sequence for call in tap.calls] == [1, 2, 3, 4]
    assert {call.incarnation for call in tap.calls} == {announcer.incarnation}


def test_each_start_is_another_incarnation(network: FakeNetwork) -> None:
    first = FakeAnnouncer(network, "robot")
    first.close()
    assert FakeAnnouncer(network, "robot").incarnation != first.incarnation


def test_its_clock_offset_is_in_its_stamps(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    FakeAnnouncer(network, clock_offset_s=-2.5).announce(BeaconHint("a"))
    sent_ns = clock.wall_ns()
    network.run_until_idle()
    assert tap.calls[0].stamp_ns == sent_ns - 2_500_000_000


def test_each_entity_is_repeated_once_per_period(network: FakeNetwork, tap: Tap) -> None:
    announcer = FakeAnnouncer(network, period_s=2.0)
    for number in range(10):
        announcer.announce(BeaconHint(f"e{number}"))
    network.run_until_idle()
    for _ in range(3):
        heard = len(tap.calls)
        network.advance(2 * SECOND_NS)
        assert sorted(call.outcome.entity_id for call in tap.calls[heard:]) == [
            f"e{number}" for number in range(10)
        ]


def test_repetitions_are_spread_over_the_period(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    announcer = FakeAnnouncer(network, period_s=10.0)
    for number in range(100):
        announcer.announce(BeaconHint(f"e{number}"))
    network.run_until_idle()
    per_second = []
    for _ in range(10):
        heard = len(tap.calls)
        network.advance(SECOND_NS)
        per_second.append(len(tap.calls) - heard)
    assert sum(per_second) == 100
    assert max(per_second) <= 25


def test_a_repetition_says_the_newest(network: FakeNetwork, tap: Tap) -> None:
    announcer = FakeAnnouncer(network, period_s=1.0)
    announcer.announce(BeaconHint("a", display_name="old"))
    announcer.announce(BeaconHint("a", display_name="new"))
    network.run_until_idle()
    heard = len(tap.calls)
    network.advance(3 * SECOND_NS)
    assert len(tap.calls) == heard + 3
    assert all(b"new" in call.payload for call in tap.calls[heard:])


def test_who_is_withdrawn_and_comes_back_is_repeated_once_per_period(
    network: FakeNetwork, tap: Tap
) -> None:
    announcer = FakeAnnouncer(network, period_s=1.0)
    for _ in range(3):
        announcer.announce(BeaconHint("a"))
        announcer.withdraw("a")
    announcer.announce(BeaconHint("a"))
    network.run_until_idle()
    heard = len(tap.calls)
    network.advance(5 * SECOND_NS)
    assert len(tap.calls) == heard + 5


def test_close_says_goodbye_for_each_and_nothing_after(network: FakeNetwork, tap: Tap) -> None:
    announcer = FakeAnnouncer(network, period_s=1.0)
    announcer.announce(BeaconHint("a"))
    announcer.announce(BeaconHint("b"))
    announcer.close()
    announcer.close()
    announcer.withdraw("a")
    network.advance(5 * SECOND_NS)
    assert [call.kind for call in tap.calls] == ["offer", "offer", "goodbye", "goodbye"]
    with pytest.raises(UsageError, match="been closed"):
        announcer.announce(BeaconHint("a"))


def test_a_crashed_announcer_says_nothing_more_not_even_goodbye(
    network: FakeNetwork, tap: Tap
) -> None:
    announcer = FakeAnnouncer(network, "robot", period_s=1.0)
    announcer.announce(BeaconHint("a"))
    network.crash("robot")
    announcer.close()
    announcer.withdraw("a")
    network.advance(5 * SECOND_NS)
    assert [call.kind for call in tap.calls] == ["offer", "lost"]
    with pytest.raises(UsageError, match="crashed"):
        announcer.announce(BeaconHint("a"))


def test_a_hint_that_cannot_be_written_down_is_the_callers_mistake(network: FakeNetwork) -> None:
    with pytest.raises(UsageError):
        FakeAnnouncer(network).announce(BeaconHint("a", process_id=-1))


@pytest.mark.parametrize("period_s", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_that_cannot_be_is_refused(network: FakeNetwork, period_s: float) -> None:
    with pytest.raises(ConfigError, match="period"):
        FakeAnnouncer(network, period_s=period_s)


def test_a_name_is_taken_until_its_bearer_is_gone(network: FakeNetwork) -> None:
    first = FakeAnnouncer(network, "robot")
    with pytest.raises(ConfigError, match="robot"):
        FakeAnnouncer(network, "robot")
    first.close()
    FakeAnnouncer(network, "robot")


def test_what_was_said_before_the_close_still_arrives(network: FakeNetwork, tap: Tap) -> None:
    network.set_link(Link(latency_s=3.0))
    announcer = FakeAnnouncer(network)
    announcer.announce(BeaconHint("a"))
    announcer.close()
    assert network.run_until_idle() == 2
    assert [call.kind for call in tap.calls] == ["offer", "goodbye"]


def test_health_counts_whom_it_speaks_for_until_it_is_closed(network: FakeNetwork) -> None:
    announcer = FakeAnnouncer(network)
    for entity in ("a", "b", "a"):
        announcer.announce(BeaconHint(entity))
    announcer.withdraw("b")
    assert announcer.health().condition is Condition.UP
    assert announcer.health().counters == {"entities": 1}
    announcer.close()
    assert announcer.health().condition is Condition.CLOSED
    assert announcer.health().counters == {"entities": 0}


def test_a_crashed_announcer_is_closed(network: FakeNetwork) -> None:
    announcer = FakeAnnouncer(network, "robot")
    network.crash("robot")
    assert announcer.health().condition is Condition.CLOSED


def test_health_says_so_when_nobody_drives_the_network(
    network: FakeNetwork, clock: ManualClock
) -> None:
    announcer = FakeAnnouncer(network)
    announcer.announce(BeaconHint("a"))
    clock.advance(3 * SECOND_NS)
    health = announcer.health()
    assert health.condition is Condition.DEGRADED
    assert "deliver_due" in health.detail
    network.deliver_due()
    assert announcer.health().condition is Condition.UP
    assert not announcer.health().detail
