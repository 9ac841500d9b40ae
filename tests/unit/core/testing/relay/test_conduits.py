"""Each check of the conduits' suite fails for a conduit that breaks what it checks."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from beacon_core.ports.conduit import ConduitLimits, FrameSink
from beacon_core.testing.relay import conduits
from beacon_core.testing.relay.conduit_harness import ConduitCapabilities, ConduitHarness
from beacon_core.testing.relay.conduits import ConduitContract
from beacon_fake.cable import FakeCable, FakeEnd
from beacon_fake.cable_harness import FakeCableHarness


class Harness(FakeCableHarness):
    """Ends of a kind of the test's choosing, and little patience."""

    patience_s = 0.4
    hang_told_within_s = 0.3
    capabilities = ConduitCapabilities()

    def __init__(self, end: type[FakeEnd]) -> None:
        super().__init__()
        self._end = end

    def conduit(self) -> FakeEnd:
        return self._end(self.cable)

    @contextmanager
    def frozen(self) -> Iterator[None]:
        # A fake end hangs, and nobody tells.
        other = FakeEnd(self.cable)
        other.start(Deaf())
        yield


class Deaf:
    def frame(self, header: bytes, payload: bytes) -> None: ...

    def link(self, *, up: bool) -> None: ...


class Alters(FakeEnd):
    def hand_in(self, header: bytes, payload: bytes) -> None:
        super().hand_in(header, payload.replace(b"\xff", b"\xfe"))


class AltersHeaders(FakeEnd):
    def hand_in(self, header: bytes, payload: bytes) -> None:
        super().hand_in(header[:100], payload)


class Invents(FakeEnd):
    def hand_in(self, header: bytes, payload: bytes) -> None:
        super().hand_in(header, payload)
        super().hand_in(header + b"!", payload)


class TwoAtOnce(FakeEnd):
    def hand_in(self, header: bytes, payload: bytes) -> None:
        assert self._sink is not None
        sink = self._sink
        sink.hook = lambda: time.sleep(0.0002)  # type: ignore[attr-defined]
        both = [threading.Thread(target=sink.frame, args=(header, payload)) for _ in range(2)]
        for one in both:
            one.start()
        for one in both:
            one.join()


class TellsTheFirstOnly(FakeCable):
    def _others(self, end: FakeEnd) -> list[FakeEnd]:
        return super()._others(end)[:1]


class HearsItself(FakeEnd):
    def send(self, header: bytes, payload: bytes) -> bool:
        self.hand_in(header, payload)
        return super().send(header, payload)


class Raises(FakeEnd):
    def send(self, header: bytes, payload: bytes) -> bool:
        if not super().send(header, payload):
            raise ValueError("it cannot be sent")
        return True


class CutsOff(FakeEnd):
    def send(self, header: bytes, payload: bytes) -> bool:
        return super().send(header, payload[: self.limits().max_payload_bytes])


class Waits(FakeEnd):
    def send(self, header: bytes, payload: bytes) -> bool:
        time.sleep(0.03)
        return super().send(header, payload)


class Narrow(FakeEnd):
    def limits(self) -> ConduitLimits:
        return ConduitLimits(1024, 1024)


class Shrinks(FakeEnd):
    numbers = itertools.count(2**20, -1)

    def limits(self) -> ConduitLimits:
        return ConduitLimits(next(self.numbers), 1024)


class StartsSlowly(FakeEnd):
    def start(self, sink: FrameSink) -> None:
        time.sleep(0.2)
        super().start(sink)


class IsUpAtOnce(FakeEnd):
    def start(self, sink: FrameSink) -> None:
        super().start(sink)
        sink.link(up=True)


class NeverDown(FakeEnd):
    def tell(self, *, up: bool) -> None:
        if up:
            super().tell(up=up)


class DownAtAnyEnd(FakeEnd):
    def close(self) -> None:
        super().close()
        for end in self._cable._ends:
            end.tell(up=False)


class ClosesSlowly(FakeEnd):
    def close(self) -> None:
        time.sleep(0.4)
        super().close()


class ClosesOnce(FakeEnd):
    def close(self) -> None:
        assert not self._closed
        super().close()


class NeverCloses(FakeEnd):
    def close(self) -> None: ...


class SendsAfterClose(FakeEnd):
    def send(self, header: bytes, payload: bytes) -> bool:
        return super().send(header, payload) or self._closed


