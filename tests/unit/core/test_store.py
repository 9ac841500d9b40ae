"""The store: words kept, changes told, the short way, and all of it from several threads.

What time does is in test_store_time.py, goodbyes and losses in test_store_departures.py, rival
claims in test_store_claims.py, full stores in test_store_room.py, what was known before a restart
in test_store_restore.py, and what the C++ system does in test_store_vectors.py. This file holds
some of each.
"""

from __future__ import annotations

import itertools
import math
import threading
from collections import Counter
from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.claims import Claimant
from beacon_core.errors import ConfigError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.limits import MAX_CLAIMS, hint_bytes
from beacon_core.outcome import Verdict
from beacon_core.record import Record
from beacon_core.stored import StoredHint
from beacon_core.testing.examples import BENCH_HINT
from tests.unit.core.house import EXPIRY, TTL, House, S, check_sums

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT


@pytest.fixture
def house() -> House:
    return House()


# -- configuration ---------------------------------------------------------------------------------


def test_the_times_are_those_of_ros2_medkit_unless_told(house: House) -> None:
    assert (house.store.ttl_ns, house.store.expiry_ns) == (TTL, EXPIRY)


@pytest.mark.parametrize("expiry_s", [0.0, 0.2, 0.3])
def test_an_expiry_not_above_the_ttl_becomes_ten_times_the_ttl(expiry_s: float) -> None:
    assert House(ttl_s=0.3, expiry_s=expiry_s).store.expiry_ns == 3 * S


def test_an_expiry_just_above_the_ttl_is_taken() -> None:
    assert House(ttl_s=0.3, expiry_s=0.301).store.expiry_ns == 301_000_000


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *itertools.product(["ttl_s", "expiry_s"], [math.nan, math.inf, -1.0, 1e300]),
        *itertools.product(["max_hints", "max_bytes"], [0, -1, math.nan]),
    ],
)
def test_what_cannot_be_configured_is_refused_by_name(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=rf"^{key}: "):
        House(**{key: value})


def test_an_expiry_that_would_be_too_long_is_refused_too() -> None:
    with pytest.raises(ConfigError, match=r"^10 x ttl_s: "):
        House(ttl_s=1e9)


# -- words -----------------------------------------------------------------------------------------


def test_an_empty_store_knows_nothing(house: House) -> None:
    assert house.store.get("e") is None
    assert house.store.last_seen_ns("e") is None
    assert house.store.snapshot() == []
    assert house.store.size() == 0
    assert house.store.revision == 0
    assert house.store.sweep() == 0
    assert house.store.next_deadline_ns() is None


def test_what_was_said_can_be_read(house: House) -> None:
    verdict = house.store.update(BENCH_HINT, source="r", incarnation="i", sequence=7)
    assert verdict is Verdict.NEW
    stored = house.get(BENCH_HINT.entity_id)
    assert stored == StoredHint(
        hint=BENCH_HINT,
        status=ACTIVE,
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=house.now,
        first_seen_ns=house.now,
        source="r",
        incarnation="i",
        revision=1,
        restarts=0,
    )
    assert house.store.last_seen_ns(BENCH_HINT.entity_id) == house.now


def test_given_fields_overwrite_and_the_others_stay(house: House) -> None:
    house.hear(display_name="A", process_id=1, function_ids=("f", "g"), metadata={"k": "1"})
    assert house.hear(display_name="B", metadata={"l": "2"}) is Verdict.CHANGED
    assert house.get().hint == BeaconHint(
        "e", display_name="B", process_id=1, function_ids=("f", "g"), metadata={"l": "2"}
    )


def test_the_same_again_only_refreshes(house: House) -> None:
    house.hear(display_name="A", process_id=1)
    revision = house.store.revision
    house.wait(S)
    assert house.hear(display_name="A") is Verdict.REFRESHED
    assert house.get().last_seen_ns == house.now
    assert house.store.revision == revision


