"""What is particular to ends of one process; the promises of the port are in tests/contract."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from beacon_core.errors import UsageError
from beacon_core.testing.harness import within
from beacon_core.testing.relay.conduit_harness import End
from beacon_local import LocalConduit, conduit

MOST = bytes(64 * 1024 * 1024)


@pytest.fixture
def ends() -> Iterator[list[End]]:
    made = [End(LocalConduit("test_conduit")).start() for _ in range(2)]
    yield made
    for end in made:
        end.conduit.close()


def test_a_frame_has_come_in_when_send_returns_in_order_and_uncopied(ends: list[End]) -> None:
    one, other = ends
    payloads = [bytes([number]) * 1000 for number in range(5)]
    for payload in payloads:
        assert one.conduit.send(b"h", payload)
    assert all(got is sent for (_, got), sent in zip(other.sink.frames, payloads, strict=True))


def test_two_ends_that_answer_each_other_a_thousand_times_do_not_call_each_other_deeper(
    ends: list[End], monkeypatch: pytest.MonkeyPatch
) -> None:
    # However busy the machine: nothing is to be lost here.
    monkeypatch.setattr(conduit, "_CARRY_S", 60.0)
    for me in ends:

        def answer(me: End = me) -> None:
            if len(me.sink.frames) < 1000:
                me.conduit.send(b"h", b"")

        me.sink.hook = answer
    ends[0].conduit.send(b"h", b"")
    assert len(ends[1].sink.frames) == 1000


def test_who_sends_while_another_is_in_the_sink_does_not_wait(ends: list[End]) -> None:
    one, other = ends
    inside, go = threading.Event(), threading.Event()

    def wait() -> None:
        inside.set()
        go.wait(10)

    other.sink.hook = wait
    first = threading.Thread(target=one.conduit.send, args=(b"first", b""))
    first.start()
    assert inside.wait(10)
    within(1, lambda: one.conduit.send(b"second", b""))
    assert other.sink.frames == [(b"first", b"")]
    go.set()
    first.join(10)
    assert other.sink.frames == [(b"first", b""), (b"second", b"")]


def test_a_sink_that_is_slower_than_who_sends_costs_a_bounded_number_of_bytes(
    ends: list[End],
) -> None:
    one, other = ends
    sent: list[bool] = []

    def send_two() -> None:
        if not sent:
            sent.extend(one.conduit.send(b"", MOST) for _ in range(2))

    other.sink.hook = send_two
    one.conduit.send(b"h", b"")
    assert sent == [True, False]
    assert one.conduit.send(b"", MOST)
    assert len(other.sink.frames) == 3


def test_who_is_kept_at_it_by_others_loses_what_is_left(
    ends: list[End], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conduit, "_CARRY_S", -1.0)
    one, other = ends
    assert one.conduit.send(b"h", b"")
    assert other.sink.frames == []
    monkeypatch.undo()
    one.conduit.send(b"h", b"again")
    assert other.sink.frames == [(b"h", b"again")]


def test_an_end_starts_once(ends: list[End]) -> None:
    with pytest.raises(UsageError):
        ends[0].start()


def test_what_was_sent_to_an_end_before_it_closed_does_not_come_in_after(ends: list[End]) -> None:
    one, other = ends

    def close_after_sending_more() -> None:
        one.conduit.send(b"more", b"")
        other.conduit.close()

    other.sink.hook = close_after_sending_more
    one.conduit.send(b"h", b"")
    assert other.sink.frames == [(b"h", b"")]
    assert one.sink.links[-1][0] is False


def test_nothing_is_left_when_all_have_closed(ends: list[End]) -> None:
    assert "test_conduit" in conduit._ends
    for end in ends:
        end.conduit.close()
    assert "test_conduit" not in conduit._ends