class WaitsForItsOwnSink(FakeEnd):
    def close(self) -> None:
        if self._cable._lock._is_owned():  # type: ignore[attr-defined]
            return
        super().close()


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is too late, is so sooner: these tests wait for it."""
    monkeypatch.setattr(conduits, "_AT_ONCE_S", 0.1)
    monkeypatch.setattr(conduits, "_SEND_WITHIN_S", 0.02)
    monkeypatch.setattr(conduits, "_TOLD_WITHIN_S", 0.3)
    monkeypatch.setattr(conduits, "_SLACK_S", 0.1)
    monkeypatch.setattr(conduits, "CLOSE_WITHIN_S", 0.3)


def run(check: str, harness: ConduitHarness, *args: Any) -> None:
    try:
        getattr(ConduitContract(), check)(harness, *args)
    finally:
        with suppress(Exception):
            harness.close()


@pytest.mark.parametrize(
    ("check", "end", "args"),
    [
        ("a_payload_comes_in_unaltered", Alters, (1024,)),
        ("a_header_comes_in_unaltered", AltersHeaders, (256,)),
        ("what_comes_in_from_many_threads_was_sent_and_comes_one_at_a_time", Invents, ()),
        ("what_comes_in_from_many_threads_was_sent_and_comes_one_at_a_time", TwoAtOnce, ()),
        ("an_end_does_not_hear_itself", HearsItself, ()),
        ("what_is_too_large_is_refused_and_what_follows_is_not", Raises, ()),
        ("what_is_too_large_is_refused_and_what_follows_is_not", CutsOff, ()),
        ("sending_to_nobody_returns_soon_and_raises_nothing", Raises, ()),
        ("sending_to_nobody_returns_soon_and_raises_nothing", Waits, ()),
        ("sending_to_nobody_returns_soon_and_raises_nothing", IsUpAtOnce, ()),
        ("the_limits_are_wide_enough_and_stay_the_same", Narrow, ()),
        ("the_limits_are_wide_enough_and_stay_the_same", Shrinks, ()),
        ("start_returns_at_once_and_nothing_is_up_before_another_end_is", StartsSlowly, ()),
        ("start_returns_at_once_and_nothing_is_up_before_another_end_is", IsUpAtOnce, ()),
        ("an_end_that_closes_is_told_and_another_one_too", NeverDown, ()),
        ("while_one_of_several_is_left_the_link_is_up", DownAtAnyEnd, ()),
        ("a_link_that_breaks_is_told_and_heals", NeverDown, ()),
        ("an_end_that_hangs_holds_up_nobody_and_is_told", FakeEnd, ()),
        ("an_end_that_hangs_holds_up_nobody_and_is_told", Waits, ()),
        ("after_close_nothing_is_sent_and_nothing_told", ClosesSlowly, ()),
        ("after_close_nothing_is_sent_and_nothing_told", SendsAfterClose, ()),
        ("after_close_nothing_is_sent_and_nothing_told", NeverCloses, ()),
        ("an_end_closes_twice_and_before_it_started", ClosesOnce, ()),
        ("an_end_closes_in_the_middle_of_traffic", NeverCloses, ()),
        ("an_end_closes_from_inside_its_sink", WaitsForItsOwnSink, ()),
    ],
)
def test_a_broken_conduit_is_found_out(check: str, end: type[FakeEnd], args: Any) -> None:
    with pytest.raises((AssertionError, ValueError)):
        run(f"test_{check}", Harness(end), *args)


def test_a_carrier_that_reaches_one_of_several_is_found_out() -> None:
    harness = Harness(FakeEnd)
    harness.cable = TellsTheFirstOnly()
    with pytest.raises(AssertionError):
        run("test_every_listener_hears", harness)


def test_an_answer_that_is_lost_for_good_is_found_out() -> None:
    class LosesAnswers(FakeEnd):
        def send(self, header: bytes, payload: bytes) -> bool:
            return header != b"answer" and super().send(header, payload)

    with pytest.raises(AssertionError):
        run("test_a_sink_may_answer_from_inside_its_call", Harness(LosesAnswers))


def test_what_a_carrier_cannot_be_made_to_do_is_skipped_and_said() -> None:
    harness = Harness(FakeEnd)
    harness.capabilities = ConduitCapabilities(breaks=False)
    with pytest.raises(pytest.skip.Exception, match="breaks"):
        run("test_a_link_that_breaks_is_told_and_heals", harness)


def test_a_suite_without_a_harness_says_so() -> None:
    make: Callable[[], object] = ConduitContract().make_harness
    with pytest.raises(NotImplementedError):
        make()
