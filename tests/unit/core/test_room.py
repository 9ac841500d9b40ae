"""Who gives way in a full store, in which order, and that nobody does in vain."""

from __future__ import annotations

import random

import pytest

from beacon_core.claims import Claimant
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.limits import HINT_OVERHEAD_BYTES
from beacon_core.record import Record
from beacon_core.room import Room

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT
BASE = HINT_OVERHEAD_BYTES + 1
"""What a record of these tests is accounted for: its id has one letter."""


class House:
    """A room with records in it, as the store keeps them."""

    def __init__(self, max_hints: int = 3, max_bytes: int = 10**6) -> None:
        self.room = Room(max_hints, max_bytes)
        self.records: dict[str, Record] = {}
        self.displaced: list[str] = []

    def add(
        self, name: str, status: Status = ACTIVE, seen: int = 0, *, again: bool = False
    ) -> Record:
        record = Record(Claimant(BeaconHint(name), "", "", 0, seen), status, Cause.HEARD)
        if again:
            record.first_seen_ns -= 1
        self.records[name] = record
        self.room.enter(record)
        if status is not ACTIVE:
            self.room.offer(record, self.records)
        return record

    def become(self, name: str, status: Status, seen: int | None = None) -> None:
        record = self.records[name]
        self.room.leave(record)
        record.status = status
        record.last_seen_ns = record.last_seen_ns if seen is None else seen
        self.room.enter(record)
        if status is not ACTIVE:
            self.room.offer(record, self.records)

    def make_room(self, *, count: int = 1, size: int = BASE, grower: str = "") -> list[str]:
        self.room.victims(
            self.records,
            count=count,
            size=size,
            displace=self.displace,
            grower=self.records.get(grower),
        )
        return self.displaced

    def displace(self, record: Record) -> None:
        self.room.leave(record)
        del self.records[record.entity_id]
        self.displaced.append(record.entity_id)


# -- counting ------------------------------------------------------------------------------------


def test_records_count_by_their_status_and_bytes() -> None:
    house = House()
    house.add("a")
    house.add("b", STALE)
    house.add("c", LEFT)
    assert house.room.count == {ACTIVE: 1, STALE: 1, LEFT: 1}
    assert len(house.room) == 3
    assert house.room.total_bytes == 3 * BASE
    for name in "abc":
        house.displace(house.records[name])
    assert house.room.count == {ACTIVE: 0, STALE: 0, LEFT: 0}
    assert house.room.total_bytes == 0


@pytest.mark.parametrize("status", [ACTIVE, STALE])
def test_a_record_that_grows_takes_what_it_has_grown(status: Status) -> None:
    house = House(max_bytes=2 * BASE + 50)
    record = house.add("a", status)
    house.add("b")
    house.room.resize(record, record.size + 50)
    assert house.room.total_bytes == 2 * BASE + 50
    assert not house.room.fits(count=0, size=1)
    house.displace(record)
    assert house.room.total_bytes == BASE


# -- does it fit ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("present", "fits"), [(0, True), (2, True), (3, False)])
def test_one_more_fits_up_to_the_cap_by_count(present: int, *, fits: bool) -> None:
    house = House(max_hints=3)
    for name in "abc"[:present]:
        house.add(name, STALE)
    assert house.room.fits(count=1, size=1) is fits


def test_one_more_fits_up_to_the_cap_by_bytes() -> None:
    house = House(max_bytes=2 * BASE)
    house.add("a")
    assert house.room.fits(count=1, size=BASE)
    assert not house.room.fits(count=1, size=BASE + 1)


def test_whoever_does_not_grow_always_fits() -> None:
    house = House(max_hints=1, max_bytes=1)
    house.add("a")
    house.add("b")
    assert house.room.fits(count=0, size=0)
    assert house.room.fits(count=0, size=-10)


@pytest.mark.parametrize("idle", [STALE, LEFT])
def test_room_can_be_made_by_whoever_is_idle(idle: Status) -> None:
    house = House(max_hints=2, max_bytes=2 * BASE)
    house.add("a")
    assert house.room.can_be_made(count=1, size=BASE)
    house.add("b", idle)
    assert house.room.can_be_made(count=1, size=BASE)
    assert not house.room.can_be_made(count=1, size=BASE + 1)
    assert not house.room.can_be_made(count=2, size=BASE)


def test_no_room_can_be_made_among_the_active() -> None:
    house = House(max_hints=1)
    house.add("a")
    assert not house.room.can_be_made(count=1, size=BASE)


@pytest.mark.parametrize("status", [ACTIVE, STALE, LEFT])
def test_whoever_grows_cannot_make_room_for_itself(status: Status) -> None:
    house = House(max_bytes=2 * BASE)
    grower = house.add("a", status)
    house.add("b", STALE)
    assert house.room.can_be_made(count=0, size=BASE, grower=grower)
    assert not house.room.can_be_made(count=0, size=BASE + 1, grower=grower)


