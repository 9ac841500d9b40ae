"""The conformance suite of conduits: what every one, ours or a stranger's, is run through.

Make a subclass whose name pytest collects, and give it a harness::

    class TestMyConduit(ConduitContract):
        def make_harness(self) -> ConduitHarness:
            return MyHarness()

The promises are those of :mod:`beacon_core.ports.conduit`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from beacon_core.testing.harness import CLOSE_WITHIN_S, within
from beacon_core.testing.relay.conduit_harness import ConduitHarness, End, SentOnce

__all__ = ["ConduitContract"]

_Predicate = Callable[[], bool]

_SEND_WITHIN_S = 0.25
_TOLD_WITHIN_S = 2.0
_AT_ONCE_S = 0.5
_SLACK_S = 0.5
"""What a busy machine may add, until whoever is to tell or to be told has had its turn."""
_AGAIN_S = 0.1
"""A frame may be lost: so long after, the checks send it again."""
_LEAST_HEADER_BYTES = 128 * 1024
_EVERY_BYTE = bytes(range(255, -1, -1))
_STATM = Path("/proc/self/statm")
_PAGE_BYTES = 4096
_OWN_GROWTH_BYTES = 48 * 1024 * 1024
"""What a process may grow besides what waits: allocators keep what they are given back."""


class ConduitContract:
    """A subclass gives :meth:`make_harness`; every check gets a new one and closes it."""

    def make_harness(self) -> ConduitHarness:
        """A harness with no ends yet."""
        raise NotImplementedError

    @pytest.fixture
    def harness(self) -> Iterator[ConduitHarness]:
        harness = self.make_harness()
        try:
            yield harness
        finally:
            harness.close()

    # Frames

    @pytest.mark.parametrize("size", [0, 1, 1024, 1024 * 1024, "most"])
    def test_a_payload_comes_in_unaltered(self, harness: ConduitHarness, size: int | str) -> None:
        one, other = self.linked(harness)
        most = one.conduit.limits().max_payload_bytes
        payload = _bytes(most if isinstance(size, str) else min(size, most))
        self.arrives(harness, one, (b"header", payload), other)
        self.arrives(harness, other, (b"redaeh", payload), one)

    @pytest.mark.parametrize("size", [1, 48, 256, _LEAST_HEADER_BYTES, "most"])
    def test_a_header_comes_in_unaltered(self, harness: ConduitHarness, size: int | str) -> None:
        one, other = self.linked(harness)
        most = one.conduit.limits().max_header_bytes
        header = _bytes(most if isinstance(size, str) else size)
        self.arrives(harness, one, (header, b""), other)
        self.arrives(harness, one, (header, b"payload"), other)

    def test_what_comes_in_from_many_threads_was_sent_and_comes_one_at_a_time(
        self, harness: ConduitHarness
    ) -> None:
        ends = self.linked(harness, 3)
        listener, *senders = ends
        sent = [_some_frames(number, 200) for number in range(4)]

        def send(number: int) -> None:
            for frame in sent[number]:
                senders[number % 2].conduit.send(*frame)

        threads = [threading.Thread(target=send, args=(n,), daemon=True) for n in range(4)]
        for thread in threads:
            thread.start()
        # Whoever waits may be who lets the frames through.
        self.eventually(harness, lambda: not any(map(threading.Thread.is_alive, threads)), "sent")
        for sender in senders:
            self.arrives(harness, sender, (b"the last", b""), listener)
        allowed = {(b"the last", b""), *(frame for some in sent for frame in some)}
        for end in ends:
            assert set(end.sink.frames) <= allowed
            assert not end.sink.overlapped

    def test_every_listener_hears(self, harness: ConduitHarness) -> None:
        speaker, *listeners = self.linked(harness, 4)
        self.arrives(harness, speaker, (b"to all", b"payload"), *listeners)

    def test_an_end_does_not_hear_itself(self, harness: ConduitHarness) -> None:
        self.needs(harness, "ignores_own")
        one, other = self.linked(harness)
        self.arrives(harness, one, (b"header", b"payload"), other)
        self.never(harness, lambda: bool(one.sink.frames), "a frame of its own")

    def test_a_sink_may_answer_from_inside_its_call(self, harness: ConduitHarness) -> None:
        one, other = self.linked(harness)
        other.sink.hook = lambda: other.conduit.send(b"answer", b"")
        self.arrives(harness, one, (b"question", b""), other)
        self.eventually(harness, lambda: one.heard((b"answer", b"")), "the answer")

    # Refusals

    def test_what_is_too_large_is_refused_and_what_follows_is_not(
        self, harness: ConduitHarness
    ) -> None:
        one, other = self.linked(harness)
        limits = one.conduit.limits()
        assert one.conduit.send(b"header", bytes(limits.max_payload_bytes + 1)) is False
        assert one.conduit.send(bytes(limits.max_header_bytes + 1), b"") is False
        self.arrives(harness, one, (b"header", b"payload"), other)
        assert {len(payload) for _, payload in other.sink.frames} == {len(b"payload")}

    def test_sending_to_nobody_returns_soon_and_raises_nothing(
        self, harness: ConduitHarness
    ) -> None:
        alone = End(harness.conduit())
        _sends(alone, 2)
        alone.start()
        _sends(alone, 20)
        assert not alone.sink.up

    def test_the_limits_are_wide_enough_and_stay_the_same(self, harness: ConduitHarness) -> None:
        one, _ = self.linked(harness)
        limits = one.conduit.limits()
        assert limits.max_header_bytes >= _LEAST_HEADER_BYTES
        assert limits.max_payload_bytes > 0
        assert harness.conduit().limits() == limits
        one.conduit.close()
        assert one.conduit.limits() == limits

    # The link

    def test_start_returns_at_once_and_nothing_is_up_before_another_end_is(
        self, harness: ConduitHarness
    ) -> None:
        alone = End(harness.conduit())
        within(_AT_ONCE_S, alone.start)
        self.never(harness, lambda: alone.sink.up, "a link to nobody")
        other = End(harness.conduit()).start()
        self.eventually(harness, lambda: alone.sink.up and other.sink.up, "the link is up")

    def test_an_end_that_closes_is_told_and_another_one_too(self, harness: ConduitHarness) -> None:
        one, other = self.linked(harness)
        closed_at = time.monotonic()
        other.conduit.close()
        self.is_down(harness, closed_at, _TOLD_WITHIN_S, one)
        again = End(harness.conduit()).start()
        self.eventually(harness, lambda: one.sink.up and again.sink.up, "the link is up again")
        self.arrives(harness, one, (b"header", b"again"), again)

    def test_while_one_of_several_is_left_the_link_is_up(self, harness: ConduitHarness) -> None:
        one, other, third = self.linked(harness, 3)
        third.conduit.close()
        self.arrives(harness, one, (b"header", b"payload"), other)
        self.never(harness, lambda: not one.sink.up, "the link to the other is down")

    def test_a_link_that_breaks_is_told_and_heals(self, harness: ConduitHarness) -> None:
        self.needs(harness, "breaks")
        one, other = self.linked(harness)
        self.arrives(harness, one, (b"header", b"before"), other)
        cut_at = time.monotonic()
        harness.cut()
        self.is_down(harness, cut_at, _TOLD_WITHIN_S, one, other)
        _sends(one, 10)
        self.never(harness, lambda: one.sink.up or other.sink.up, "a link that is cut")
        harness.mend()
        self.eventually(harness, lambda: one.sink.up and other.sink.up, "the link is up again")
        self.arrives(harness, one, (b"header", b"after"), other)
        self.arrives(harness, other, (b"header", b"back"), one)

    def test_an_end_that_hangs_holds_up_nobody_and_is_told(self, harness: ConduitHarness) -> None:
        self.needs(harness, "freezes")
        one = End(harness.conduit()).start()
        with harness.frozen():
            frozen_at, before = time.monotonic(), _resident_bytes()
            self.eventually(harness, lambda: one.sink.up, "the link is up")
            payload = _bytes(256 * 1024)
            self.is_down(
                harness,
                frozen_at,
                harness.hang_told_within_s,
                one,
                meanwhile=lambda: _sends(one, 10, payload),
            )
            _sends(one, 100, b"small")
            assert _resident_bytes() - before < harness.waiting_bytes + _OWN_GROWTH_BYTES
        self.eventually(harness, lambda: one.sink.up, "the link is up again")

    # Closing

    def test_after_close_nothing_is_sent_and_nothing_told(self, harness: ConduitHarness) -> None:
        one, other = self.linked(harness)
        self.arrives(harness, one, (b"header", b"payload"), other)
        within(CLOSE_WITHIN_S, other.conduit.close)
        heard, told = len(other.sink.frames), len(other.sink.links)
        assert other.conduit.send(b"header", b"late") is False
        _sends(one, 20)
        one.conduit.close()
        self.never(
            harness,
            lambda: (len(other.sink.frames), len(other.sink.links)) != (heard, told),
            "a call after close",
        )
        assert not one.heard((b"header", b"late"))

    def test_an_end_closes_twice_and_before_it_started(self, harness: ConduitHarness) -> None:
        one, _ = self.linked(harness)
        for end in (one, End(harness.conduit())):
            within(CLOSE_WITHIN_S, end.conduit.close)
            within(CLOSE_WITHIN_S, end.conduit.close)
            assert end.conduit.send(b"header", b"") is False

    def test_an_end_closes_in_the_middle_of_traffic(self, harness: ConduitHarness) -> None:
        one, other = self.linked(harness)
        done = threading.Event()

        def send() -> None:
            while not done.is_set():
                one.conduit.send(b"header", b"payload")
                done.wait(0.0005)

        sending = threading.Thread(target=send, daemon=True)
        sending.start()
        try:
            self.eventually(harness, lambda: len(other.sink.frames) > 20, "traffic flows")
            within(CLOSE_WITHIN_S, other.conduit.close)
            heard = len(other.sink.frames)
            self.never(harness, lambda: len(other.sink.frames) > heard, "a call after close")
            within(CLOSE_WITHIN_S, one.conduit.close)
        finally:
            done.set()
        within(CLOSE_WITHIN_S, sending.join)

    def test_an_end_closes_from_inside_its_sink(self, harness: ConduitHarness) -> None:
        one, other = self.linked(harness)
        closed = threading.Event()

        def close() -> None:
            other.conduit.close()
            closed.set()

        other.sink.hook = close
        one.conduit.send(b"header", b"")
        self.eventually(harness, lambda: _again(one) or closed.is_set(), "closed from the sink")
        heard = len(other.sink.frames)
        self.never(harness, lambda: len(other.sink.frames) > heard, "a call after close")

    # What the checks share

    @staticmethod
    def needs(harness: ConduitHarness, capability: str) -> None:
        """Skip the check, and say why, if the carrier cannot do this."""
        if not getattr(harness.capabilities, capability):
            pytest.skip(f"the carrier lacks the capability {capability}")

    @staticmethod
    def eventually(harness: ConduitHarness, predicate: _Predicate, what: str) -> None:
        """Wait for ``predicate`` to hold, as long as the harness's patience lasts."""
        in_time = harness.wait_until(predicate, harness.patience_s)
        assert in_time, f"did not happen within {harness.patience_s} s: {what}"

    @staticmethod
    def never(harness: ConduitHarness, predicate: _Predicate, what: str) -> None:
        """Listen for a while and insist that ``predicate`` does not hold at any moment."""
        assert not harness.wait_until(predicate, harness.quiet_s), f"must not happen: {what}"

    def linked(self, harness: ConduitHarness, count: int = 2) -> list[End]:
        """So many ends that are started, and have all been told that there is a link."""
        ends = [End(harness.conduit()).start() for _ in range(count)]
        self.eventually(harness, lambda: all(end.sink.up for end in ends), "the link is up")
        return ends

    def arrives(
        self, harness: ConduitHarness, sender: End, frame: SentOnce, *listeners: End
    ) -> None:
        """Send the frame, again and again since it may be lost, until all have heard it."""
        sent_at = [-_AGAIN_S]

        def done() -> bool:
            if all(listener.heard(frame) for listener in listeners):
                return True
            if time.monotonic() - sent_at[0] >= _AGAIN_S:
                sender.conduit.send(*frame)
                sent_at[0] = time.monotonic()
            return False

        self.eventually(harness, done, f"{frame[0][:16]!r} of {len(frame[1])} bytes arrives")

    def is_down(
        self,
        harness: ConduitHarness,
        since: float,
        within_s: float,
        *ends: End,
        meanwhile: Callable[[], object] = lambda: None,
    ) -> None:
        """Insist that all are told in time; until then ``meanwhile`` is done, again and again.

        The harness's wait says what is in time, not a clock: that goes on while a machine stands
        still.
        """

        def all_told() -> bool:
            if any(end.sink.up for end in ends):
                meanwhile()
            return not any(end.sink.up for end in ends)

        left_s = since + within_s + _SLACK_S - time.monotonic()
        in_time = harness.wait_until(all_told, left_s)
        assert in_time, f"not told within {within_s} s: the link is down"


def _again(end: End) -> bool:
    """Frames may be lost: send another one."""
    end.conduit.send(b"header", b"")
    return False


def _bytes(size: int) -> bytes:
    """Every byte there is, over and over."""
    return (_EVERY_BYTE * (size // len(_EVERY_BYTE) + 1))[:size]


def _some_frames(number: int, count: int) -> list[SentOnce]:
    """Frames like no others, some empty and some larger than any packet."""
    sizes = (0, 1, 100, 70_000)
    return [
        (b"%d:%d" % (number, place), _bytes(sizes[place % len(sizes)])) for place in range(count)
    ]


def _sends(end: End, count: int, payload: bytes = b"payload") -> None:
    """Send, and insist on when it returns. One may be late: that may be the machine's doing."""
    took = []
    for _ in range(count):
        began = time.monotonic()
        assert end.conduit.send(b"header", payload) in (True, False)
        took.append(time.monotonic() - began)
    assert sorted(took)[-2] <= _SEND_WITHIN_S, f"send took {max(took)} s"


def _resident_bytes() -> int:
    return int(_STATM.read_text().split()[1]) * _PAGE_BYTES
