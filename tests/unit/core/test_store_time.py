"""The store in time: every status exact, everything in its order, whenever somebody looks."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.limits import MAX_HISTORY
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from tests.unit.core.house import EXPIRY, TTL, House, S

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT


@pytest.fixture
def house() -> House:
    return House()


# -- time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ttl_s", [10.0, 0.1, 1 / 3, 1e-9])
def test_status_is_exact_to_the_nanosecond(ttl_s: float) -> None:
    house = House(ttl_s=ttl_s, expiry_s=3 * ttl_s)
    ttl, expiry = house.store.ttl_ns, house.store.expiry_ns
    house.hear()
    house.wait(ttl - 1)
    assert house.status() is ACTIVE
    house.wait(1)
    assert house.status() is STALE
    house.wait(expiry - ttl - 1)
    assert house.status() is STALE
    house.wait(1)
    assert house.status() is None


def test_with_a_ttl_of_zero_everything_is_stale_at_once() -> None:
    house = House(ttl_s=0.0, expiry_s=2.0)
    house.hear()
    assert house.status() is STALE
    house.wait(2 * S)
    assert house.status() is None


def test_with_no_time_at_all_nothing_is_ever_kept() -> None:
    house = House(ttl_s=0.0, expiry_s=0.0)
    assert house.hear() is Verdict.OLDER
    assert house.store.size() == 0


def test_what_became_due_takes_effect_at_its_own_time(house: House) -> None:
    begun = house.now
    house.hear()
    house.wait(100 * S)
    assert house.steps() == [(begun + TTL, STALE, Cause.SILENT)]
    house.hear()
    assert house.steps()[1:] == [(house.now, ACTIVE, Cause.HEARD)]


def test_whoever_is_heard_again_lives_on_with_its_words(house: House) -> None:
    house.hear(display_name="A")
    house.wait(EXPIRY - 1)
    assert house.hear() is Verdict.REFRESHED
    stored = house.get()
    assert (stored.status, stored.cause, stored.hint.display_name) == (ACTIVE, Cause.HEARD, "A")


def test_a_life_after_the_expiry_begins_empty(house: House) -> None:
    house.hear(display_name="A", metadata={"k": "v"})
    house.wait(EXPIRY)
    assert house.hear(process_id=1) is Verdict.NEW
    assert house.get().hint == BeaconHint("e", process_id=1)
    assert house.get().history == ()


@pytest.mark.parametrize("jump", [EXPIRY, 1000 * EXPIRY, 2**62, 2**70])
def test_a_clock_that_jumps_far_ahead_leaves_nobody_behind(house: House, jump: int) -> None:
    for number in range(10):
        house.hear(f"e{number}")
        house.wait(S)
    house.wait(jump)
    assert house.store.sweep() == 20
    assert house.store.stats().expired == 10
    assert house.hear() is Verdict.NEW


def test_a_store_that_is_only_read_is_as_one_that_is_swept_often() -> None:
    seldom, often = House(), House()
    for second in range(400):
        for house in (seldom, often):
            house.wait(S)
            if second in {0, 5, 100, 130, 311}:
                house.hear("a")
            if second in {0, 50, 51, 350}:
                house.hear("b")
        often.store.sweep()
    for name in "ab":
        assert seldom.get(name) == often.get(name)
    assert seldom.store.stats() == often.store.stats()


def test_what_is_due_at_once_takes_effect_in_the_order_of_the_ids(house: House) -> None:
    for name in "cab":
        house.hear(name)
    house.wait(TTL)
    assert [one.entity_id for one in house.store.snapshot()] == ["a", "b", "c"]


@pytest.mark.parametrize(
    "look",
    [
        lambda store: store.get("e"),
        lambda store: store.last_seen_ns("e"),
        lambda store: store.snapshot() or None,
        lambda store: store.size() or None,
        lambda store: store.changes_since(0).hints or None,
        lambda store: store.forget("e") or None,
        lambda store: store.stats().stale or None,
    ],
)
def test_whatever_is_asked_the_expired_are_gone(house: House, look: Any) -> None:
    house.hear()
    house.wait(TTL)
    assert house.store.get("e") is not None
    house.wait(EXPIRY)
    assert look(house.store) is None


def test_a_sweep_tells_how_many_changes_it_made(house: House) -> None:
    house.hear("a")
    house.hear("b")
    house.wait(TTL - 1)
    assert house.store.sweep() == 0
    house.wait(1)
    assert house.store.sweep() == 2
    assert house.store.sweep() == 0


def test_before_the_next_deadline_a_sweep_finds_nothing_and_soon_after_it_does(
    house: House,
) -> None:
    draws = itertools.cycle([0, 3 * S, 1, 7 * S, S // 3, 0, 2 * S])
    for number in range(30):
        house.hear(f"e{number}")
        house.wait(next(draws))
    house.store.goodbye("e29")
    house.store.lost("e28")
    while (early := house.store.next_deadline_ns()) is not None:
        house.wait(max(0, early - 1 - house.now))
        assert house.store.sweep() == 0
        house.wait(early - house.now)
        # At most a sixteenth of the ttl early; then a second look is exact.
        if house.store.sweep() == 0:
            exact = house.store.next_deadline_ns()
            assert exact is not None
            assert early < exact <= early + TTL // 16
            house.wait(exact - house.now)
            assert house.store.sweep() > 0
    assert house.store.size() == 0


def test_the_history_keeps_the_latest_steps(house: House) -> None:
    for _ in range(MAX_HISTORY):
        house.hear()
        house.wait(TTL)
    house.hear()
    steps = house.get().history
    assert len(steps) == MAX_HISTORY
    assert [one.status for one in steps] == [STALE, ACTIVE] * (MAX_HISTORY // 2)
    assert steps[-1] == Transition(house.now, ACTIVE, Cause.HEARD)


def test_time_never_goes_back_in_a_history() -> None:
    clock = ManualClock()
    store = HintStore(clock)
    held: list[bool] = []

    class Watched(ManualClock):
        def monotonic_ns(self) -> int:
            held.append(store.lock.locked())
            return clock.monotonic_ns()

    store.clock = Watched()
    store.update(BeaconHint("e"))
    # Whoever reads the clock before it has the lock may be overtaken by somebody later.
    assert held == [True]
