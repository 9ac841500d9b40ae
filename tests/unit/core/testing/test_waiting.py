"""Waiting: looks at once, ends with what it waits for, and gives up in time."""

from __future__ import annotations

import time

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
