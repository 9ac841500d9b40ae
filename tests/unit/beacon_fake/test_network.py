"""The network delivers in time and in order, fails as told, and repeats itself by its seed."""

from __future__ import annotations

from collections import Counter

import pytest

from beacon_core.clock import ManualClock, SystemClock
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.store import HintStore
from beacon_core.testing.harness import Call, Listener, Tap
from beacon_core.wire import json
from beacon_fake import LOCAL, STORM, FakeAnnouncer, FakeNetwork, FakeSource, Kind, Link, Message
from beacon_fake.harness import FakeHarness

SECOND_NS = 1_000_000_000


def started(network: FakeNetwork, tap: Tap, name: str = "") -> FakeSource:
    source = FakeSource(network, name)
    source.start(tap)
    return source


def names(calls: list[Call]) -> list[str]:
    """The entity ids of all calls, in order."""
    return [call.outcome.entity_id for call in calls]


# Time


def test_a_message_arrives_exactly_when_its_latency_is_over(network: FakeNetwork, tap: Tap) -> None:
    network.set_link(Link(latency_s=0.5))
    started(network, tap)
    FakeAnnouncer(network).announce(BeaconHint("a"))
    assert network.advance(SECOND_NS // 2 - 1) == 0
    assert network.advance(1) == 1
    assert names(tap.calls) == ["a"]


def test_what_is_due_earlier_arrives_earlier_and_at_its_own_time(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    begin_ns, times = clock.monotonic_ns(), list[int]()
    network.set_link(Link(latency_s=0.3), sender="slow")
    network.set_link(Link(latency_s=0.1), sender="quick")
    started(network, tap)
    tap.hook = lambda: times.append(clock.monotonic_ns() - begin_ns)
    FakeAnnouncer(network, "slow").announce(BeaconHint("slow"))
    FakeAnnouncer(network, "quick").announce(BeaconHint("quick"))
    network.advance(SECOND_NS)
    assert names(tap.calls) == ["quick", "slow"]
    assert times == [100_000_000, 300_000_000]
    assert clock.monotonic_ns() == begin_ns + SECOND_NS


def test_run_until_idle_lets_no_more_time_pass_than_needed(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    network.set_link(Link(latency_s=0.25))
    started(network, tap)
    FakeAnnouncer(network, period_s=60.0).announce(BeaconHint("a"))
    begin_ns = clock.monotonic_ns()
    assert network.run_until_idle() == 1
    assert clock.monotonic_ns() == begin_ns + SECOND_NS // 4
    assert network.run_until_idle() == 0
    assert clock.monotonic_ns() == begin_ns + SECOND_NS // 4


def test_on_a_clock_that_runs_by_itself_what_is_due_is_delivered(tap: Tap) -> None:
    network = FakeNetwork(SystemClock(), link=Link(latency_s=0.0))
    started(network, tap)
    FakeAnnouncer(network).announce(BeaconHint("a"))
    due_ns = network.next_due_ns()
    assert due_ns is not None
    assert due_ns <= SystemClock.monotonic_ns()
    assert network.deliver_due() == 1
    assert network.next_due_ns() is None
    with pytest.raises(UsageError, match="ManualClock"):
        network.advance(1)
    with pytest.raises(UsageError, match="ManualClock"):
        network.run_until_idle()


def test_the_network_is_not_driven_from_a_callback(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap)
    failures = []

    def drive() -> None:
        with pytest.raises(UsageError, match="driven") as failure:
            network.deliver_due()
        failures.append(failure)

    tap.hook = drive
    FakeAnnouncer(network).announce(BeaconHint("a"))
    assert network.run_until_idle() == 1
    assert len(failures) == 1


def test_a_callback_may_announce_and_close(network: FakeNetwork, tap: Tap) -> None:
    source, announcer = started(network, tap), FakeAnnouncer(network)

    def react() -> None:
        tap.hook = source.close
        announcer.announce(BeaconHint("b"))

    tap.hook = react
    announcer.announce(BeaconHint("a"))
    announcer.announce(BeaconHint("c"))
    network.advance(SECOND_NS)
    assert names(tap.calls) == ["a", "c"]


# Links


def test_without_reordering_a_link_keeps_the_order_whatever_its_jitter(
    clock: ManualClock, tap: Tap
) -> None:
    network = FakeNetwork(clock, seed=3, link=Link(latency_s=0.01, jitter_s=0.5))
    started(network, tap)
    announcer = FakeAnnouncer(network)
    for _ in range(200):
        announcer.announce(BeaconHint("a"))
        network.advance(1_000_000)
    network.run_until_idle()
    sequences = [call.sequence for call in tap.calls]
    assert sequences == list(range(1, 201))


def test_reordering_lets_later_messages_overtake(clock: ManualClock, tap: Tap) -> None:
    network = FakeNetwork(clock, seed=3, link=Link(reorder=0.3, reorder_by_s=0.1))
    started(network, tap)
    announcer = FakeAnnouncer(network)
    for _ in range(200):
        announcer.announce(BeaconHint("a"))
        network.advance(10_000_000)
    network.run_until_idle()
    sequences = [call.sequence for call in tap.calls]
    assert sorted(sequences) == list(range(1, 201))
    assert sequences != sorted(sequences)
    assert network.counters()["reordered"] > 30


def test_loss_and_duplication_happen_as_often_as_said(clock: ManualClock, tap: Tap) -> None:
    network = FakeNetwork(clock, seed=3, link=Link(loss=0.2, duplicate=0.1))
    started(network, tap)
    announcer = FakeAnnouncer(network)
    for _ in range(5000):
        announcer.announce(BeaconHint("a"))
    network.run_until_idle()
    counters = network.counters()
    assert counters["sent"] == 5000
    assert counters["lost"] == pytest.approx(1000, rel=0.1)
    assert counters["duplicated"] == pytest.approx(400, rel=0.2)
    times_heard = Counter(call.sequence for call in tap.calls)
    assert set(times_heard.values()) == {1, 2}


def test_the_most_particular_link_counts(network: FakeNetwork, tap: Tap) -> None:
    network.set_link(Link(loss=1.0))
    network.set_link(Link(latency_s=0.0), receiver="r")
    started(network, tap, "r")
    FakeAnnouncer(network, "by-receiver").announce(BeaconHint("by-receiver"))
    network.set_link(Link(loss=1.0), sender="s")
    sender = FakeAnnouncer(network, "s")
    sender.announce(BeaconHint("by-sender"))
    network.set_link(Link(latency_s=0.0), sender="s", receiver="r")
    sender.announce(BeaconHint("by-pair"))
    network.run_until_idle()
    assert names(tap.calls) == ["by-receiver", "by-pair"]


def test_every_message_comes_to_one_counted_end(clock: ManualClock, tap: Tap) -> None:
    network = FakeNetwork(clock, seed=5, link=STORM)
    source = started(network, tap)
    started(network, tap, "cut-off")
    announcers = [FakeAnnouncer(network, f"r{n}", period_s=0.5) for n in range(5)]
    for step in range(40):
        announcers[1 + step % 4].announce(BeaconHint(f"e{step}"))
        network.advance(SECOND_NS // 10)
        if step == 10:
            network.partition(["cut-off"])
        if step == 20:
            network.heal()
        if step == 30:
            network.crash("r0")
            source.close()
    for announcer in announcers:
        announcer.close()
    network.advance(60 * SECOND_NS)
    counters = network.counters()
    ends = sum(counters[end] for end in ("delivered", "lost", "blocked", "unheard"))
    assert counters["sent"] + counters["duplicated"] == ends
    assert all(counters.values())
    assert network.next_due_ns() is None


# Partitions and crashes


def test_a_partition_cuts_and_healing_tells_the_present(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap, "gateway")
    announcer = FakeAnnouncer(network, "robot")
    announcer.announce(BeaconHint("before"))
    network.run_until_idle()
    network.partition(["robot", "elsewhere"])
    announcer.announce(BeaconHint("meanwhile"))
    announcer.withdraw("before")
    network.run_until_idle()
    assert names(tap.calls) == ["before"]
    network.heal()
    network.run_until_idle()
    assert names(tap.calls) == ["before", "meanwhile"]


def test_a_partition_loses_what_is_under_way(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap, "gateway")
    FakeAnnouncer(network, "robot").announce(BeaconHint("a"))
    network.partition(["robot"])
    network.run_until_idle()
    assert not tap.calls
    assert network.counters()["blocked"] == 1


def test_another_partition_reunites_those_it_puts_together(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap, "gateway")
    FakeAnnouncer(network, "a").announce(BeaconHint("a"))
    FakeAnnouncer(network, "b").announce(BeaconHint("b"))
    network.partition(["a"], ["b"], ["gateway"])
    network.run_until_idle()
    assert not tap.calls
    network.partition(["b", "gateway"])
    network.run_until_idle()
    assert names(tap.calls) == ["b"]


def test_a_crash_is_noticed_after_the_last_message_that_was_under_way(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    network.set_link(Link(latency_s=1.0, detect_s=0.5))
    started(network, tap)
    announcer = FakeAnnouncer(network, "robot")
    announcer.announce(BeaconHint("a"))
    announcer.announce(BeaconHint("b"))
    network.crash("robot")
    begin_ns = clock.monotonic_ns()
    network.run_until_idle()
    assert [(call.kind, call.outcome.entity_id) for call in tap.calls] == [
        ("offer", "a"),
        ("offer", "b"),
        ("lost", "a"),
        ("lost", "b"),
    ]
    assert {call.incarnation for call in tap.calls} == {announcer.incarnation}
    assert clock.monotonic_ns() == begin_ns + 1_500_000_000


def test_a_crash_behind_a_partition_is_not_noticed(
    network: FakeNetwork, store: HintStore, tap: Tap
) -> None:
    started(network, tap, "gateway")
    FakeAnnouncer(network, "robot").announce(BeaconHint("a"))
    network.run_until_idle()
    network.partition(["robot"])
    network.crash("robot")
    network.heal()
    network.run_until_idle()
    assert [call.kind for call in tap.calls] == ["offer"]


def test_crashing_a_stranger_is_the_callers_mistake(network: FakeNetwork) -> None:
    FakeAnnouncer(network, "robot")
    with pytest.raises(UsageError, match=r"nobody.*robot"):
        network.crash("nobody")


# Strangers


def test_a_flood_is_spread_evenly_over_its_time(
    network: FakeNetwork, clock: ManualClock, tap: Tap
) -> None:
    started(network, tap)
    network.flood(
        "noisy", lambda n: json.encode(BeaconHint(f"e{n % 7}")), rate=1000.0, duration_s=2.0
    )
    per_100_ms = [network.advance(SECOND_NS // 10) for _ in range(21)]
    assert sum(per_100_ms) == 2000
    assert set(per_100_ms[1:20]) == {100}
    assert {call.source for call in tap.calls} == {"noisy"}


def test_a_flood_of_nothing_is_nothing(network: FakeNetwork) -> None:
    network.flood("noisy", lambda n: b"", rate=1000.0, duration_s=0.0)
    assert network.next_due_ns() is None


def test_anybody_may_send_anything(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap)
    network.send(Message(Kind.HINT, "stranger", payload=b"\xff", stamp_ns=-5))
    network.send(Message(Kind.GOODBYE, "stranger", entity_id="a"))
    network.run_until_idle()
    assert [(call.kind, call.payload, call.stamp_ns) for call in tap.calls] == [
        ("offer", b"\xff", -5),
        ("goodbye", b"", 0),
    ]


def test_senders_that_fall_silent_leave_nothing_behind(network: FakeNetwork, tap: Tap) -> None:
    started(network, tap)
    for number in range(100):
        network.send(Message(Kind.HINT, f"invented-{number}", payload=b""))
    network.run_until_idle()
    assert not network._connections


# Runs


def a_run(seed: int) -> list[Call]:
    """Three robots in a storm, one of which crashes, heard by two gateways."""
    harness = FakeHarness(seed=seed, link=STORM)
    first, second = Listener(harness).start(), Listener(harness)
    for number in range(3):
        announcer = harness.announcer(period_s=1.0)
        announcer.announce(BeaconHint(f"robot-{number}"))
    harness.wait_until(lambda: False, 5.0)
    second.start()
    harness.crash(announcer)
    harness.wait_until(lambda: False, 5.0)
    harness.close()
    return first.tap.calls + second.tap.calls


def test_the_same_seed_gives_the_same_run_and_another_seed_another() -> None:
    runs = [[(c.kind, c.source, c.sequence) for c in a_run(seed)] for seed in (7, 7, 8)]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_the_seed_can_be_read_from_the_network(clock: ManualClock) -> None:
    network = FakeNetwork(clock, seed=12345, link=LOCAL)
    assert network.seed == 12345
    assert "seed=12345" in repr(network)
