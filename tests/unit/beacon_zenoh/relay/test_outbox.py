from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from beacon_core.testing.harness import within
from beacon_core.testing.waiting import wait_until
from beacon_zenoh.relay.outbox import Outbox


class Carrier:
    """Takes one frame for each time it is let."""

    def __init__(self) -> None:
        self.taken: list[tuple[bytes, bytes]] = []
        self.let = threading.Semaphore(0)
        self.swift = True

    def put(self, header: bytes, payload: bytes) -> bool:
        self.let.acquire()
        swift = self.swift
        self.taken.append((header, payload))
        return swift


@pytest.fixture
def carrier() -> Iterator[Carrier]:
    carrier = Carrier()
    yield carrier
    carrier.let.release(1000)


def wait_for_idle(outbox: Outbox) -> None:
    assert wait_until(lambda: not outbox.busy, 10)


def wait_until_put(outbox: Outbox) -> None:
    """Until nothing waits any more, though the last one may still be under way."""
    assert wait_until(lambda: not outbox._waiting, 10)


def test_frames_are_put_in_order_and_then_it_is_idle(carrier: Carrier) -> None:
    outbox = Outbox(100, carrier.put)
    assert not outbox.busy
    frames = [(b"%d" % number, b"payload") for number in range(5)]
    assert all(outbox.offer(*frame) for frame in frames)
    assert outbox.busy
    carrier.let.release(5)
    wait_for_idle(outbox)
    assert carrier.taken == frames
    outbox.close(1)


def test_what_there_is_no_room_for_is_refused_also_while_one_is_being_put(carrier: Carrier) -> None:
    outbox = Outbox(20, carrier.put)
    assert outbox.offer(b"12345", b"67890")
    assert outbox.offer(b"12345", b"6789")
    assert not outbox.offer(b"1", b"2")
    assert outbox.offer(b"1", b"")
    carrier.let.release(3)
    wait_for_idle(outbox)
    assert outbox.offer(bytes(10), bytes(10))
    assert len(carrier.taken) == 3
    carrier.let.release()
    outbox.close(1)


def test_a_frame_that_waits_does_not_wait_twice_but_comes_again_when_it_has_gone(
    carrier: Carrier,
) -> None:
    outbox = Outbox(40, carrier.put)
    payload, alike = bytearray(b"payload"), bytearray(b"payload")
    first, second = bytes(payload), bytes(alike)
    assert outbox.offer(b"before", b"")
    assert outbox.offer(b"h", first)
    assert outbox.offer(b"h", first)
    # Another payload under the same header is another frame, though it be equal.
    assert outbox.offer(b"h", second)
    carrier.let.release(3)
    wait_for_idle(outbox)
    assert outbox.offer(b"h", first)
    carrier.let.release()
    wait_for_idle(outbox)
    assert [header for header, _ in carrier.taken] == [b"before", b"h", b"h", b"h"]
    outbox.close(1)


def test_after_a_slow_one_it_stays_busy_until_one_was_swift(carrier: Carrier) -> None:
    outbox = Outbox(100, carrier.put)
    carrier.swift = False
    outbox.offer(b"slow", b"")
    carrier.let.release()
    assert wait_until(lambda: carrier.taken, 10)
    carrier.swift = True
    assert outbox.busy
    outbox.offer(b"swift", b"")
    carrier.let.release()
    wait_for_idle(outbox)
    outbox.close(1)


def test_what_waits_can_be_forgotten_and_then_there_is_room(carrier: Carrier) -> None:
    outbox = Outbox(10, carrier.put)
    assert outbox.offer(b"1", b"")
    wait_until_put(outbox)
    assert outbox.offer(b"123", b"45678")
    outbox.clear()
    assert outbox.offer(b"54321", b"6789")
    carrier.let.release(2)
    wait_for_idle(outbox)
    assert carrier.taken == [(b"1", b""), (b"54321", b"6789")]
    outbox.close(1)


def test_closing_waits_for_what_is_put_but_not_for_ever_nor_for_itself(carrier: Carrier) -> None:
    outbox = Outbox(100, carrier.put)
    outbox.close(1)
    assert not outbox.offer(b"h", b"")
    hanging = Outbox(100, carrier.put)
    hanging.offer(b"h", b"")
    wait_until_put(hanging)
    hanging.offer(b"never", b"")
    within(5, lambda: hanging.close(0.05))
    carrier.let.release()
    within(5, lambda: hanging.close(10))
    assert carrier.taken == [(b"h", b"")]
    closed = threading.Event()

    def close(header: bytes, payload: bytes) -> bool:
        own.close(10)
        closed.set()
        return True

    own = Outbox(100, close)
    own.offer(b"h", b"")
    assert closed.wait(5)
