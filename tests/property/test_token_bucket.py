"""What the buckets grant, whatever the rates, the times and the others do."""

from __future__ import annotations

from fractions import Fraction
from itertools import chain

import attrs
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.token_bucket import FairGate, TokenBucket

SECOND = 10**9
OFTEN = settings(max_examples=200, deadline=None)
ROUNDING_NS = 500
"""The gate's tokens take up to a nanosecond longer to grow than they should; and there are few."""
A_MILLIONTH = Fraction(1, 10**6)
"""Of a token: what floating point may add up to."""

rates = st.sampled_from([1.0, 1.5, 2.0, 3.0, 7.0, 10.0, 100.0, 333.3, 10_000.0])
# Much at one moment, evenly spread, long pauses, and everything between.
pauses = st.one_of(
    st.just(0),
    st.integers(0, 1_000),
    st.integers(0, SECOND // 10),
    st.integers(0, 3 * SECOND),
    st.sampled_from([SECOND // 10, SECOND // 2, SECOND - 1, SECOND, SECOND + 1]),
)
# After a pause, so many messages at once.
arrivals = st.lists(st.tuples(pauses, st.integers(1, 12)), max_size=25)


@attrs.define
class Source:
    settled: bool = True
    busy_until_ns: int = 0


def assert_within(times_ns: list[int], burst: float, rate: float) -> None:
    """In no window are there more than the burst and the rate times the window's length."""
    most = Fraction(burst) + A_MILLIONTH
    for first, begin_ns in enumerate(times_ns):
        for last in range(first, len(times_ns)):
            window = Fraction(times_ns[last] - begin_ns, SECOND)
            assert last - first + 1 <= most + Fraction(rate) * window


@OFTEN
@given(rate=rates, capacity=st.none() | st.sampled_from([1.0, 2.5, 20.0]), arriving=arrivals)
def test_in_any_window_a_bucket_grants_at_most_its_capacity_and_its_rate(
    rate: float, capacity: float | None, arriving: list[tuple[int, int]]
) -> None:
    now_ns = 0
    bucket = TokenBucket(rate, now_ns=now_ns, capacity=capacity)
    granted: list[int] = []
    for pause, count in arriving:
        now_ns += pause
        granted += [now_ns for _ in range(count) if bucket.try_consume(now_ns)]
    assert_within(granted, rate if capacity is None else capacity, rate)


@OFTEN
@given(rate=rates, arriving=arrivals)
def test_a_bucket_refuses_nothing_that_it_could_grant(
    rate: float, arriving: list[tuple[int, int]]
) -> None:
    now_ns, tokens = 0, Fraction(rate)
    bucket = TokenBucket(rate, now_ns=now_ns)
    for pause, count in arriving:
        now_ns += pause
        tokens = min(Fraction(rate), tokens + Fraction(rate) * Fraction(pause, SECOND))
        for _ in range(count):
            granted = bucket.try_consume(now_ns)
            # Where a token is just about whole, floating point may see it either way.
            assert granted or tokens < 1 + A_MILLIONTH
            tokens -= granted


@OFTEN
@given(source_rate=rates, global_rate=rates, data=st.data())
def test_in_any_window_no_source_and_not_all_together_pass_more_than_burst_and_rate(
    source_rate: float, global_rate: float, data: st.DataObject
) -> None:
    gate = FairGate(source_rate=source_rate, global_rate=global_rate)
    sources = [Source(settled=number % 2 == 0) for number in range(4)]
    passed: list[list[int]] = [[] for _ in sources]
    now_ns = 0
    for pause, count in data.draw(arrivals):
        now_ns += pause
        who = data.draw(st.lists(st.integers(0, 3), min_size=count, max_size=count))
        for number in who:
            if gate.admit(sources[number], now_ns, sources[number].settled) is None:
                passed[number].append(now_ns)
        if data.draw(st.booleans()):
            gate.charge(sources[who[0]], 9, now_ns)
    for times_ns in passed:
        assert_within(times_ns, source_rate, source_rate)
    assert_within(sorted(chain(*passed)), global_rate, global_rate)


class Promise:
    """What is promised to settled sources of which none has spent more than half of its own burst.

    None of them is refused as long as all of them together send, in any window of ``t`` seconds,
    at most ``(G - 1) / 2 + G * t`` messages, where ``G`` is the global rate: half of the burst is
    kept for them, and then all that grows. Whatever strangers do. A loud source is one of them
    only until half of its own burst is spent.
    """

    def __init__(self, source_rate: float, global_rate: float) -> None:
        self._own_step = Fraction(SECOND) / Fraction(source_rate)
        self._own_half = (Fraction(source_rate) - 1) * self._own_step / 2
        self._step = Fraction(SECOND) / Fraction(global_rate)
        # Before the message that is asked about: one less.
        self._most = (Fraction(global_rate) - 1) * self._step / 2 - self._step
        self._spent, self._at_ns = Fraction(0), 0

    def covers(self, source: Source, now_ns: int) -> bool:
        """Would this message be within the promise?"""
        self._pass_time(now_ns)
        return self.is_quiet(source, now_ns, -ROUNDING_NS) and (
            self._spent <= self._most - ROUNDING_NS
        )

    def is_quiet(self, source: Source, now_ns: int, beside_ns: int = ROUNDING_NS) -> bool:
        return source.busy_until_ns - now_ns <= self._own_half + beside_ns

    def count(self, now_ns: int) -> None:
        """One of them has sent one."""
        self._pass_time(now_ns)
        self._spent += self._step

    def _pass_time(self, now_ns: int) -> None:
        self._spent = max(Fraction(0), self._spent - (now_ns - self._at_ns))
        self._at_ns = now_ns


@OFTEN
@given(
    source_rate=st.sampled_from([3.0, 10.0, 100.0]),
    global_rate=st.sampled_from([4.0, 10.0, 50.0]),
    arriving=st.lists(
        st.tuples(pauses, st.integers(0, 30), st.integers(0, 20), st.integers(0, 12)), max_size=12
    ),
)
def test_who_is_known_and_quiet_is_heard_whatever_strangers_and_loud_ones_do(
    source_rate: float, global_rate: float, arriving: list[tuple[int, int, int, int]]
) -> None:
    gate = FairGate(source_rate=source_rate, global_rate=global_rate)
    promise = Promise(source_rate, global_rate)
    known, loud, now_ns = [Source() for _ in range(5)], Source(), 0
    for pause, strangers, shouts, spoken in arriving:
        now_ns += pause
        for _ in range(strangers):
            gate.admit(Source(settled=False), now_ns, False)
        for _ in range(shouts):
            was_quiet = promise.is_quiet(loud, now_ns)
            if gate.admit(loud, now_ns, True) is None and was_quiet:
                promise.count(now_ns)
        for number in range(spoken):
            source = known[number % 5]
            if promise.covers(source, now_ns):
                assert gate.admit(source, now_ns, True) is None
                promise.count(now_ns)


@OFTEN
@given(
    rate=st.sampled_from([4.0, 10.0, 100.0]),
    share=st.floats(0.3, 1.0),
    floods=st.lists(st.lists(st.floats(0, 1), max_size=30), min_size=1, max_size=10),
)
def test_who_speaks_evenly_at_its_rate_is_heard_beside_any_flood_of_strangers(
    rate: float, share: float, floods: list[list[float]]
) -> None:
    """The everyday case: a robot at up to its own rate, under a global one of ten times that."""
    gate = FairGate(source_rate=rate, global_rate=10 * rate)
    robot, now_ns = Source(), 0
    period_ns = int(SECOND / (rate * share)) + 1
    for flood in floods * 10:
        for part in sorted(flood):
            gate.admit(Source(settled=False), now_ns + int(part * period_ns), False)
        now_ns += period_ns
        assert gate.admit(robot, now_ns, True) is None


@OFTEN
@given(rates, st.lists(st.tuples(pauses, st.integers(0, 20)), max_size=20))
def test_a_charge_delays_a_source_by_no_more_than_emptying_its_bucket_would(
    rate: float, charges: list[tuple[int, int]]
) -> None:
    gate = FairGate(source_rate=rate, global_rate=1e9)
    source, now_ns = Source(), 0
    for pause, tokens in charges:
        now_ns += pause
        gate.charge(source, tokens, now_ns)
    # One nanosecond for the rounding of a token's time.
    assert gate.admit(source, now_ns + int(SECOND / rate) + 1, True) is None
