"""One at a time, in order, and nobody waits for long."""

from __future__ import annotations

import logging
import threading
import time

import pytest

from beacon_gateway.relay.turns import HEAVY_BYTES, Turns

SOON_S = 5.0


class Busy:
    """Turns that somebody is at, until told to go on."""

    def __init__(self) -> None:
        self.turns = Turns()
        self.begun, self.go_on = threading.Event(), threading.Event()
        self.done: list[object] = []
        self.thread = threading.Thread(target=self.turns.take, args=(self._work,))
        self.thread.start()
        assert self.begun.wait(SOON_S)

    def _work(self) -> None:
        self.begun.set()
        assert self.go_on.wait(SOON_S)

    def end(self) -> None:
        self.go_on.set()
        self.thread.join(SOON_S)


def test_a_job_is_done_at_once_if_nobody_else_is_at_work() -> None:
    done: list[int] = []
    Turns().take(done.append, 1)
    assert done == [1]


def test_who_comes_while_others_work_leaves_its_job_to_them_and_goes() -> None:
    busy = Busy()
    busy.turns.take(busy.done.append, threading.current_thread())
    busy.turns.take(lambda: busy.done.append(threading.current_thread()))
    assert busy.done == []
    busy.end()
    assert busy.done == [threading.current_thread(), busy.thread]


def test_a_job_within_a_job_comes_after_those_before_it() -> None:
    turns = Turns()
    done: list[str] = []

    def outer() -> None:
        turns.take(done.append, "inner")
        done.append("outer")

    turns.take(outer)
    assert done == ["outer", "inner"]


def test_what_a_job_raises_is_logged_and_the_next_ones_are_done(
    caplog: pytest.LogCaptureFixture,
) -> None:
    turns = Turns()
    done: list[int] = []
    with caplog.at_level(logging.ERROR):
        turns.take(lambda: 1 / 0)
        turns.take(done.append, 1)
    assert done == [1]
    assert "ZeroDivisionError" in caplog.text


def test_jobs_of_many_threads_are_done_one_at_a_time_each_threads_in_its_order() -> None:
    turns, threads, each = Turns(), 8, 500
    done: list[tuple[int, int]] = []
    at_work = [0]

    def job(thread: int, number: int) -> None:
        at_work[0] += 1
        assert at_work[0] == 1
        done.append((thread, number))
        at_work[0] -= 1

    def work(thread: int) -> None:
        for number in range(each):
            turns.take(job, thread, number)

    workers = [threading.Thread(target=work, args=(one,)) for one in range(threads)]
    for one in workers:
        one.start()
    for one in workers:
        one.join(SOON_S)
    # A job that was left to others is done by the time these have ended.
    assert turns.ask(lambda: len(done)) == threads * each
    for thread in range(threads):
        assert [number for one, number in done if one == thread] == list(range(each))


def test_who_brings_much_waits_for_its_turn_a_little_and_then_leaves_it() -> None:
    busy = Busy()
    began = time.monotonic()
    busy.turns.take(busy.done.append, 1, size=HEAVY_BYTES + 1)
    waited_s = time.monotonic() - began
    assert waited_s >= 0.04
    assert busy.done == []
    busy.end()
    assert busy.done == [1]


def test_who_finds_many_waits_too_so_that_they_do_not_become_ever_more() -> None:
    busy = Busy()
    for _ in range(256):
        busy.turns.take(busy.done.append, 1)
    helper = threading.Thread(target=busy.turns.take, args=(busy.done.append, 2))
    helper.start()
    busy.end()
    helper.join(SOON_S)
    assert busy.done == [1] * 256 + [2]


def test_who_is_at_work_elsewhere_does_not_wait_for_who_may_wait_for_it() -> None:
    busy, other = Busy(), Turns()
    waited: list[float] = []

    def bring_much() -> None:
        began = time.monotonic()
        busy.turns.take(busy.done.append, 1, size=HEAVY_BYTES + 1)
        waited.append(time.monotonic() - began)

    other.take(bring_much)
    busy.end()
    assert waited[0] < 0.04
    assert busy.done == [1]


def test_an_answer_is_waited_for_and_so_is_what_is_raised_instead() -> None:
    turns = Turns()
    assert turns.ask(lambda: 7) == 7
    with pytest.raises(ZeroDivisionError):
        turns.ask(lambda: 1 // 0)


def test_who_asks_is_told_when_nobody_answers() -> None:
    busy = Busy()
    with pytest.raises(TimeoutError):
        busy.turns.ask(lambda: 7, within_s=0.05)
    busy.end()
