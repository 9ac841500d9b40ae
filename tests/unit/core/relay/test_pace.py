from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.relay.pace import Pace

S = 10**9


def test_what_is_spent_is_paid_for_before_more_may_pass() -> None:
    pace = Pace(10, S // 10, now_ns=5)
    assert pace.free_ns <= 5
    pace.spend(1, 5)
    assert pace.free_ns == 5
    pace.spend(1, 5)
    assert pace.free_ns == 5 + S // 10
    pace.spend(1, 9 * S)
    assert pace.free_ns == 9 * S


@settings(deadline=None)
@given(
    st.floats(0.01, 1e9),
    st.integers(0, S),
    st.lists(st.tuples(st.integers(0, S), st.integers(0, 10**6)), max_size=30),
)
def test_no_more_passes_than_the_rate_gives_and_the_last_one(
    rate: float, slack_ns: int, steps: list[tuple[int, int]]
) -> None:
    pace = Pace(rate, slack_ns, now_ns=0)
    now = 0
    passed: list[tuple[int, int]] = []
    for later, amount in steps:
        now += later
        if pace.free_ns <= now:
            passed.append((now, amount))
            pace.spend(amount, now)
    for at, (start, _) in enumerate(passed):
        for until in range(at, len(passed)):
            before = sum(amount for _, amount in passed[at:until])
            given_in_time = rate * (passed[until][0] - start + slack_ns) / S
            assert before <= given_in_time * (1 + 1e-9) + 1e-6
