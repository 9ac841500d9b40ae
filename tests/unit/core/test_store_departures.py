"""Goodbyes and losses: at once, once, and not undone by what was under way."""

from __future__ import annotations

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.outcome import Verdict
from tests.unit.core.house import EXPIRY, TTL, House, S

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT


@pytest.fixture
def house() -> House:
    return House()


# -- goodbye and loss ------------------------------------------------------------------------------


def test_whoever_says_goodbye_has_left_at_once(house: House) -> None:
    house.hear()
    house.wait(S)
    assert house.store.goodbye("e", source="r") is Verdict.LEFT
    stored = house.get()
    assert (stored.status, stored.cause) == (LEFT, Cause.GOODBYE)
    assert stored.last_seen_ns == house.now - S
    assert house.steps() == [(house.now, LEFT, Cause.GOODBYE)]
    assert house.store.snapshot() == []
    assert house.store.size() == 0
    assert [one.entity_id for one in house.store.changes_since(1).hints] == ["e"]


def test_a_tombstone_stands_for_one_ttl_from_the_goodbye(house: House) -> None:
    house.hear()
    house.wait(7 * S)
    house.store.goodbye("e")
    house.wait(TTL - 1)
    assert house.status() is LEFT
    house.wait(1)
    assert house.status() is None


def test_a_tombstone_may_outlast_the_expiry(house: House) -> None:
    house.hear()
    house.wait(EXPIRY - 1)
    house.store.goodbye("e")
    house.wait(TTL - 1)
    assert house.status() is LEFT


@pytest.mark.parametrize("incarnation", ["", "i"])
def test_a_message_under_way_at_the_goodbye_does_not_revive(house: House, incarnation: str) -> None:
    house.hear(incarnation=incarnation, sequence=5)
    house.store.goodbye("e", source="r", incarnation=incarnation, sequence=7)
    for sequence in (0, 5, 6, 7):
        house.wait(S)
        verdict = house.hear(incarnation=incarnation, sequence=sequence)
        assert verdict is Verdict.BURIED
    assert house.status() is LEFT
    assert house.store.stats().buried == 4


def test_the_count_is_kept_for_the_goodbye_also_without_incarnations(house: House) -> None:
    for sequence in range(1, 6):
        house.hear(sequence=sequence)
    house.store.goodbye("e", source="r")
    assert house.hear(sequence=5) is Verdict.BURIED
    assert house.hear(sequence=6) is Verdict.CHANGED


def test_an_older_message_after_a_goodbye_is_older_and_not_even_buried(house: House) -> None:
    house.hear()
    house.store.goodbye("e")
    assert house.hear(age=1) is Verdict.OLDER


def test_whoever_proves_a_new_life_after_its_goodbye_begins_it_empty(house: House) -> None:
    house.hear(incarnation="i", sequence=5, display_name="A")
    house.store.goodbye("e", source="r", incarnation="i", sequence=6)
    house.wait(S)
    assert house.hear(incarnation="i", sequence=7, component_id="c") is Verdict.CHANGED
    stored = house.get()
    assert (stored.status, stored.cause, stored.restarts) == (ACTIVE, Cause.HEARD, 0)
    assert stored.hint == BeaconHint("e", component_id="c")
    assert stored.first_seen_ns == house.now
    assert stored.history[-1].detail == "the same process again"


def test_another_process_needs_no_proof_after_a_goodbye(house: House) -> None:
    house.hear(incarnation="i")
    house.store.goodbye("e", source="r", incarnation="i")
    assert house.hear(incarnation="j") is Verdict.CHANGED
    assert (house.status(), house.get().restarts) == (ACTIVE, 1)


def test_a_new_life_may_be_stale_from_the_first(house: House) -> None:
    house.hear(age=50 * S, incarnation="i")
    house.store.goodbye("e", source="r")
    assert house.hear(incarnation="j", age=TTL) is Verdict.CHANGED
    assert (house.status(), house.get().cause) == (STALE, Cause.HEARD_LATE)


def test_after_the_tombstone_anybody_may_begin_anew(house: House) -> None:
    house.hear(display_name="A")
    house.store.goodbye("e")
    house.wait(TTL)
    assert house.hear() is Verdict.NEW
    assert house.get().hint == BeaconHint("e")


def test_whoever_was_lost_is_stale_at_once_with_the_reason(house: House) -> None:
    house.hear()
    house.wait(S)
    assert house.store.lost("e", source="r", reason="cable cut") is Verdict.LOST
    stored = house.get()
    assert (stored.status, stored.cause, stored.detail) == (STALE, Cause.LOST, "cable cut")
    assert stored.history == (Transition(house.now, STALE, Cause.LOST, "cable cut"),)
    house.wait(EXPIRY - S - 1)
    assert house.status() is STALE
    house.wait(1)
    assert house.status() is None


def test_whoever_was_lost_and_is_heard_is_active_again(house: House) -> None:
    house.hear()
    house.wait(S)
    house.store.lost("e")
    assert house.hear() is Verdict.REFRESHED
    assert (house.status(), house.get().detail) == (ACTIVE, "")


def test_what_was_sent_before_the_loss_does_not_undo_it(house: House) -> None:
    house.hear()
    house.wait(5 * S)
    house.store.lost("e")
    assert house.hear(age=1) is Verdict.OLDER
    assert house.status() is STALE


def test_departing_twice_is_once(house: House) -> None:
    house.hear()
    assert house.store.lost("e") is Verdict.LOST
    assert house.store.lost("e") is Verdict.OLDER
    assert house.store.goodbye("e") is Verdict.LEFT
    assert house.store.goodbye("e") is Verdict.OLDER
    assert house.store.lost("e") is Verdict.OLDER
    assert house.status() is LEFT


def test_a_repeated_goodbye_from_before_the_last_words_changes_nothing(house: House) -> None:
    house.hear(incarnation="i", sequence=5)
    assert house.store.goodbye("e", source="r", incarnation="i", sequence=5) is Verdict.OLDER
    assert house.status() is ACTIVE


@pytest.mark.parametrize("source", ["r", ""])
def test_nobody_can_take_leave_of_the_unknown(house: House, source: str) -> None:
    assert house.store.goodbye("e", source=source) is Verdict.UNKNOWN
    assert house.store.lost("e", source=source) is Verdict.UNKNOWN


def test_nobody_can_take_leave_for_another(house: House) -> None:
    house.hear(incarnation="i")
    assert house.store.goodbye("e", source="s") is Verdict.UNKNOWN
    assert house.store.lost("e", source="r", incarnation="j") is Verdict.UNKNOWN
    assert house.status() is ACTIVE
