"""Who has set a time, is rung then."""

from __future__ import annotations

import queue
import time
from collections.abc import Hashable, Iterator

import pytest

from beacon_core.clock import SystemClock
from beacon_gateway.relay.waker import Waker

MS = 10**6
SOON_S = 5.0


class Rung:
    """A waker, and whom it has rung."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.keys: queue.Queue[tuple[Hashable, int]] = queue.Queue()
        self.waker = Waker(
            self.clock, lambda key: self.keys.put((key, self.clock.monotonic_ns())), "test"
        )
        self.waker.start()

    def in_ms(self, key: Hashable, ms: int) -> int:
        due = self.clock.monotonic_ns() + ms * MS
        self.waker.set(key, due)
        return due


@pytest.fixture
def rung() -> Iterator[Rung]:
    made = Rung()
    yield made
    made.waker.close()


def test_it_rings_when_the_time_has_come_and_not_before(rung: Rung) -> None:
    due = rung.in_ms("a", 30)
    key, at = rung.keys.get(timeout=SOON_S)
    assert key == "a"
    assert at >= due


def test_an_earlier_time_is_rung_first_whoever_set_it_later(rung: Rung) -> None:
    rung.in_ms("late", 300)
    rung.in_ms("early", 20)
    assert [rung.keys.get(timeout=SOON_S)[0] for _ in range(2)] == ["early", "late"]


def test_a_time_set_anew_replaces_the_one_before(rung: Rung) -> None:
    rung.in_ms("a", 250)
    due = rung.in_ms("a", 300)
    assert rung.keys.get(timeout=SOON_S)[1] >= due
    with pytest.raises(queue.Empty):
        rung.keys.get(timeout=0.1)


def test_a_time_taken_back_is_not_rung(rung: Rung) -> None:
    rung.in_ms("a", 250)
    rung.waker.set("a", None)
    rung.waker.set("never set", None)
    rung.in_ms("b", 300)
    assert rung.keys.get(timeout=SOON_S)[0] == "b"


def test_after_the_end_it_rings_no_more(rung: Rung) -> None:
    rung.in_ms("a", 30_000)
    began = time.monotonic()
    rung.waker.close()
    rung.waker.close()
    assert time.monotonic() - began < 1.0
    assert rung.keys.empty()


def test_one_that_never_began_can_end() -> None:
    Waker(SystemClock(), print, "test").close()
