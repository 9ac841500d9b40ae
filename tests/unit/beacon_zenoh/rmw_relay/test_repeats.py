"""What comes twice is known, in whatever order, and what is remembered has a bound."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_zenoh.rmw_relay import repeats
from beacon_zenoh.rmw_relay.repeats import Numbers, Stamps

ONE, TWO = b"1" * 16, b"2" * 16


@settings(deadline=None)
@given(st.lists(st.integers(1, 1000)))
def test_each_number_is_new_once_in_whatever_order(numbers: Sequence[int]) -> None:
    known, before = Numbers(), set[int]()
    for number in numbers:
        assert known.is_new(ONE, number) is (number not in before)
        before.add(number)


def test_numbers_that_leap_are_new_and_what_is_far_behind_is_not() -> None:
    known = Numbers()
    assert all(known.is_new(ONE, number) for number in (1, 2**40, 2**62, 2**62 - 1023))
    assert not any(known.is_new(ONE, number) for number in (1, 2**40, 2**62, 2**62 - 1024))


def test_publishers_have_numbers_of_their_own_and_none_at_all_is_always_new() -> None:
    known = Numbers()
    assert known.is_new(ONE, 1)
    assert known.is_new(TWO, 1)
    assert not known.is_new(ONE, 1)
    assert known.is_new(ONE, 0)
    assert known.is_new(ONE, 0)


def test_a_stamp_is_new_once() -> None:
    known = Stamps()
    assert known.is_new("1/a")
    assert known.is_new("1/b")
    assert not known.is_new("1/a")


def test_so_many_are_remembered_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(repeats, "_MAX_PUBLISHERS", 3)
    monkeypatch.setattr(repeats, "_MAX_STAMPS", 3)
    numbers, stamps = Numbers(), Stamps()
    for number in range(10):
        assert numbers.is_new(b"%16d" % number, 1)
        assert stamps.is_new(f"{number}/a")
    assert (len(numbers._heard), len(stamps._heard)) == (3, 3)
    assert not numbers.is_new(b"%16d" % 9, 1)
    assert numbers.is_new(b"%16d" % 0, 1)