def test_what_the_active_take_follows_all_that_happens_to_them() -> None:
    house = House(max_bytes=4 * BASE)
    grown = house.add("a")
    house.room.resize(grown, 2 * BASE)
    stale = house.add("b", STALE)
    house.room.resize(stale, 2 * BASE)

    def left() -> int:
        """What could be made, in sizes of a bare hint."""
        return sum(house.room.can_be_made(count=0, size=many * BASE) for many in range(1, 6))

    assert left() == 2
    house.become("a", STALE)
    assert left() == 4
    house.become("b", ACTIVE)
    assert left() == 2
    house.displace(stale)
    assert left() == 4


# -- who gives way -------------------------------------------------------------------------------


def test_nobody_gives_way_while_it_fits() -> None:
    house = House(max_hints=3)
    house.add("a", LEFT)
    house.add("b", STALE)
    assert house.make_room() == []


def test_the_order_of_giving_way() -> None:
    house = House(max_hints=1)
    house.add("f", STALE, seen=1, again=True)
    house.add("g", STALE, seen=8, again=True)
    house.add("d", STALE, seen=3)
    house.add("e", STALE, seen=4)
    house.add("b", LEFT, seen=9)
    house.add("c", LEFT, seen=9)
    house.add("a", LEFT, seen=5, again=True)
    # Tombstones, then the heard once, then the others; by silence, and at last by id.
    assert house.make_room() == list("abcdefg")


def test_only_as_many_give_way_as_must() -> None:
    house = House(max_hints=3)
    for number, name in enumerate("abc"):
        house.add(name, STALE, seen=number)
    assert house.make_room() == ["a"]


def test_several_give_way_to_one_that_is_large() -> None:
    house = House(max_hints=10, max_bytes=4 * BASE)
    house.add("z")
    for number, name in enumerate("abc"):
        house.add(name, STALE, seen=number)
    assert house.make_room(size=2 * BASE) == ["a", "b"]


def test_the_one_that_grows_stays_and_may_give_way_the_next_time() -> None:
    house = House(max_bytes=3 * BASE)
    house.add("a", STALE, seen=1)
    house.add("b", STALE, seen=2)
    house.add("c", STALE, seen=3)
    assert house.make_room(count=0, size=BASE, grower="a") == ["b"]
    assert house.make_room(size=2 * BASE) == ["b", "a"]


def test_whoever_is_active_again_does_not_give_way() -> None:
    house = House(max_hints=2)
    house.add("a", STALE, seen=1)
    house.add("b", STALE, seen=2)
    # Heard at the very moment it was last heard, as after a loss: nothing but the status differs.
    house.become("a", ACTIVE)
    assert house.make_room() == ["b"]


def test_whoever_was_heard_again_stands_further_back() -> None:
    house = House(max_hints=2)
    house.add("a", STALE, seen=1)
    house.add("b", STALE, seen=2)
    house.become("a", STALE, seen=3)
    assert house.make_room() == ["b"]


def test_whoever_has_ended_meanwhile_is_passed_over() -> None:
    house = House(max_hints=2)
    for number, name in enumerate("abc"):
        house.add(name, STALE, seen=number)
    house.displace(house.records["a"])
    house.displaced.clear()
    house.add("d", STALE, seen=4)
    assert house.make_room() == ["b", "c"]


def test_an_id_that_came_back_stands_where_its_new_life_puts_it() -> None:
    house = House(max_hints=2)
    house.add("a", STALE, seen=1)
    house.displace(house.records["a"])
    house.displaced.clear()
    house.add("b", STALE, seen=2)
    house.add("a", STALE, seen=3)
    assert house.make_room() == ["b"]


# -- cost, and all at once -----------------------------------------------------------------------


def test_outdated_entries_do_not_pile_up() -> None:
    house = House(max_hints=10)
    for number, name in enumerate("abc"):
        house.add(name, STALE, seen=number)
    for seen in range(1000):
        house.become("a", ACTIVE, seen)
        house.become("a", STALE)
    assert len(house.room._idle) <= 2 * 3 + 64
    house.room.max_hints = 1
    assert house.make_room() == ["b", "c", "a"]


def test_whatever_happened_before_the_order_is_that_of_sorting_everybody() -> None:
    draw = random.Random(7)  # noqa: S311 - the same in each run
    house = House(max_hints=26)
    for step in range(3000):
        name = draw.choice("abcdefghijklmnopqrstuvwxyz")
        status = draw.choice([ACTIVE, STALE, STALE, LEFT])
        if name not in house.records:
            house.add(name, status, draw.randrange(5), again=draw.random() < 0.5)
        elif draw.random() < 0.1:
            house.displace(house.records[name])
        else:
            house.become(name, status, draw.choice([None, step]))
    idle = [one for one in house.records.values() if one.status is not ACTIVE]
    assert len(idle) > 5
    house.displaced.clear()
    house.room.max_hints = len(house.room) - len(idle) + 1
    assert house.make_room() == [one.entity_id for one in sorted(idle, key=worth)]


def worth(record: Record) -> tuple[bool, bool, int, str]:
    left = record.status is LEFT
    return not left, not left and not record.heard_once, record.last_seen_ns, record.entity_id
