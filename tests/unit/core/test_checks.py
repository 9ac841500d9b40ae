"""Checks of what a caller configures: what is refused, and what the message says."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import Any

import pytest

from beacon_core.checks import at_least_one, nanoseconds, period_ns, positive_rate
from beacon_core.errors import ConfigError


@pytest.mark.parametrize(
    ("seconds", "expected_ns"),
    [
        (0, 0),
        (0.0, 0),
        (10, 10_000_000_000),
        (0.1, 100_000_000),
        (0.3, 300_000_000),
        (0.7, 700_000_000),
        (0.1 + 0.2, 300_000_001),
        (3 * 0.3, 900_000_000),
        (1.1e-9, 2),
        (0.9e-9, 1),
        (1e9, 10**18),
    ],
)
def test_seconds_become_whole_nanoseconds_that_are_not_less(
    seconds: float, expected_ns: int
) -> None:
    assert nanoseconds("ttl_s", seconds) == expected_ns


def test_an_age_reaches_a_time_when_its_seconds_do() -> None:
    draw = random.Random(1)  # noqa: S311 - the same in each run
    for _ in range(10_000):
        seconds = draw.choice([draw.random(), draw.random() * 600, draw.randrange(6000) / 10 / 3])
        age_ns = nanoseconds("ttl_s", seconds)
        assert age_ns / 1e9 >= seconds > (age_ns - 1) / 1e9


@pytest.mark.parametrize(
    # The last one is larger than any float.
    "seconds",
    [math.nan, math.inf, -math.inf, -1, -1e-9, 1_000_000_001, 1.7e308, 10**400],
    ids=lambda seconds: str(seconds)[:12],
)
def test_seconds_that_are_no_sensible_length_of_time_are_refused(seconds: float) -> None:
    message = rf"^ttl_s: {seconds} is not possible; give a number of seconds from 0 to 1000000000$"
    with pytest.raises(ConfigError, match=message.replace("+", r"\+")):
        nanoseconds("ttl_s", seconds)


@pytest.mark.parametrize(
    ("seconds", "expected_ns"), [(None, None), (1, 10**9), (0.5, 500_000_000), (1e-9, 1)]
)
def test_a_period_is_seconds_or_none_at_all(seconds: float | None, expected_ns: int | None) -> None:
    assert period_ns(seconds) == expected_ns


@pytest.mark.parametrize("seconds", [0, -1, -1e-9, math.inf, math.nan])
def test_a_period_that_never_ends_or_is_none_is_refused(seconds: float) -> None:
    with pytest.raises(ConfigError) as refused:
        period_ns(seconds)
    assert str(refused.value) == (f"period_s: {seconds!r} cannot be used; write seconds above 0")


@pytest.mark.parametrize("value", [1, 2, 10**18])
def test_a_cap_of_one_or_more_is_taken(value: int) -> None:
    assert at_least_one("max_hints", value) == value


@pytest.mark.parametrize("value", [0, -1, 1.0, 2.5, math.nan, math.inf, -math.inf])
def test_a_cap_that_is_none_or_below_one_is_refused(value: int) -> None:
    with pytest.raises(
        ConfigError, match=rf"^max_hints: {value} is not possible; give a whole number, at least 1$"
    ):
        at_least_one("max_hints", value)


@pytest.mark.parametrize("value", [1, 1.0, 1.5, 1e308])
def test_a_rate_of_one_or_more_is_taken(value: float) -> None:
    rate = positive_rate("rate", value)
    assert rate == value
    assert type(rate) is float


@pytest.mark.parametrize(
    "value",
    [math.nan, math.inf, -math.inf, 0, 0.999, -5, 10**400],
    ids=lambda value: str(value)[:12],
)
def test_a_rate_that_is_none_is_refused(value: float) -> None:
    with pytest.raises(
        ConfigError, match=rf"^rate: {value} is not possible; give a finite number, at least 1\.0$"
    ):
        positive_rate("rate", value)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(True, "True"), (False, "False"), ("10", "'10'"), ("", "''"), (None, "None"), ([1], r"\[1\]")],
)
@pytest.mark.parametrize(
    ("check", "right"),
    [
        (nanoseconds, "a number of seconds from 0 to 1000000000"),
        (at_least_one, "a whole number, at least 1"),
        (positive_rate, r"a finite number, at least 1\.0"),
    ],
)
def test_what_is_no_number_at_all_is_refused_with_the_same_words(
    check: Callable[[str, Any], object], right: str, value: object, shown: str
) -> None:
    with pytest.raises(ConfigError, match=f"^key: {shown} is not possible; give {right}$"):
        check("key", value)
