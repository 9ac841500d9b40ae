# ruff: noqa: S311 - chance in tests is no secret
"""Events happen by time, and for equal times in the order they were made."""

from __future__ import annotations

import random

from beacon_fake.events import EventQueue


def test_events_happen_by_time_and_then_by_age() -> None:
    queue, happened = EventQueue(), list[int]()
    times = [3, 1, 2, 1, 3, 2, 1]
    for number, time in enumerate(times):
        queue.push(time, lambda number=number: happened.append(number), in_flight=True)  # type: ignore[misc]
    while (happen := queue.pop_due(9)) is not None:
        happen()
    assert happened == [1, 3, 6, 2, 5, 0, 4]


def test_nothing_happens_before_its_time() -> None:
    queue = EventQueue()
    queue.push(5, lambda: None, in_flight=True)
    assert queue.pop_due(4) is None
    assert queue.pop_due(5) is not None
    assert queue.pop_due(6) is None


def test_the_next_and_the_last_arrival_are_known() -> None:
    queue, rng = EventQueue(), random.Random(1)
    assert queue.next_due_ns() is None
    assert queue.last_arrival_ns() is None
    times = [rng.randrange(1000) for _ in range(50)]
    for time in times:
        queue.push(time, lambda: None, in_flight=True)
    queue.push(5000, lambda: None, in_flight=False)
    assert queue.next_due_ns() == min(times)
    assert queue.last_arrival_ns() == max(times)
    assert len(queue) == 51
