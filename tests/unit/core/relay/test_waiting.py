from __future__ import annotations

from beacon_core.relay.history import History
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.waiting import Waiting

S = 10**9


class Fixture:
    """A route that keeps ``most`` messages."""

    def __init__(self, most: int = 100, **shaping: object) -> None:
        self.history = History(Ledger(), most, Fate.EVICTED)
        self.waiting = Waiting(3, self.history, Shaping(**shaping), 0)  # type: ignore[arg-type]

    def take(self, now_ns: int = 0, *, waits: bool = True) -> None:
        self.history.take(b"header", b"x", None)
        self.waiting.took(now_ns, waits=waits)

    def head(self, now_ns: int = 0) -> int | None:
        kept = self.waiting.head(now_ns)
        return None if kept is None else kept.seq

    def send(self, now_ns: int = 0) -> int | None:
        kept = self.waiting.head(now_ns)
        if kept is None:
            return None
        self.waiting.sent(kept)
        return kept.seq


def test_new_ones_go_in_order_and_are_not_spoken_of_before() -> None:
    one = Fixture()
    assert one.send() is None
    one.take(waits=False)
    assert one.waiting.told_next() == 1
    one.take()
    one.take()
    assert one.waiting.told_next() == 1
    assert one.send() == 1
    assert one.waiting.told_next() == 2
    assert (one.send(), one.send()) == (2, None)
    assert one.waiting.told_next() == 3


def test_what_was_asked_for_goes_first_once_and_new_ones_come_by_themselves() -> None:
    one = Fixture()
    for _ in range(3):
        one.take(waits=False)
    assert one.waiting.ask(2)
    one.take()
    assert [one.waiting.ask(seq) for seq in (0, 2, 3)] == [True, True, False]
    assert [one.send() for _ in range(4)] == [2, 0, 3, None]


def test_what_is_not_held_any_more_is_passed_by() -> None:
    one = Fixture(most=2)
    one.take(waits=False)
    one.waiting.ask(0)
    for _ in range(4):
        one.take()
    assert one.waiting.told_next() == 3
    assert [one.send() for _ in range(3)] == [3, 4, None]
    one.take()
    one.history.drop_oldest(Fate.EVICTED)
    one.history.drop_oldest(Fate.EVICTED)
    assert one.send() is None
    assert one.waiting.told_next() == 6


def test_what_is_too_old_does_not_go() -> None:
    one = Fixture(most=3, max_age_ns=10)
    assert one.waiting.fresh_from(0) == 0
    for now in (0, 1, 2, 9):
        one.take(now)
    assert one.waiting.fresh_from(2) == 1
    assert one.waiting.fresh_from(10) == 1
    assert one.waiting.fresh_from(11) == 2
    assert one.head(12) == 3
    assert one.head(19) is None
    assert one.waiting.fresh_from(19) == 4
    assert Fixture().waiting.fresh_from(10**18) == 0


def test_its_own_rates_let_pass_what_both_let_pass() -> None:
    one = Fixture(rate_hz=10, bytes_per_s=1000).waiting
    assert one.passes(50, 0)
    assert one.passes(500, 0)
    assert not one.passes(0, 0)
    assert one.free_ns == int(0.45 * S)
    assert one.passes(0, one.free_ns)
    one.spend(0, one.free_ns)
    assert one.free_ns == int(0.55 * S)
    assert Fixture().waiting.free_ns == 0


def test_without_a_link_nothing_waits() -> None:
    one = Fixture()
    one.take(waits=False)
    one.take()
    one.waiting.ask(0)
    one.waiting.clear()
    assert one.send() is None
    assert one.waiting.told_next() == 2
