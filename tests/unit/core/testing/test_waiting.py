"""Waiting: looks at once, ends with what it waits for, and gives up in time."""

from __future__ import annotations

import threading
import time

import pytest

from beacon_core.testing import waiting
from beacon_core.testing.waiting import wait_until


def test_what_holds_already_is_not_waited_for() -> None:
    assert wait_until(lambda: True, 0.0)


def test_it_ends_as_soon_as_it_holds() -> None:
    looks = iter([False, False, True])
    assert wait_until(lambda: next(looks), 60.0, pause_s=0.001)


def test_what_never_holds_is_given_up_in_time() -> None:
    began = time.monotonic()
    assert not wait_until(lambda: False, 0.02)
    assert 0.02 <= time.monotonic() - began < 20


def test_what_looking_takes_counts() -> None:
    looks = 0

    def look() -> bool:
        nonlocal looks
        looks += 1
        time.sleep(0.01)
        return False

    assert not wait_until(look, 0.1, pause_s=0.0)
    assert looks <= 11


class Standing:
    """A clock that goes on by seven seconds while somebody pauses."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, _: float) -> None:
        self.now_s += 7.0


def test_that_the_machine_stood_still_is_no_reason_to_give_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    standing, looks = Standing(), iter([False] * 5 + [True])
    monkeypatch.setattr(waiting, "time", standing)
    monkeypatch.setattr(threading, "Event", lambda: standing)
    assert wait_until(lambda: next(looks), 1.0)
    assert not wait_until(lambda: False, 1.0)
