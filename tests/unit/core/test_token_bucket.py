"""The buckets: as ros2_medkit's to the last bit, and fair under a global one."""

from __future__ import annotations

import json
import math
import random
from fractions import Fraction
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.errors import ConfigError
from beacon_core.outcome import Verdict
from beacon_core.token_bucket import FairGate, TokenBucket

VECTORS = Path(__file__).parents[2] / "data" / "vectors" / "token_bucket.jsonl"
CASES = [json.loads(line) for line in VECTORS.read_text(encoding="utf-8").splitlines()]
S = 1_000_000_000
NOW_NS = 10 * S
NOT_RATES = [0.0, 0.999, -1.0, math.nan, math.inf]


# -- one bucket ----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", [pytest.param(case, id=case["name"]) for case in CASES])
def test_it_grants_what_the_cpp_system_grants(case: dict[str, Any]) -> None:
    now_ns = NOW_NS
    bucket = TokenBucket(case["rate"], now_ns=now_ns)
    granted = []
    for advance_ns in case["advance_ns_before_each"]:
        now_ns += advance_ns
        granted.append(bucket.try_consume(now_ns))
    assert granted == case["expect"]


def test_a_bucket_is_full_at_first_with_one_second_s_worth() -> None:
    bucket = TokenBucket(5.0, now_ns=NOW_NS)
    assert [bucket.try_consume(NOW_NS) for _ in range(6)] == [True] * 5 + [False]


def test_a_bucket_s_capacity_may_be_its_own() -> None:
    bucket = TokenBucket(1.0, now_ns=NOW_NS, capacity=3.0)
    assert [bucket.try_consume(NOW_NS) for _ in range(4)] == [True, True, True, False]
    assert bucket.refill(NOW_NS + 100 * S) == 3.0


def test_a_token_is_there_at_its_time_and_not_a_nanosecond_before() -> None:
    bucket = TokenBucket(1.0, now_ns=NOW_NS)
    assert bucket.try_consume(NOW_NS)
    assert not bucket.try_consume(NOW_NS + S - 1)
    assert bucket.try_consume(NOW_NS + S)


