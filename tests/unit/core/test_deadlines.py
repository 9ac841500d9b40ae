"""The calendar of deadlines: exact, in order, alike in every run, and no larger than it must be."""

from __future__ import annotations

import random

import attrs
import pytest

from beacon_core.deadlines import NEVER, DeadlineQueue

TTL_NS = 10_000_000_000
SLOT_NS = 2**29
"""Of a time to live of 10 s: the largest power of two within a sixteenth of it."""


@attrs.define(eq=False)
class Item:
    entity_id: str
    deadline_ns: int = 0
    due_ns: int = NEVER
    slot: int = NEVER
    slot_end_ns: int = NEVER


def queue(interval_ns: int = TTL_NS) -> DeadlineQueue[Item]:
    return DeadlineQueue(interval_ns, lambda item: item.deadline_ns)


def file(due: DeadlineQueue[Item], item: Item, deadline_ns: int) -> Item:
    item.deadline_ns = deadline_ns
    due.schedule(item, deadline_ns)
    return item


def pop_all(due: DeadlineQueue[Item], now_ns: int) -> list[tuple[int, str]]:
    popped = []
    while (found := due.pop_due(now_ns)) is not None:
        popped.append((found[0], found[1].entity_id))
    return popped


# -- what is due ---------------------------------------------------------------------------------


def test_nothing_is_due_in_an_empty_queue() -> None:
    assert queue().pop_due(10**18) is None
    assert queue().next_deadline_ns() is None


@pytest.mark.parametrize("interval_ns", [TTL_NS, 1, 0])
@pytest.mark.parametrize("deadline_ns", [0, 1, SLOT_NS - 1, SLOT_NS, TTL_NS, 10**18])
def test_an_item_is_due_at_its_deadline_and_not_a_nanosecond_before(
    interval_ns: int, deadline_ns: int
) -> None:
    due = queue(interval_ns)
    item = file(due, Item("a"), deadline_ns)
    assert due.pop_due(deadline_ns - 1) is None
    assert due.pop_due(deadline_ns) == (deadline_ns, item)
    assert due.pop_due(deadline_ns) is None


def test_items_come_out_in_the_order_of_their_deadlines_and_ids() -> None:
    due = queue()
    for name, deadline_ns in [("c", 5 * TTL_NS), ("b", 3), ("a", 5 * TTL_NS), ("d", 4)]:
        file(due, Item(name), deadline_ns)
    expected = [(3, "b"), (4, "d"), (5 * TTL_NS, "a"), (5 * TTL_NS, "c")]
    assert pop_all(due, 10 * TTL_NS) == expected


def test_two_items_of_one_id_may_be_due_at_once() -> None:
    due = queue()
    both = [file(due, Item("a"), 7), file(due, Item("a"), 7)]
    found = [due.pop_due(7), due.pop_due(7)]
    assert found in ([(7, both[0]), (7, both[1])], [(7, both[1]), (7, both[0])])


def test_what_became_due_long_ago_comes_out_with_its_own_time() -> None:
    due = queue()
    file(due, Item("a"), TTL_NS)
    assert pop_all(due, 10**19) == [(TTL_NS, "a")]


@pytest.mark.parametrize("deadline_ns", [-5 * TTL_NS, -2, -1])
def test_time_before_the_start_of_the_clock_is_time_too(deadline_ns: int) -> None:
    due = queue()
    file(due, Item("a"), deadline_ns)
    file(due, Item("b"), 1)
    due.cancel(file(due, Item("c"), deadline_ns))
    assert pop_all(due, 0) == [(deadline_ns, "a")]


@pytest.mark.parametrize("deadline_ns", [-SLOT_NS, -2, -1, 0])
def test_the_last_moments_before_the_start_of_the_clock_are_no_exception(deadline_ns: int) -> None:
    due = queue()
    item = file(due, Item("a"), deadline_ns)
    assert due.pop_due(deadline_ns - 1) is None
    file(due, item, deadline_ns)
    assert pop_all(due, deadline_ns) == [(deadline_ns, "a")]


