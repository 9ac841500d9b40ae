"""The graph is looked at soon after something was said, now and then anyway, never too often."""

from __future__ import annotations

from beacon_ros_topic.looks import Looks


class Looker:
    """Looks whenever that is due, each time for so long; time is its own."""

    def __init__(self, took_s: float) -> None:
        self.now_s = 100.0
        self.took_s = took_s
        self.looks = Looks(self.now_s)
        self.began: list[float] = []

    def until(self, end_s: float) -> list[float]:
        """When looks were begun until then, in seconds since 100.0."""
        self.began = []
        while (due_s := self.now_s + self.looks.wait_s(self.now_s)) < 100.0 + end_s:
            self.began.append(round(due_s - 100.0, 3))
            self.now_s = due_s + self.took_s
            self.looks.looked(due_s, self.now_s)
        self.now_s = max(self.now_s, 100.0 + end_s)
        return self.began


def test_the_first_is_due_at_once_and_the_next_every_two_seconds() -> None:
    assert Looker(0.001).until(5.0) == [0.0, 2.0, 4.0]


def test_what_is_said_is_looked_at_at_once_and_some_times_after() -> None:
    looker = Looker(0.001)
    looker.until(1.0)
    looker.looks.soon(looker.now_s)
    assert looker.until(5.0) == [1.0, 1.1, 1.5, 3.5]


def test_what_is_said_while_it_looks_is_looked_at_again() -> None:
    looker = Looker(0.001)
    looker.until(1.0)
    looker.looks.soon(101.0)
    looker.looks.soon(101.0005)
    looker.looks.looked(101.0, 101.001)
    assert looker.looks.wait_s(101.001) < 0.01


def test_however_often_something_is_said_looks_take_a_tenth_of_the_time() -> None:
    looker = Looker(0.06)
    taken = 0
    for tick in range(1000):
        looker.looks.soon(looker.now_s)
        taken += len(looker.until(tick / 100))
    assert 15 <= taken <= 17  # of 10 s at 0.06 s each


def test_where_nothing_is_said_they_take_a_two_hundredth() -> None:
    assert Looker(0.06).until(40.0) == [0.0, 12.0, 24.0, 36.0]


def test_the_wait_is_never_negative() -> None:
    assert Looks(0.0).wait_s(1000.0) == 0.0
