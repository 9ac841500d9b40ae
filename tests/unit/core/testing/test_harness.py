"""What a harness gets for nothing: waiting in real time, a tap, a listener, a deadline."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.outcome import Outcome, Verdict
from beacon_core.testing.harness import (
    Call,
    Capabilities,
    Harness,
    Listener,
    RealTimeHarness,
    Tap,
    within,
)
from beacon_fake import ADAPTER, FakeNetwork, FakeOptions, share_network, unshare_network
from beacon_fake.harness import FakeHarness


class FakeInRealTime(RealTimeHarness):
    """The fake network on the system's clock, driven whenever somebody waits."""

    adapter = ADAPTER

    def __init__(self) -> None:
        super().__init__()
        self.network = FakeNetwork(self.clock)
        self.name = f"real-{id(self)}"
        share_network(self.network, self.name)

    def options(self, network: int = 0) -> FakeOptions:
        return FakeOptions(network=self.name)

    def wait_until(self, predicate: Any, deadline_s: float) -> bool:
        def driven() -> bool:
            self.network.deliver_due()
            return bool(predicate())

        return super().wait_until(driven, deadline_s)

    def close(self) -> None:
        super().close()
        unshare_network(self.name)


class Answers:
    """A sink with an answer for everything."""

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        return Outcome(Verdict.NEW, "offered")

    def goodbye(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return Outcome(Verdict.LEFT, entity_id)

    def lost(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return Outcome(Verdict.LOST, entity_id)


@pytest.fixture
def real() -> Iterator[FakeInRealTime]:
    harness = FakeInRealTime()
    yield harness
    harness.close()


# RealTimeHarness


def test_waiting_in_real_time_ends_when_the_predicate_holds(real: FakeInRealTime) -> None:
    looks = iter([False, False, True])
    assert real.wait_until(lambda: next(looks), 60.0)


def test_waiting_in_real_time_ends_at_the_deadline_and_not_before(real: FakeInRealTime) -> None:
    begin = time.monotonic()
    assert not real.wait_until(lambda: False, 0.05)
    assert time.monotonic() - begin >= 0.05


def test_a_real_harness_makes_both_ends_and_closes_them(real: FakeInRealTime) -> None:
    source, announcer = real.source(), real.announcer(1.0, mortal=True)
    real.close()
    real.close()
    assert source.health().condition == "closed"
    with pytest.raises(Exception, match="closed"):
        announcer.announce(BeaconHint("a"))


def test_who_pushes_falls_silent_by_itself(real: FakeInRealTime) -> None:
    announcer = real.announcer()
    with real.silenced(announcer):
        assert announcer.health().condition == "up"


def test_a_real_harness_must_say_how_its_options_are_made() -> None:
    with pytest.raises(NotImplementedError):
        RealTimeHarness().options()


def test_a_real_harness_with_its_four_methods_is_a_harness() -> None:
    class Whole(FakeInRealTime):
        def crash(self, announcer: Any) -> None: ...

        def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
            return b""

        def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "") -> None: ...

    harness: Harness = Whole()
    assert harness.capabilities == Capabilities()
    harness.close()


# Tap


def test_the_tap_passes_on_and_writes_down_every_kind_of_call() -> None:
    tap = Tap(Answers())
    tap.offer(b"x", "s", entity_id="a", stamp_ns=1, incarnation="i", sequence=2)
    tap.goodbye("a", "s", incarnation="i", sequence=3)
    tap.lost("a", "s", incarnation="i", reason="gone")
    assert tap.calls == [
        Call("offer", b"x", "s", Outcome(Verdict.NEW, "offered"), "i", 2, 1, "a"),
        Call("goodbye", b"", "s", Outcome(Verdict.LEFT, "a"), "i", 3),
        Call("lost", b"", "s", Outcome(Verdict.LOST, "a"), "i"),
    ]
    assert [call.verdict for call in tap.calls] == [Verdict.NEW, Verdict.LEFT, Verdict.LOST]


def test_the_tap_repeats_a_call_as_it_was() -> None:
    tap = Tap(Answers())
    tap.offer(b"x", "s", entity_id="a", stamp_ns=1, incarnation="i", sequence=2)
    tap.repeat(tap.calls[0])
    assert tap.calls[0] == tap.calls[1]


def test_what_the_hook_raises_goes_to_the_source_and_nothing_is_passed_on() -> None:
    def fail() -> None:
        raise RuntimeError("from the hook")

    tap = Tap(Answers())
    tap.hook = fail
    with pytest.raises(RuntimeError, match="from the hook"):
        tap.lost("a", "s")
    assert not tap.calls
    assert not tap.failures


def test_what_the_sink_raises_is_kept_as_its_failure() -> None:
    class Raises(Answers):
        def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
            raise RuntimeError("from the sink")

    tap = Tap(Raises())
    with pytest.raises(RuntimeError):
        tap.offer(b"", "s")
    assert [str(failure) for failure in tap.failures] == ["from the sink"]


# Listener


def test_a_listener_tells_what_its_store_knows() -> None:
    harness = FakeHarness()
    listener = Listener(harness).start()
    assert listener.status("a") is None
    assert not listener.has("a")
    assert not listener.says("a", "")
    harness.announcer().announce(BeaconHint("a", display_name="name"))
    assert harness.wait_until(lambda: listener.has("a"), 1.0)
    assert listener.status("a") is Status.ACTIVE
    assert listener.says("a", "name")
    assert not listener.says("a", "another")
    assert listener.count(Verdict.NEW, Verdict.CHANGED) == 1
    harness.close()


def test_a_restarted_listener_keeps_its_store() -> None:
    harness = FakeHarness()
    listener = Listener(harness).start()
    first = listener.source
    announcer = harness.announcer()
    announcer.announce(BeaconHint("a"))
    assert harness.wait_until(lambda: listener.has("a"), 1.0)
    listener.restart()
    assert listener.source is not first
    assert listener.has("a")
    announcer.announce(BeaconHint("b"))
    assert harness.wait_until(lambda: listener.has("b"), 1.0)
    harness.close()


# within


def test_within_lets_an_action_end_in_its_own_thread() -> None:
    threads: list[int] = []
    within(10.0, lambda: threads.append(threading.get_ident()))
    assert threads != [threading.get_ident()]


def test_within_raises_what_the_action_raised() -> None:
    def fail() -> None:
        raise LookupError("from the action")

    with pytest.raises(LookupError, match="from the action"):
        within(10.0, fail)


def test_within_fails_for_an_action_that_does_not_end_in_time() -> None:
    release = threading.Event()
    with pytest.raises(AssertionError, match=r"within 0\.05 s"):
        within(0.05, lambda: release.wait(60.0))
    release.set()