# -- moving and cancelling -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "moved_ns",
    [TTL_NS + 1, TTL_NS + SLOT_NS, 5 * TTL_NS, TTL_NS - SLOT_NS, 1],
    ids=["within its slot", "to the next slot", "far later", "to the slot before", "to now"],
)
def test_a_new_deadline_takes_the_place_of_the_old_one(moved_ns: int) -> None:
    due = queue()
    item = file(due, Item("a"), TTL_NS)
    file(due, item, moved_ns)
    assert pop_all(due, moved_ns - 1) == []
    assert pop_all(due, 10 * TTL_NS) == [(moved_ns, "a")]


def test_a_deadline_may_move_within_its_slot_without_a_word() -> None:
    due = queue()
    item = file(due, Item("a"), TTL_NS)
    item.deadline_ns = item.slot_end_ns - 1
    assert pop_all(due, item.deadline_ns - 1) == []
    assert pop_all(due, item.deadline_ns) == [(item.deadline_ns, "a")]


def test_a_deadline_in_the_heap_may_move_too() -> None:
    due = queue()
    item, other = file(due, Item("a"), TTL_NS), file(due, Item("b"), TTL_NS + 2)
    assert due.pop_due(TTL_NS - 1) is None  # Sorts their slot.
    file(due, item, TTL_NS + 5)
    assert due.next_deadline_ns() == TTL_NS + 2
    file(due, item, TTL_NS + 1)
    file(due, other, 5 * TTL_NS)
    assert pop_all(due, 4 * TTL_NS) == [(TTL_NS + 1, "a")]
    assert pop_all(due, 5 * TTL_NS) == [(5 * TTL_NS, "b")]


@pytest.mark.parametrize("sorted_already", [False, True])
def test_whoever_is_cancelled_never_comes_out(*, sorted_already: bool) -> None:
    due = queue()
    item, other = file(due, Item("a"), TTL_NS), file(due, Item("b"), TTL_NS)
    if sorted_already:
        due.pop_due(TTL_NS - 1)
    due.cancel(item)
    assert (item.due_ns, item.slot, item.slot_end_ns) == (NEVER, NEVER, NEVER)
    assert pop_all(due, 10**19) == [(TTL_NS, other.entity_id)]


def test_cancelling_who_is_not_in_changes_nothing() -> None:
    due = queue()
    item = Item("a")
    due.cancel(item)
    file(due, item, 5)
    assert due.pop_due(5) == (5, item)
    due.cancel(item)
    assert due.pop_due(10) is None


def test_whoever_was_cancelled_may_be_filed_again_at_the_same_time() -> None:
    due = queue()
    item = file(due, Item("a"), TTL_NS)
    due.pop_due(TTL_NS - 1)
    due.cancel(item)
    file(due, item, TTL_NS)
    assert pop_all(due, TTL_NS) == [(TTL_NS, "a")]


# -- when to look next ---------------------------------------------------------------------------


def test_it_is_early_enough_to_look_again_at_most_a_slot_before_the_next_deadline() -> None:
    due = queue()
    file(due, Item("a"), 3 * TTL_NS)
    file(due, Item("b"), TTL_NS + 5)
    early_ns = due.next_deadline_ns()
    assert early_ns is not None
    assert TTL_NS + 5 - SLOT_NS < early_ns <= TTL_NS + 5
    assert SLOT_NS <= TTL_NS / 16
    # Looking then makes it exact.
    assert due.pop_due(early_ns) is None
    assert due.next_deadline_ns() == TTL_NS + 5


def test_slots_that_everybody_has_left_are_not_waited_for() -> None:
    due = queue()
    item, other = file(due, Item("a"), TTL_NS), file(due, Item("b"), TTL_NS)
    due.cancel(other)
    file(due, item, 5 * TTL_NS)
    early_ns = due.next_deadline_ns()
    assert early_ns is not None
    assert early_ns > 4 * TTL_NS
    due.cancel(item)
    assert due.next_deadline_ns() is None


def test_the_next_deadline_is_exact_as_soon_as_its_slot_is_sorted() -> None:
    due = queue()
    items = [file(due, Item(f"{number}"), TTL_NS + number) for number in range(5)]
    due.pop_due(TTL_NS - 1)
    for item in items:
        assert due.next_deadline_ns() == item.deadline_ns
        due.cancel(item)


