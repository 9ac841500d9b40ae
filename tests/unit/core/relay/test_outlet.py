from __future__ import annotations

import random
from collections import Counter
from itertools import pairwise

import pytest

from beacon_core.relay.frames import HEADER_BYTES
from beacon_core.relay.history import History
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.outlet import PATIENCE, QUANTUM_BYTES, Outlet
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.waiting import Waiting

S = 10**9
RATE = 100_000.0


class Fixture:
    """Routes that wait at one outlet."""

    def __init__(self, rate: float | None = RATE) -> None:
        self.outlet = Outlet(rate, 0)
        self.now = 0
        self.routes: dict[int, Waiting] = {}

    def route(self, number: int, **shaping: object) -> Waiting:
        history = History(Ledger(), 10**9, Fate.EVICTED)
        one = Waiting(number, history, Shaping(**shaping), 0)  # type: ignore[arg-type]
        self.routes[number] = one
        return one

    def take(self, number: int, size: int = 52, count: int = 1, *, paced: bool = False) -> None:
        one = self.routes[number]
        for _ in range(count):
            one.history.take(bytes(HEADER_BYTES), bytes(size), None)
            one.took(self.now, waits=True)
        self.outlet.add(one, self.now, paced=paced)

    def next(self) -> tuple[int, int] | None:
        """Route and size of what goes now."""
        found = self.outlet.next(self.now)
        return None if found is None else (found[0].number, len(found[1].payload))

    def goes(self, count: int) -> list[int]:
        """The routes of the next frames, however long it takes."""
        order: list[int] = []
        while len(order) < count:
            due_ns = self.outlet.due_ns()
            assert due_ns is not None
            self.now = max(self.now, due_ns)
            if (found := self.next()) is not None:
                order.append(found[0])
        return order


def test_without_a_bucket_all_goes_at_once() -> None:
    one = Fixture(None)
    assert not one.outlet.limited
    assert (one.next(), one.outlet.due_ns()) == (None, None)
    one.route(1)
    one.take(1, count=3)
    one.outlet.pay(10**12, 0)
    assert [one.next() for _ in range(4)] == [(1, 52)] * 3 + [None]


def test_a_bucket_lets_no_more_go_than_its_rate_and_a_tenth_of_a_second() -> None:
    one = Fixture()
    assert one.outlet.limited
    one.route(1)
    one.take(1, count=500)
    one.goes(300)
    # 100 bytes each, with the header; the first 10,000 and one more go at once.
    assert one.now == pytest.approx((300 - 101) * 100 / RATE * S, abs=S // 1000)


def test_control_frames_are_paid_for_from_the_same_bucket() -> None:
    one = Fixture()
    one.route(1)
    one.outlet.pay(20_001, 0)
    one.take(1)
    assert one.next() is None
    assert one.outlet.due_ns() == pytest.approx(0.1 * S, rel=1e-3)


def test_the_highest_class_goes_first_and_waits_for_one_frame_at_most() -> None:
    one = Fixture()
    one.route(1)
    one.route(2, priority=7)
    one.take(1, count=500)
    one.goes(200)
    one.take(2)
    before = one.now
    assert one.goes(1) == [2]
    assert one.now - before <= 100 / RATE * S


def test_who_waits_below_gets_one_frame_in_so_many_and_classes_take_turns() -> None:
    one = Fixture()
    for number in (0, 1, 2):
        one.route(number, priority=number)
        one.take(number, count=2000)
    order = one.goes(10 * PATIENCE)
    assert Counter(order) == {2: 10 * (PATIENCE - 1), 0: 5, 1: 5}
    lower = [at for at, number in enumerate(order) if number != 2]
    assert all(b - a >= PATIENCE for a, b in pairwise(lower))


def test_a_message_of_any_class_waits_for_one_frame_of_each_lower_class_at_the_most() -> None:
    draw = random.Random(3)  # noqa: S311
    one = Fixture()
    for number in range(8):
        one.route(number, priority=number)
    waits: dict[int, Counter[int]] = {}
    for _ in range(5000):
        number = draw.randrange(8)
        if one.routes[number].new is None:
            waits[number] = Counter()
        one.take(number, draw.choice([0, 52, 952]))
        if draw.random() < 0.8 and waits:
            (gone,) = one.goes(1)
            for waiting, passed in waits.items():
                passed[gone] += gone < waiting
                assert all(count <= 1 for count in passed.values())
            waits[gone] = Counter()
            if one.routes[gone].new is None:
                del waits[gone]


def test_routes_of_one_class_get_the_same_number_of_bytes() -> None:
    one = Fixture()
    sizes = {1: 200_000, 2: 952, 3: 52}
    for number, size in sizes.items():
        one.route(number)
        one.take(number, size, count=6_000_000 // size)
    sent: Counter[int] = Counter()
    for number in one.goes(15_000):
        sent[number] += sizes[number] + HEADER_BYTES
        if sum(sent.values()) > 3 * 10**6:
            break
    assert max(sent.values()) - min(sent.values()) <= 2 * QUANTUM_BYTES + 200_000


def test_a_route_waits_for_its_own_turn_without_holding_up_others() -> None:
    one = Fixture(None)
    slow = one.route(1, rate_hz=10)
    slow.spend(0, 0)
    slow.spend(0, 0)
    one.route(2)
    one.take(1, paced=True)
    one.take(1, paced=True)
    one.take(2)
    assert [one.next(), one.next()] == [(2, 52), None]
    assert one.outlet.due_ns() == S // 10
    one.now = S // 10
    assert one.next() == (1, 52)


def test_what_has_gone_in_the_meantime_is_passed_by_and_who_is_removed_too() -> None:
    one = Fixture()
    for number in (1, 2, 3):
        one.route(number)
        one.take(number)
    later = one.route(4, rate_hz=1)
    later.spend(0, 0)
    later.spend(0, 0)
    one.take(4, paced=True)
    one.routes[1].history.drop_oldest(Fate.EVICTED)
    one.outlet.remove(one.routes[2])
    one.outlet.remove(one.routes[2])
    one.outlet.remove(later)
    assert [one.next(), one.next()] == [(3, 52), None]
    assert one.outlet.due_ns() is None
