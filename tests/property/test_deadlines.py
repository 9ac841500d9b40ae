"""The calendar of deadlines gives what sorting everything each time would give."""

from __future__ import annotations

import attrs
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.deadlines import NEVER, DeadlineQueue

NAMES = "abcdef"


@attrs.define(eq=False)
class Item:
    entity_id: str
    deadline_ns: int = 0
    due_ns: int = NEVER
    slot: int = NEVER
    slot_end_ns: int = NEVER


class Sorted:
    """A queue in a dict, for any number of items, each of which may be in once."""

    def __init__(self) -> None:
        self.items: list[Item] = []

    def next_deadline_ns(self) -> int | None:
        return min((item.deadline_ns for item in self.items), default=None)

    def pop_due(self, now_ns: int) -> tuple[int, Item] | None:
        due = [item for item in self.items if item.deadline_ns <= now_ns]
        if not due:
            return None
        first = min(due, key=lambda item: (item.deadline_ns, item.entity_id))
        self.items.remove(first)
        return first.deadline_ns, first


doings = st.lists(
    st.tuples(
        st.sampled_from(["file", "file", "file", "move on", "cancel", "pop", "look"]),
        st.integers(0, len(NAMES) - 1),
        # In sixteenths of the interval, so that slots meet; and a little beside them.
        st.integers(0, 40),
        st.integers(-1, 1),
    ),
    max_size=60,
)


@settings(max_examples=500, deadline=None)
@given(
    interval_ns=st.sampled_from([0, 1, 16, 1_000, 10**10]),
    begin_ns=st.sampled_from([0, -500, 10**18]),
    doings=doings,
)
def test_what_is_due_comes_out_in_order_exactly_at_its_time(
    interval_ns: int, begin_ns: int, doings: list[tuple[str, int, int, int]]
) -> None:
    queue: DeadlineQueue[Item] = DeadlineQueue(interval_ns, lambda item: item.deadline_ns)
    naive, now_ns = Sorted(), begin_ns
    items = [Item(name) for name in NAMES]
    for doing, number, sixteenths, beside in doings:
        item, length_ns = items[number], sixteenths * max(1, interval_ns // 16) + beside
        if doing == "file":
            item.deadline_ns = now_ns + length_ns
            queue.schedule(item, item.deadline_ns)
            naive.items = [*(one for one in naive.items if one is not item), item]
        elif doing == "move on" and item in naive.items:
            # As the store does: it says nothing while the deadline stays within its slot.
            item.deadline_ns += max(0, length_ns)
            if item.deadline_ns >= item.slot_end_ns:
                queue.schedule(item, item.deadline_ns)
        elif doing == "cancel":
            queue.cancel(item)
            naive.items = [one for one in naive.items if one is not item]
        elif doing == "pop":
            now_ns += max(0, length_ns)
            assert pop_all(queue, now_ns) == pop_all(naive, now_ns)
        check_next(queue.next_deadline_ns(), naive.next_deadline_ns(), interval_ns)
    assert pop_all(queue, 10**30) == pop_all(naive, 10**30)


@settings(max_examples=100, deadline=None)
@given(st.sampled_from([0, 100, 10**10]), doings)
def test_it_holds_no_more_than_twice_what_is_filed_and_a_little(
    interval_ns: int, doings: list[tuple[str, int, int, int]]
) -> None:
    queue: DeadlineQueue[Item] = DeadlineQueue(interval_ns, lambda item: item.deadline_ns)
    items = [Item(name) for name in NAMES]
    now_ns = 0
    for doing, number, sixteenths, beside in doings * 20:
        item = items[number]
        if doing == "pop":
            now_ns += interval_ns // 50
            pop_all(queue, now_ns)
        elif doing == "cancel":
            queue.cancel(item)
        else:
            item.deadline_ns = now_ns + sixteenths * max(1, interval_ns // 16) + beside
            queue.schedule(item, item.deadline_ns)
        assert len(queue._near) <= 2 * len(items) + 64
        assert len(queue._slots) <= len(items)
        assert len(queue._slot_order) <= 2 * len(items) + 65


def pop_all(queue: DeadlineQueue[Item] | Sorted, now_ns: int) -> list[tuple[int, Item]]:
    popped = []
    while (found := queue.pop_due(now_ns)) is not None:
        popped.append(found)
    return popped


def check_next(early: int | None, exact: int | None, interval_ns: int) -> None:
    """Never late, and early by a slot at the most."""
    assert (early is None) == (exact is None)
    if early is not None and exact is not None:
        assert 0 <= exact - early < max(1, interval_ns / 16)