def test_values_given_out_never_change(house: House) -> None:
    house.hear(display_name="A")
    before, snapshot = house.get(), house.store.snapshot()
    copy = attrs.evolve(before)
    house.wait(TTL)
    house.hear(display_name="B")
    assert before == copy == snapshot[0] != house.get()


def test_nobody_in_particular_speaks_for_whoever_holds_the_id(house: House) -> None:
    house.hear(source="r", incarnation="i", process_id=1, hostname="h")
    assert house.hear(source="", process_id=2, hostname="g") is Verdict.CHANGED
    stored = house.get()
    assert (stored.source, stored.incarnation) == ("r", "i")
    assert (stored.hint.process_id, stored.hint.hostname) == (2, "g")


def test_what_many_hints_have_in_common_is_held_once(house: House) -> None:
    for name in "ab":
        house.hear(name, hostname=f"robot-{len(name)}")
    assert house.get("a").hint.hostname is house.get("b").hint.hostname


def test_ids_are_told_apart_by_every_letter(house: House) -> None:
    house.hear("e")
    house.hear("E")
    assert house.store.size() == 2


# -- when it was said ------------------------------------------------------------------------------


def test_a_message_counts_from_when_it_was_sent(house: House) -> None:
    house.hear(age=3 * S)
    assert house.get().last_seen_ns == house.now - 3 * S


def test_time_before_the_start_of_the_clock_is_time_too(house: House) -> None:
    house.hear(age=5 * S)
    assert house.get().last_seen_ns < 0
    house.wait(5 * S - 1)
    assert house.status() is ACTIVE
    house.wait(1)
    assert house.status() is STALE


def test_a_message_from_the_future_counts_as_sent_now(house: House) -> None:
    house.hear(age=-1000 * S)
    assert house.get().last_seen_ns == house.now
    house.wait(TTL)
    assert house.status() is STALE


