"""The watcher is told in order, whatever it does, and nothing after the end."""

from __future__ import annotations

import threading

from beacon_core.testing.waiting import wait_until
from beacon_zenoh.rmw_relay.teller import Teller


def test_it_tells_in_order_and_what_was_left_before_it_began() -> None:
    teller, told = Teller(), list[int]()
    teller.tell(lambda: told.append(1))
    teller.start()
    teller.tell(lambda: told.append(2))
    assert wait_until(lambda: told == [1, 2], 5.0)
    teller.close(5.0)


def test_a_watcher_that_raises_is_told_what_follows() -> None:
    teller, told = Teller(), list[int]()
    teller.start()
    teller.tell(lambda: 1 // 0)
    teller.tell(lambda: told.append(1))
    assert wait_until(lambda: told == [1], 5.0)
    teller.close(5.0)


def test_nothing_is_told_after_the_end_and_nobody_waits_for_ever() -> None:
    teller, told = Teller(), list[int]()
    entered, release = threading.Event(), threading.Event()

    def hang() -> None:
        entered.set()
        release.wait(10)

    teller.start()
    teller.tell(hang)
    teller.tell(lambda: told.append(1))
    assert entered.wait(5)
    teller.close(0.01)
    release.set()
    teller.close(5.0)
    assert told == []


def test_it_may_be_closed_before_it_began_and_by_itself() -> None:
    Teller().close(5.0)
    teller, done, more = Teller(), threading.Event(), threading.Event()

    def end() -> None:
        teller.close(5.0)
        done.set()

    teller.start()
    teller.tell(end)
    teller.tell(more.set)
    assert done.wait(4), "it does not wait for itself"
    teller.close(5.0)
    assert not more.is_set()
