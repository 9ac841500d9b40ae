"""Stamps: what is measured, what is believed."""

from __future__ import annotations

import pytest

from beacon_core.skew import TOLERATED_OFFSET_NS, ClockOffset, SkewPolicy, trusted_age_ns

S = 1_000_000_000
EXPIRY = 300 * S


def measured(offset_ns: int) -> ClockOffset:
    clock = ClockOffset()
    for _ in range(3):
        clock.observe(stamp_ns=1000 * S - offset_ns, wall_now_ns=1000 * S)
    return clock


@pytest.mark.parametrize("policy", SkewPolicy)
def test_a_stamp_from_the_future_is_just_now_or_not_believed(policy: SkewPolicy) -> None:
    expected = None if policy == "arrival" else 0
    assert trusted_age_ns(-5 * S, ClockOffset(), EXPIRY, policy) == expected


def test_the_age_of_a_plausible_stamp_is_believed_by_stamp_and_auto() -> None:
    for clock in (ClockOffset(), measured(0)):
        assert trusted_age_ns(7 * S, clock, EXPIRY, SkewPolicy.STAMP) == 7 * S
        assert trusted_age_ns(7 * S, clock, EXPIRY, SkewPolicy.AUTO) == 7 * S
        assert trusted_age_ns(7 * S, clock, EXPIRY, SkewPolicy.ARRIVAL) is None


def test_auto_does_not_believe_an_invisible_stamp_of_a_clock_it_does_not_know() -> None:
    clock = ClockOffset()
    assert trusted_age_ns(EXPIRY - 1, clock, EXPIRY, SkewPolicy.AUTO) == EXPIRY - 1
    assert trusted_age_ns(EXPIRY, clock, EXPIRY, SkewPolicy.AUTO) is None
    assert trusted_age_ns(EXPIRY, clock, EXPIRY, SkewPolicy.STAMP) == EXPIRY


def test_auto_knows_an_old_message_by_a_clock_that_is_right() -> None:
    assert trusted_age_ns(2 * EXPIRY, measured(0), EXPIRY, SkewPolicy.AUTO) == 2 * EXPIRY


@pytest.mark.parametrize("offset_s", [30, 10_000, -30])
def test_auto_takes_a_measured_offset_off(offset_s: int) -> None:
    told_ns = (offset_s + 4) * S
    assert trusted_age_ns(told_ns, measured(offset_s * S), EXPIRY, SkewPolicy.AUTO) == 4 * S
    assert trusted_age_ns(told_ns, measured(offset_s * S), EXPIRY, SkewPolicy.STAMP) == max(
        0, told_ns
    )


def test_nothing_is_known_before_the_first_stamp() -> None:
    clock = ClockOffset()
    assert clock.offset_ns is None
    assert not clock.skewed


def test_the_offset_is_the_smallest_difference_seen() -> None:
    clock = ClockOffset()
    for difference in (5 * S, 2 * S, 9 * S):
        clock.observe(stamp_ns=100 * S, wall_now_ns=100 * S + difference)
    assert clock.offset_ns == 2 * S
    assert clock.skewed


def test_one_or_two_late_messages_are_not_called_skew() -> None:
    clock = ClockOffset()
    for _ in range(2):
        clock.observe(stamp_ns=0, wall_now_ns=60 * S)
        assert not clock.skewed
    clock.observe(stamp_ns=0, wall_now_ns=60 * S)
    assert clock.skewed


@pytest.mark.parametrize("sign", [1, -1])
def test_an_offset_is_reported_only_above_the_tolerance(sign: int) -> None:
    within, beyond = ClockOffset(), ClockOffset()
    for _ in range(3):
        within.observe(stamp_ns=0, wall_now_ns=sign * TOLERATED_OFFSET_NS)
        beyond.observe(stamp_ns=0, wall_now_ns=sign * (TOLERATED_OFFSET_NS + 1))
    assert not within.skewed
    assert beyond.skewed


@pytest.mark.parametrize("before_s", [0, 60, -60, 3600])
@pytest.mark.parametrize("after_s", [0, 30, -30, 10_000])
def test_a_clock_that_was_set_is_known_after_four_stamps(before_s: int, after_s: int) -> None:
    clock = measured(before_s * S)
    for _ in range(4):
        clock.observe(stamp_ns=-after_s * S, wall_now_ns=0)
    assert clock.offset_ns == after_s * S
    assert clock.measured


def test_late_messages_among_others_do_not_move_the_offset() -> None:
    clock = measured(0)
    for _ in range(20):
        for late_s in (60, 60, 60, 0):
            clock.observe(stamp_ns=-late_s * S, wall_now_ns=0)
    assert clock.offset_ns == 0


def test_a_backlog_that_is_delivered_at_last_does_not_move_the_offset() -> None:
    clock = measured(0)
    for late_s in range(100, 0, -2):
        clock.observe(stamp_ns=-late_s * S, wall_now_ns=0)
    assert clock.offset_ns == 0


def test_a_clock_that_drifts_is_followed_within_two_windows() -> None:
    clock = ClockOffset()
    for _ in range(64):
        clock.observe(stamp_ns=S, wall_now_ns=0)
    for _ in range(64):
        clock.observe(stamp_ns=S // 2, wall_now_ns=0)
        assert clock.offset_ns == -S
    clock.observe(stamp_ns=S // 2, wall_now_ns=0)
    assert clock.offset_ns == -S // 2
