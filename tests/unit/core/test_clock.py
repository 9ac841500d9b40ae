"""The clocks: the system's go with the system's, the manual one only when told."""

from __future__ import annotations

import time

import pytest

from beacon_core.clock import Clock, ManualClock, SystemClock


@pytest.mark.parametrize("clock", [SystemClock(), ManualClock()])
def test_both_are_clocks(clock: Clock) -> None:
    assert isinstance(clock.monotonic_ns(), int)
    assert isinstance(clock.wall_ns(), int)


def test_the_system_clock_is_the_operating_system_s() -> None:
    clock = SystemClock()
    assert time.monotonic_ns() <= clock.monotonic_ns() <= time.monotonic_ns()
    assert abs(clock.wall_ns() - time.time_ns()) < 60 * 10**9


def test_a_manual_clock_stands_still_until_told() -> None:
    clock = ManualClock(monotonic_ns=5, wall_ns=7)
    assert [clock.monotonic_ns(), clock.monotonic_ns()] == [5, 5]
    assert [clock.wall_ns(), clock.wall_ns()] == [7, 7]


def test_time_passes_on_both_of_its_faces() -> None:
    clock = ManualClock(monotonic_ns=5, wall_ns=7)
    clock.advance(10)
    clock.advance(0)
    assert (clock.monotonic_ns(), clock.wall_ns()) == (15, 17)


def test_a_monotonic_clock_cannot_go_back() -> None:
    clock = ManualClock(monotonic_ns=5)
    with pytest.raises(ValueError, match=r"advance\(-1\)"):
        clock.advance(-1)
    assert clock.monotonic_ns() == 5


@pytest.mark.parametrize("wall_ns", [0, -1, 2**63])
def test_the_wall_clock_can_be_set_to_anything_and_alone(wall_ns: int) -> None:
    clock = ManualClock(monotonic_ns=5, wall_ns=7)
    clock.set_wall(wall_ns)
    assert (clock.monotonic_ns(), clock.wall_ns()) == (5, wall_ns)


def test_by_default_neither_face_is_at_zero() -> None:
    # Zero is "not given" for a stamp, so a clock at zero would hide faults.
    assert ManualClock().monotonic_ns() > 0
    assert ManualClock().wall_ns() > 0