def test_an_older_message_changes_nothing(house: House) -> None:
    house.hear(display_name="new")
    house.wait(S)
    house.hear(age=S // 2)
    before = house.get()
    assert house.hear(age=S // 2 + 1, display_name="old") is Verdict.OLDER
    assert house.get() is before


def test_a_message_of_the_same_moment_counts(house: House) -> None:
    house.hear(age=S, display_name="A")
    assert house.hear(age=S, display_name="B") is Verdict.CHANGED


@pytest.mark.parametrize("age", [EXPIRY, EXPIRY + 1, 1000 * EXPIRY])
def test_a_message_that_is_expired_on_arrival_begins_nothing(house: House, age: int) -> None:
    assert house.hear(age=age) is Verdict.OLDER
    assert house.store.get("e") is None
    assert house.store.revision == 0


def test_a_message_older_than_the_ttl_begins_a_stale_life(house: House) -> None:
    assert house.hear(age=TTL) is Verdict.NEW
    stored = house.get()
    assert (stored.status, stored.cause) == (STALE, Cause.HEARD_LATE)
    house.wait(EXPIRY - TTL - 1)
    assert house.status() is STALE
    house.wait(1)
    assert house.status() is None


def test_a_late_message_keeps_a_stale_life_without_reviving_it(house: House) -> None:
    house.hear()
    house.wait(100 * S)
    assert house.hear(age=50 * S, display_name="A") is Verdict.CHANGED
    stored = house.get()
    assert (stored.status, stored.cause) == (STALE, Cause.SILENT)
    assert stored.last_seen_ns == house.now - 50 * S
    house.wait(EXPIRY - 50 * S - 1)
    assert house.status() is STALE
    house.wait(1)
    assert house.status() is None


# -- numbers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("sequence", [4, 5])
def test_a_number_that_is_not_higher_is_late_or_a_repetition(house: House, sequence: int) -> None:
    house.hear(incarnation="i", sequence=5)
    house.wait(S)
    assert house.hear(incarnation="i", sequence=sequence, display_name="A") is Verdict.OLDER
    assert house.get().last_seen_ns == house.now - S


def test_a_higher_number_counts_even_if_a_clock_was_set_back(house: House) -> None:
    house.hear(incarnation="i", sequence=5)
    assert house.hear(incarnation="i", sequence=6, age=5 * S, display_name="A") is Verdict.CHANGED
    assert house.get().last_seen_ns == house.now


def test_numbers_without_an_incarnation_say_nothing(house: House) -> None:
    house.hear(sequence=5)
    assert house.hear(sequence=1, display_name="A") is Verdict.CHANGED


def test_messages_without_numbers_leave_the_count_alone(house: House) -> None:
    house.hear(incarnation="i", sequence=5)
    house.hear(incarnation="i")
    house.hear(sequence=100)
    assert house.hear(incarnation="i", sequence=5) is Verdict.OLDER
    assert house.hear(incarnation="i", sequence=6) is Verdict.REFRESHED


def test_numbers_are_counted_also_while_stale_and_beside_a_rival(house: House) -> None:
    house.hear(incarnation="i", sequence=1)
    house.wait(100 * S)
    assert house.hear(incarnation="i", sequence=5, age=TTL) is Verdict.REFRESHED
    assert house.hear(incarnation="i", sequence=5) is Verdict.OLDER
    assert house.hear(incarnation="i", sequence=6, hostname="h") is Verdict.CHANGED
    house.hear(source="s", hostname="g")
    assert house.hear(incarnation="i", sequence=7) is Verdict.REFRESHED
    assert house.hear(incarnation="i", sequence=7) is Verdict.OLDER


def test_an_incarnation_told_later_is_a_change(house: House) -> None:
    house.hear(sequence=9)
    revision = house.store.revision
    assert house.hear(incarnation="i", sequence=1) is Verdict.REFRESHED
    assert house.get().incarnation == "i"
    assert house.store.revision > revision


# -- departures, in short ------------------------------------------------------------------------


def test_a_goodbye_is_not_undone_by_what_was_under_way(house: House) -> None:
    house.hear(incarnation="i", sequence=5)
    assert house.store.goodbye("e", source="r", incarnation="i", sequence=7) is Verdict.LEFT
    assert house.hear(incarnation="i", sequence=6) is Verdict.BURIED
    assert house.hear(incarnation="i", sequence=6, age=1) is Verdict.OLDER
    assert house.status() is LEFT
    assert house.hear(incarnation="i", sequence=8) is Verdict.CHANGED
    assert house.status() is ACTIVE


def test_a_new_life_that_is_expired_on_arrival_is_none(house: House) -> None:
    house.hear(incarnation="i")
    house.wait(EXPIRY - 1)
    house.store.goodbye("e", source="r")
    house.wait(2)
    assert house.hear(incarnation="j", age=EXPIRY) is Verdict.OLDER
    assert house.status() is LEFT


def test_a_loss_is_not_undone_by_what_was_under_way(house: House) -> None:
    house.hear()
    house.wait(S)
    assert house.store.lost("e", source="r") is Verdict.LOST
    assert house.store.lost("e", source="r") is Verdict.OLDER
    assert house.hear(age=1) is Verdict.OLDER
    assert house.status() is STALE
    assert house.hear() is Verdict.REFRESHED
    assert house.status() is ACTIVE


def test_nobody_departs_whom_nobody_knows(house: House) -> None:
    assert house.store.goodbye("e") is Verdict.UNKNOWN
    house.hear()
    assert house.store.goodbye("e", source="s") is Verdict.UNKNOWN


# -- restarts and conflicts, in short --------------------------------------------------------------


def test_another_process_in_the_same_place_takes_the_id_over(house: House) -> None:
    house.hear(incarnation="i", display_name="A")
    assert house.hear(incarnation="j", process_id=1) is Verdict.CHANGED
    stored = house.get()
    assert (stored.incarnation, stored.hint) == ("j", BeaconHint("e", process_id=1))
    assert (stored.restarts, stored.conflict) == (1, False)
    assert house.store.stats().restarts == 1


def test_a_predecessor_that_speaks_again_is_a_rival(house: House) -> None:
    house.hear(incarnation="i")
    house.hear(incarnation="j")
    assert house.hear(incarnation="i", display_name="A") is Verdict.CONTENDED
    stored = house.get()
    assert stored.incarnation == "j"
    assert [one.incarnation for one in stored.claims] == ["j", "i"]
    assert house.store.stats().conflicts == 1
    assert house.hear(incarnation="j", display_name="B") is Verdict.CHANGED
    assert [one.hint.display_name for one in house.get().claims] == ["B", "A"]


def test_a_rival_that_falls_silent_ends_the_conflict(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.hear(source="b", hostname="g")
    house.wait(TTL - 1)
    house.hear(source="a", hostname="h")
    assert house.get().conflict
    house.wait(1)
    assert not house.get().conflict
    assert house.store.stats().conflicts == 0


def test_a_rival_holds_the_id_when_the_holder_falls_silent(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.wait(S)
    house.hear(source="b", hostname="g")
    house.wait(TTL - S)
    stored = house.get()
    assert (stored.source, stored.status, stored.conflict) == ("b", ACTIVE, False)
    assert stored.history == (Transition(house.now, ACTIVE, Cause.HEARD, "another host, source"),)


def test_the_freshest_rival_holds_the_id_when_the_holder_departs(house: House) -> None:
    for age, source in enumerate("abc"):
        house.hear(source=source, hostname=source, age=10 - age)
    assert house.store.goodbye("e", source="a") is Verdict.LEFT
    stored = house.get()
    assert (stored.source, stored.status) == ("c", ACTIVE)
    assert [one.source for one in stored.claims] == ["c", "b"]


def test_a_rival_that_departs_ends_its_claim(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.hear(source="b", hostname="g")
    assert house.store.lost("e", source="b") is Verdict.LOST
    stored = house.get()
    assert (stored.source, stored.status, stored.conflict) == ("a", ACTIVE, False)


def test_rivals_are_held_to_their_times_and_numbers_too(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.wait(S)
    hear_b: dict[str, Any] = {"source": "b", "incarnation": "i", "hostname": "g"}
    assert house.hear(**hear_b, age=S + 1) is Verdict.OLDER
    assert house.hear(**hear_b, sequence=5) is Verdict.CONTENDED
    assert house.hear(**hear_b, sequence=5) is Verdict.OLDER
    assert house.hear(**hear_b, age=1) is Verdict.OLDER
    assert house.store.goodbye("e", source="b", incarnation="i", sequence=4) is Verdict.OLDER
    assert house.hear(**hear_b, sequence=6, age=1) is Verdict.CONTENDED
    assert house.get().claims[1].last_seen_ns == house.now


def test_what_a_departed_rival_said_before_does_not_bring_it_back(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.hear(source="b", hostname="g")
    assert house.store.goodbye("e", source="b") is Verdict.LEFT
    assert house.store.goodbye("e", source="b") is Verdict.OLDER
    assert house.hear(source="b", hostname="g") is Verdict.BURIED
    assert not house.get().conflict


def test_who_held_the_id_before_does_not_hold_it_again_because_its_successor_has_gone(
    house: House,
) -> None:
    house.hear(incarnation="i", sequence=5)
    house.hear(incarnation="j", sequence=1)
    house.store.lost("e", source="r", incarnation="j")
    for sequence in (0, 4, 5):
        assert house.hear(incarnation="i", sequence=sequence) is Verdict.OLDER
    assert (house.status(), house.get().incarnation) == (STALE, "j")
    # A number proves that it spoke after that; and then the other one is the predecessor.
    assert house.hear(incarnation="i", sequence=6) is Verdict.CHANGED
    assert house.hear(incarnation="j", sequence=1) is Verdict.OLDER
    house.store.goodbye("e", source="r", incarnation="i", sequence=7)
    assert house.hear(incarnation="k") is Verdict.CHANGED
    assert house.hear(incarnation="i", sequence=7) is Verdict.BURIED
    for _ in range(3):
        house.wait(TTL - 1)
        house.hear(incarnation="k")
    assert house.hear(incarnation="i", sequence=7) is Verdict.OLDER
    house.wait(TTL)
    assert house.hear(incarnation="l") is Verdict.CHANGED
    assert house.hear(incarnation="k") is Verdict.CHANGED


def test_a_contender_that_is_lost_leaves_the_id_to_the_holder_and_the_other_way_round(
    house: House,
) -> None:
    house.hear(source="a", hostname="h")
    house.hear(source="b", hostname="g")
    house.store.lost("e", source="a")
    assert (house.get().source, house.status()) == ("b", ACTIVE)


def test_no_more_claims_are_kept_than_tell_something(house: House) -> None:
    for number in range(10):
        house.hear(source=f"s{number}", hostname=f"h{number}")
        house.wait(1)
    claims = house.get().claims
    assert [one.source for one in claims] == ["s0", "s7", "s8", "s9"]
    assert len(claims) == MAX_CLAIMS


# -- room, in short --------------------------------------------------------------------------------


def test_a_new_id_is_refused_if_everybody_is_active() -> None:
    house = House(max_hints=2)
    house.hear("a")
    house.hear("b")
    assert house.hear("c") is Verdict.STORE_FULL
    assert house.hear("a", display_name="A") is Verdict.CHANGED
    assert house.store.stats().refused == 1


def test_the_stale_give_way_to_a_new_id() -> None:
    house = House(max_hints=2)
    house.hear("a")
    house.hear("b", age=TTL)
    assert house.hear("c") is Verdict.NEW
    assert [house.status(name) for name in "abc"] == [ACTIVE, None, ACTIVE]
    assert house.store.stats().displaced == 1


def test_a_known_id_that_cannot_grow_is_refreshed_all_the_same() -> None:
    house = House(max_bytes=hint_bytes(BeaconHint("e")) + 10)
    house.hear()
    house.wait(S)
    assert house.hear(display_name="x" * 11) is Verdict.STORE_FULL
    assert (house.get().last_seen_ns, house.get().hint.display_name) == (house.now, "")


def test_a_successor_that_does_not_fit_leaves_its_predecessor() -> None:
    house = House(max_bytes=hint_bytes(BeaconHint("e")) + 10)
    house.hear(incarnation="i")
    assert house.hear(incarnation="j", display_name="x" * 11) is Verdict.STORE_FULL
    assert house.get().incarnation == "i"


def test_words_that_were_counted_by_whoever_read_them_count_as_that_until_merged() -> None:
    house = House()
    every_word: dict[str, Any] = attrs.asdict(BENCH_HINT)
    house.hear(**{"name": every_word.pop("entity_id"), **every_word})
    message = Claimant(attrs.evolve(BENCH_HINT, display_name="other"), "r", "", 0, house.now, 50)
    with house.store.lock:
        house.store.take(message)
    assert house.store.stats().bytes == hint_bytes(BENCH_HINT, 50)
    part = Claimant(BeaconHint(BENCH_HINT.entity_id, display_name="A"), "r", "", 0, house.now, 3)
    with house.store.lock:
        house.store.take(part)
    assert house.store.stats().bytes == hint_bytes(attrs.evolve(BENCH_HINT, display_name="A"))


def test_a_rival_claim_counts_as_what_it_takes() -> None:
    claim = BeaconHint("e", hostname="g", display_name="B")
    both = hint_bytes(BeaconHint("e", hostname="h")) + hint_bytes(claim)
    house = House(max_bytes=both)
    house.hear(source="a", hostname="h")
    assert house.hear(source="b", hostname="g", display_name="BB") is Verdict.STORE_FULL
    assert not house.get().conflict
    assert house.hear(source="b", hostname="g", display_name="B") is Verdict.CONTENDED
    assert house.store.stats().bytes == both
    assert house.hear(source="b", hostname="g", display_name="C") is Verdict.CONTENDED
    assert house.hear(source="a", hostname="h", display_name="A") is Verdict.STORE_FULL


# -- what has changed ------------------------------------------------------------------------------


def ids(hints: tuple[StoredHint, ...]) -> list[str]:
    return [one.entity_id for one in hints]


def test_from_zero_everything_is_told(house: House) -> None:
    assert house.store.changes_since(0).complete
    house.hear("a")
    house.hear("b")
    house.store.goodbye("a")
    changes = house.store.changes_since(0)
    assert (changes.complete, changes.too_old) == (True, False)
    assert ids(changes.hints) == ["b", "a"]
    assert (changes.gone, changes.revision) == ((), house.store.revision)


def test_only_what_has_changed_is_told_the_oldest_change_first(house: House) -> None:
    for name in "abcd":
        house.hear(name)
    since = house.store.revision
    house.hear("a")  # A refresh is no change.
    house.hear("c", display_name="C")
    house.hear("b", display_name="B")
    changes = house.store.changes_since(since)
    assert not changes.complete
    assert ids(changes.hints) == ["c", "b"]
    assert house.store.changes_since(changes.revision).hints == ()


def test_what_time_has_changed_is_told(house: House) -> None:
    house.hear("a")
    house.wait(S)
    house.hear("b")
    since = house.store.revision
    house.wait(TTL - S)
    assert ids(house.store.changes_since(since).hints) == ["a"]


def test_whoever_ended_is_told_as_gone(house: House) -> None:
    for name in "abcd":
        house.hear(name)
    since = house.store.revision
    house.store.forget("b")
    house.store.forget("a")
    house.hear("b")
    changes = house.store.changes_since(since)
    assert (ids(changes.hints), changes.gone) == (["b"], ("a",))


def test_the_revision_rises_with_every_change_and_with_nothing_else(house: House) -> None:
    seen = [house.store.revision]

    def risen() -> bool:
        house.store.sweep()
        seen.append(house.store.revision)
        return seen[-1] > seen[-2]

    house.hear()
    assert risen()
    house.hear()
    assert not risen()
    house.hear(display_name="A")
    assert risen()
    house.hear(age=S)
    assert not risen()
    house.wait(TTL - 1)
    assert not risen()
    house.wait(1)
    assert risen()
    house.store.get("e")
    assert not risen()
    house.hear(source="s", incarnation="i")
    assert risen()
    house.store.lost("e")
    assert risen()
    house.store.goodbye("e")
    assert risen()
    house.hear(source="s", incarnation="i")
    assert not risen()
    house.store.forget()
    assert risen()


def test_the_number_of_contenders_is_a_change(house: House) -> None:
    for name in "abc":
        house.hear(source=name, hostname=name)
    since = house.store.revision
    house.store.goodbye("e", source="b")
    (stored,) = house.store.changes_since(since).hints
    assert [one.source for one in stored.claims] == ["a", "c"]
    since = house.store.revision
    house.wait(TTL - 1)
    house.hear(source="a")
    house.wait(1)
    (stored,) = house.store.changes_since(since).hints
    assert stored.claims == ()


def test_a_rival_that_says_the_same_again_is_no_change(house: House) -> None:
    house.hear(source="a", hostname="h")
    house.hear(source="b", hostname="g")
    since = house.store.revision
    house.wait(S)
    assert house.hear(source="b", hostname="g") is Verdict.CONTENDED
    assert house.store.revision == since
    assert house.get().claims[1].last_seen_ns == house.now
    house.hear(source="b", hostname="g", display_name="B")
    assert house.store.revision > since


@pytest.mark.parametrize("revision", [-1, 100])
def test_a_revision_that_never_was_gets_everything(house: House, revision: int) -> None:
    house.hear()
    changes = house.store.changes_since(revision)
    assert (changes.too_old, changes.complete, ids(changes.hints)) == (True, True, ["e"])


def test_a_reader_too_far_behind_gets_everything(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_core.register.MAX_REMOVED", 2)
    house = House()
    for name in "abcd":
        house.hear(name)
    since = house.store.revision
    house.store.forget("a")
    house.store.forget("b")
    assert house.store.changes_since(since).gone == ("a", "b")
    house.store.forget("c")
    changes = house.store.changes_since(since)
    assert (changes.too_old, changes.complete, changes.gone) == (True, True, ())
    assert ids(changes.hints) == ["d"]
    # Whoever has heard of the first end misses nothing.
    assert house.store.changes_since(since + 1).gone == ("b", "c")


def test_a_snapshot_is_in_the_order_of_the_last_change(house: House) -> None:
    for name in "abc":
        house.hear(name)
    house.hear("a", display_name="A")
    house.hear("b")
    assert [one.entity_id for one in house.store.snapshot()] == ["b", "c", "a"]


def test_a_snapshot_costs_nothing_for_whoever_was_not_even_refreshed(house: House) -> None:
    house.hear("a")
    house.hear("b")
    house.wait(1)
    before = house.store.snapshot()
    house.hear("b")
    after = house.store.snapshot()
    assert after[0] is before[0]
    assert after[1].last_seen_ns == house.now


# -- forgetting ------------------------------------------------------------------------------------


def test_one_is_forgotten(house: House) -> None:
    house.hear("a")
    house.hear("b")
    assert house.store.forget("a") == 1
    assert house.store.forget("a") == 0
    assert [house.status("a"), house.status("b")] == [None, ACTIVE]


def test_all_are_forgotten_whatever_their_status(house: House) -> None:
    house.hear("a", age=TTL)
    house.hear("b")
    house.store.goodbye("b")
    house.hear("c", source="r", hostname="h")
    house.hear("c", source="s", hostname="g")
    assert house.store.forget() == 3
    stats = house.store.stats()
    assert attrs.evolve(stats, revision=0) == attrs.evolve(House().store.stats())
    assert house.store.next_deadline_ns() is None
    assert house.hear("c") is Verdict.NEW


# -- the short way ---------------------------------------------------------------------------------


def take(house: House, **told: Any) -> tuple[Verdict, Record | None, int]:
    fields = {"source": "r", "incarnation": "i", "sequence": 0, "last_seen_ns": house.now, **told}
    with house.store.lock:
        message = Claimant(BeaconHint("e"), **fields)
    with house.store.lock:
        return house.store.take(message)


def refresh(
    house: House, record: Record | None, version: int, sequence: int = 0, age: int = 0
) -> bool:
    assert record is not None
    with house.store.lock:
        return house.store.refresh(record, version, sequence, house.now - age, house.now)


def test_what_was_said_last_can_be_refreshed_the_short_way(house: House) -> None:
    _, record, version = take(house)
    for _ in range(10):
        house.wait(TTL - 1)
        assert refresh(house, record, version)
    assert (house.status(), house.get().last_seen_ns) == (ACTIVE, house.now)
    assert house.store.revision == version
    house.wait(TTL)
    assert house.status() is STALE


def test_a_late_message_does_not_go_the_short_way(house: House) -> None:
    _, record, version = take(house, sequence=5)
    house.wait(S)
    assert not refresh(house, record, version, sequence=5)
    assert not refresh(house, record, version, sequence=6, age=S + 1)
    assert house.get().last_seen_ns == house.now - S
    assert refresh(house, record, version, sequence=6)
    assert not refresh(house, record, version, sequence=6)
    assert refresh(house, record, version)


@pytest.mark.parametrize(
    "happens",
    [
        lambda house: house.hear(incarnation="i", display_name="A"),
        lambda house: house.hear(incarnation="j"),
        lambda house: house.hear(source="s", incarnation="j", hostname="g"),
        lambda house: house.store.goodbye("e"),
        lambda house: house.store.lost("e"),
        lambda house: house.store.forget("e"),
        lambda house: house.wait(TTL),
        lambda house: house.wait(EXPIRY),
    ],
    ids=["words", "restart", "conflict", "goodbye", "loss", "forgotten", "stale", "expired"],
)
def test_once_something_is_not_as_it_was_there_is_no_short_way(house: House, happens: Any) -> None:
    house.hear(incarnation="i", hostname="h")
    _, record, version = take(house)
    happens(house)
    before = house.store.get("e")
    assert not refresh(house, record, version)
    assert house.store.get("e") == before


def test_the_short_way_settles_first(house: House) -> None:
    house.hear("other")
    _, record, version = take(house)
    house.wait(TTL)
    assert not refresh(house, record, version)
    assert house.status() is STALE
    _, record, version = take(house)
    house.wait(TTL - 1)
    assert refresh(house, record, version)
    assert [one.status for one in house.get().history] == [STALE, ACTIVE]


def test_there_is_no_short_way_beside_a_rival(house: House) -> None:
    house.hear(incarnation="j")
    verdict, record, _ = take(house)
    assert (verdict, record) == (Verdict.CHANGED, None)
    house.wait(TTL - 1)
    verdict, record, _ = take(house)
    assert (verdict, record) == (Verdict.REFRESHED, None)
    house.wait(1)
    assert take(house)[1] is not None


def test_there_is_no_short_way_for_whoever_is_stale_or_not_heard(house: House) -> None:
    assert take(house, last_seen_ns=house.now - TTL)[1:] == (None, 0)
    assert take(house, last_seen_ns=house.now - TTL - 1) == (Verdict.OLDER, None, 0)


def test_there_is_no_short_way_for_numbers_that_cannot_be_compared(house: House) -> None:
    take(house)
    assert take(house, incarnation="", sequence=100) == (Verdict.REFRESHED, None, 0)


# -- threads ---------------------------------------------------------------------------------------


def test_four_threads_at_once_lose_and_invent_nothing() -> None:
    house = House(max_hints=100)
    each, verdicts = 2_000, [Counter[Verdict]() for _ in range(4)]
    start = threading.Barrier(4)

    def hammer(number: int) -> None:
        start.wait(10)
        for turn in range(each):
            words: dict[str, Any] = {"display_name": str(turn), "hostname": f"h{number}"}
            verdicts[number][house.hear("shared", f"s{number}", **words)] += 1
            verdicts[number][house.hear(f"own-{number}-{turn % 20}", **words)] += 1
            if turn % 50 == number:
                house.store.forget("shared")
            house.store.snapshot()

    threads = [threading.Thread(target=hammer, args=[number]) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    total = sum(verdicts, Counter[Verdict]())
    assert total.total() == 4 * each * 2
    assert set(total) <= {Verdict.NEW, Verdict.CHANGED, Verdict.CONTENDED}
    check_sums(house)


def test_nothing_is_forgotten_in_any_count(house: House) -> None:
    steps: itertools.cycle[Callable[[], object]] = itertools.cycle(
        [
            lambda: house.hear("a", "r", "i", hostname="h"),
            lambda: house.hear("a", "s", "j", hostname="g", display_name="rival"),
            lambda: house.hear("b", "r", "k"),
            lambda: house.hear("b", "r", "l", display_name="successor"),
            lambda: house.hear("b", "r", "k", display_name="predecessor"),
            lambda: house.wait(3 * S),
            lambda: house.store.lost("a", source="r", incarnation="i"),
            lambda: house.hear("c", age=12 * S),
            lambda: house.store.goodbye("b", source="r", incarnation="l"),
            lambda: house.wait(8 * S),
            lambda: house.hear("a", "t", "m", hostname="f"),
            lambda: house.store.forget("c"),
            lambda: house.wait(S),
            lambda: house.wait(50 * S),
            lambda: house.hear("b", "r", "n"),
        ]
    )
    for step in itertools.islice(steps, 400):
        step()
        check_sums(house)


# -- restored from before --------------------------------------------------------------------------


def test_what_was_known_before_is_stale_until_it_is_heard() -> None:
    house = House(max_hints=1)
    known = BeaconHint("e", display_name="Known")
    assert house.store.restore(known, last_seen_ns=house.now - EXPIRY) is Verdict.OLDER
    assert house.store.restore(known, last_seen_ns=house.now, source="r") is Verdict.NEW
    assert house.store.restore(known, last_seen_ns=house.now, source="r") is Verdict.OLDER
    check_sums(house)
    assert house.status() is STALE
    house.hear()
    assert house.status() is ACTIVE
    assert house.store.restore(BeaconHint("f"), last_seen_ns=house.now) is Verdict.STORE_FULL
    check_sums(house)