def test_time_that_goes_back_is_no_time_for_a_bucket() -> None:
    bucket = TokenBucket(2.0, now_ns=NOW_NS)
    assert bucket.try_consume(NOW_NS)
    assert bucket.refill(NOW_NS - 100 * S) == 1.0
    assert bucket.refill(NOW_NS) == 1.0
    assert bucket.refill(NOW_NS + S // 4) == 1.5


@pytest.mark.parametrize("value", NOT_RATES)
def test_what_is_no_rate_is_refused(value: float) -> None:
    with pytest.raises(ConfigError, match=r"^rate: "):
        TokenBucket(value, now_ns=NOW_NS)
    with pytest.raises(ConfigError, match=r"^capacity: "):
        TokenBucket(1.0, now_ns=NOW_NS, capacity=value)


# -- the gate: each source -----------------------------------------------------------------------


@attrs.define
class Source:
    busy_until_ns: int = 0


def gate(source_rate: float = 10.0, global_rate: float = 1_000_000.0) -> FairGate:
    return FairGate(source_rate=source_rate, global_rate=global_rate)


def passed(door: FairGate, source: Source, now_ns: int, count: int, *, settled: bool = True) -> int:
    return sum(door.admit(source, now_ns, settled) is None for _ in range(count))


def test_a_source_may_say_one_second_s_worth_at_once() -> None:
    door, source = gate(10.0), Source()
    assert passed(door, source, NOW_NS, 10) == 10
    assert door.admit(source, NOW_NS, True) is Verdict.SOURCE_RATE


def test_a_source_has_its_next_token_at_its_time_and_not_a_nanosecond_before() -> None:
    door, source = gate(10.0), Source()
    passed(door, source, NOW_NS, 10)
    assert door.admit(source, NOW_NS + S // 10 - 1, True) is Verdict.SOURCE_RATE
    assert door.admit(source, NOW_NS + S // 10, True) is None
    assert door.admit(source, NOW_NS + S // 10, True) is Verdict.SOURCE_RATE


def test_a_source_that_rested_has_no_more_than_one_second_s_worth() -> None:
    door, source = gate(10.0), Source()
    passed(door, source, NOW_NS, 10)
    assert passed(door, source, NOW_NS + 1000 * S, 100) == 10


def test_sources_do_not_draw_from_each_other() -> None:
    door, loud, quiet = gate(10.0), Source(), Source()
    passed(door, loud, NOW_NS, 100)
    assert passed(door, quiet, NOW_NS, 10) == 10


@pytest.mark.parametrize("rate", [1, 2, 10, 64, 1000])
def test_a_source_is_granted_exactly_what_a_bucket_grants(rate: int) -> None:
    draw = random.Random(rate)  # noqa: S311 - the same in each run
    door, source, now_ns = gate(rate), Source(), NOW_NS
    tokens, updated_ns = Fraction(rate), now_ns
    for _ in range(3000):
        now_ns += draw.choice([0, 0, 1, S // rate - 1, S // rate, S // 3, draw.randrange(2 * S)])
        tokens = min(Fraction(rate), tokens + Fraction((now_ns - updated_ns) * rate, S))
        updated_ns = now_ns
        for _ in range(draw.randrange(4)):
            assert (door.admit(source, now_ns, True) is None) == (tokens >= 1)
            tokens -= tokens >= 1


@pytest.mark.parametrize("rate", [1.0, 1.5, 3.0, 7.3, 99.99, 3e6])
def test_in_no_window_more_passes_than_the_burst_and_the_rate(rate: float) -> None:
    draw = random.Random(3)  # noqa: S311 - the same in each run
    door, source, now_ns = gate(rate, 1e9), Source(), NOW_NS
    times_ns: list[int] = []
    for _ in range(2000):
        now_ns += draw.choice([0, 0, 0, 1, int(S / rate), int(S / rate / 3)])
        times_ns += [now_ns] * passed(door, source, now_ns, draw.randrange(6))
    for _ in range(5000):
        first, last = sorted(draw.sample(range(len(times_ns)), 2))
        window_ns = times_ns[last] - times_ns[first]
        assert last - first + 1 <= Fraction(rate) * (1 + Fraction(window_ns, S))


# -- the gate: all together ----------------------------------------------------------------------


def test_all_together_may_say_one_second_s_worth_at_once() -> None:
    door = gate(10.0, 20.0)
    granted = [door.admit(Source(), NOW_NS, True) for _ in range(21)]
    assert granted == [None] * 20 + [Verdict.GLOBAL_RATE]
    assert door.admit(Source(), NOW_NS + S // 20 - 1, True) is Verdict.GLOBAL_RATE
    assert door.admit(Source(), NOW_NS + S // 20, True) is None


def test_strangers_leave_the_lower_half_to_those_who_have_been_heard_before() -> None:
    door = gate(10.0, 20.0)
    granted = [door.admit(Source(), NOW_NS, False) for _ in range(100)]
    assert granted.count(None) == 10
    assert set(granted[10:]) == {Verdict.GLOBAL_RATE}
    assert sum(door.admit(Source(), NOW_NS, True) is None for _ in range(100)) == 10


def test_a_loud_source_leaves_the_lower_half_to_others_too() -> None:
    door, loud = gate(10.0, 20.0), Source()
    # It has spent more than half of its own bucket.
    assert passed(door, loud, NOW_NS, 6) == 6
    # Ten of twenty are gone now, and one more.
    assert sum(door.admit(Source(), NOW_NS, True) is None for _ in range(5)) == 5
    assert door.admit(loud, NOW_NS, True) is Verdict.GLOBAL_RATE
    assert door.admit(Source(), NOW_NS, True) is None


def test_whoever_the_global_bucket_turns_away_keeps_its_own_token() -> None:
    door, source = gate(10.0, 2.0), Source()
    assert passed(door, source, NOW_NS, 2) == 2
    busy_until_ns = source.busy_until_ns
    assert door.admit(source, NOW_NS, True) is Verdict.GLOBAL_RATE
    assert source.busy_until_ns == busy_until_ns


def test_whoever_its_own_bucket_turns_away_costs_the_others_nothing() -> None:
    door = gate(1.0, 3.0)
    loud = Source()
    passed(door, loud, NOW_NS, 1000)
    assert sum(door.admit(Source(), NOW_NS, True) is None for _ in range(10)) == 2


def test_a_flood_of_strangers_does_not_silence_quiet_known_sources() -> None:
    door = gate(100.0, 1000.0)
    quiet = [Source() for _ in range(100)]
    for tenth in range(100):
        now_ns = NOW_NS + tenth * S // 10
        for _ in range(5000):
            door.admit(Source(), now_ns, False)
        if tenth % 10 == 0:
            assert [door.admit(source, now_ns, True) for source in quiet] == [None] * 100


@pytest.mark.parametrize(("source_rate", "global_rate"), [(1.0, 1.0), (1.0, 1e9), (1e9, 1.0)])
def test_the_smallest_and_largest_rates_let_somebody_pass(
    source_rate: float, global_rate: float
) -> None:
    door, source = gate(source_rate, global_rate), Source()
    assert door.admit(source, NOW_NS, False) is None
    assert door.admit(source, NOW_NS, False) is not None
    assert door.admit(source, NOW_NS + S, False) is None


@pytest.mark.parametrize("value", NOT_RATES)
def test_what_is_no_rate_is_refused_by_the_gate(value: float) -> None:
    with pytest.raises(ConfigError, match=r"^source_rate: "):
        gate(source_rate=value)
    with pytest.raises(ConfigError, match=r"^global_rate: "):
        gate(global_rate=value)


# -- the gate: charges ---------------------------------------------------------------------------


def test_a_charge_takes_tokens_from_a_source() -> None:
    door, source = gate(10.0), Source()
    door.charge(source, 7, NOW_NS)
    assert passed(door, source, NOW_NS, 10) == 3


def test_a_charge_counts_upon_what_was_spent_already() -> None:
    door, source = gate(10.0), Source()
    passed(door, source, NOW_NS, 2)
    door.charge(source, 7, NOW_NS)
    assert passed(door, source, NOW_NS, 10) == 1


def test_a_bucket_does_not_go_below_empty() -> None:
    door, source = gate(10.0), Source()
    for _ in range(100):
        door.charge(source, 9, NOW_NS)
    assert door.admit(source, NOW_NS + S // 10 - 1, True) is Verdict.SOURCE_RATE
    assert door.admit(source, NOW_NS + S // 10, True) is None


def test_a_charge_costs_the_others_nothing() -> None:
    door, source = gate(10.0, 20.0), Source()
    door.charge(source, 100, NOW_NS)
    assert sum(door.admit(Source(), NOW_NS, True) is None for _ in range(30)) == 20


def test_what_all_may_still_say_shrinks_with_each_message_and_comes_back() -> None:
    door = gate(100.0, 100.0)
    assert door.tokens(NOW_NS) == 100
    passed(door, Source(), NOW_NS, 30)
    assert door.tokens(NOW_NS) == 70
    assert door.tokens(NOW_NS + S // 10) == 80
    for _ in range(10):
        passed(door, Source(), NOW_NS, 30)
    assert door.tokens(NOW_NS) == 0
    assert door.tokens(NOW_NS + 10 * S) == 100