# -- cost ----------------------------------------------------------------------------------------


def test_refreshes_leave_nothing_behind() -> None:
    due = queue()
    items = [Item(f"{number}") for number in range(100)]
    for second in range(1000):
        for item in items:
            file(due, item, second * 1_000_000_000 + TTL_NS)
    assert len(due._slots) == 1
    assert len(due._slot_order) <= 2 * len(due._slots) + 65


def test_not_even_when_a_slot_is_a_nanosecond() -> None:
    due = queue(0)
    item = Item("a")
    for nanosecond in range(1000):
        file(due, item, 10**12 + nanosecond)
    assert len(due._slots) == 1
    assert len(due._slot_order) <= 67
    assert pop_all(due, 10**13) == [(10**12 + 999, "a")]


def test_moving_about_in_the_heap_leaves_it_small() -> None:
    due = queue()
    items = [file(due, Item(f"{number}"), TTL_NS + number) for number in range(10)]
    due.pop_due(TTL_NS - 1)
    for round_ in range(1000):
        for item in items:
            file(due, item, item.deadline_ns + round_ % 3)
    assert len(due._near) <= 2 * len(items) + 64
    assert [name for _, name in pop_all(due, 10**18)] == [item.entity_id for item in items]


def test_filing_again_under_the_same_deadline_leaves_the_heap_as_it_is() -> None:
    due = queue()
    item = file(due, Item("a"), TTL_NS)
    due.pop_due(TTL_NS - 1)
    for _ in range(1000):
        file(due, item, TTL_NS)
    assert len(due._near) == 1
    assert pop_all(due, TTL_NS) == [(TTL_NS, "a")]


def test_filing_again_under_the_same_deadline_leaves_the_heap_small() -> None:
    due = queue()
    item = file(due, Item("a"), TTL_NS)
    due.pop_due(TTL_NS - 1)
    for _ in range(1000):
        file(due, item, TTL_NS)
    assert len(due._near) <= 2 + 64
    assert pop_all(due, TTL_NS) == [(TTL_NS, "a")]


# -- all at once ---------------------------------------------------------------------------------


@pytest.mark.parametrize("slack", [64, 2])
@pytest.mark.parametrize("interval_ns", [10**5, 1000, 50, 3, 0])
def test_any_order_of_doings_gives_what_sorting_everything_would(
    monkeypatch: pytest.MonkeyPatch, interval_ns: int, slack: int
) -> None:
    monkeypatch.setattr("beacon_core.deadlines._SLACK", slack)
    draw = random.Random(interval_ns)  # noqa: S311 - the same in each run
    due, items = queue(interval_ns), [Item(f"{number:02}") for number in range(30)]
    filed: dict[str, Item] = {}
    now_ns = 0
    for _ in range(5_000):
        item = draw.choice(items)
        doing = draw.randrange(10)
        if doing < 6:
            filed[item.entity_id] = file(due, item, now_ns + draw.randrange(1, 3000))
        elif doing < 7:
            filed.pop(item.entity_id, None)
            due.cancel(item)
        elif doing < 8 and item.slot != NEVER:
            item.deadline_ns = max(item.deadline_ns, draw.randrange(now_ns, item.slot_end_ns))
        elif doing < 9:
            check_next(due, filed, interval_ns)
        else:
            now_ns += draw.randrange(0, 400)
            ready = [one for one in filed.values() if one.deadline_ns <= now_ns]
            expected = sorted((one.deadline_ns, one.entity_id) for one in ready)
            assert pop_all(due, now_ns) == expected
            for one in ready:
                del filed[one.entity_id]


def check_next(due: DeadlineQueue[Item], filed: dict[str, Item], interval_ns: int) -> None:
    early_ns = due.next_deadline_ns()
    if early_ns is None:
        assert not filed
        return
    exact_ns = min(one.deadline_ns for one in filed.values())
    assert exact_ns - max(1, interval_ns // 16) < early_ns <= exact_ns
