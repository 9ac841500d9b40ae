"""Several processes under one id: successors, rivals, heirs, and those who have gone."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.limits import MAX_CLAIMS
from beacon_core.outcome import Verdict
from tests.unit.core.house import EXPIRY, TTL, House, S, check_sums

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT
HERE: dict[str, Any] = {"source": "a", "incarnation": "i", "hostname": "h"}
"""The first to speak."""
NEXT: dict[str, Any] = {"source": "a", "incarnation": "j", "hostname": "h"}
"""Another process in the same place."""
AWAY: dict[str, Any] = {"source": "b", "incarnation": "k", "hostname": "g"}
"""Another process in another place."""


@pytest.fixture
def house() -> House:
    return House()


def sources(house: House) -> list[str]:
    """Who claims the id, by incarnation, the holder first; one alone if there is no conflict."""
    stored = house.get()
    return [one.incarnation for one in stored.claims] or [stored.incarnation]


# -- restarts ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second", "detail"),
    [
        ({"incarnation": "i"}, {"incarnation": "j"}, "another incarnation"),
        ({"process_id": 1}, {"process_id": 2}, "another process id"),
        ({"source": "a"}, {"source": "b"}, "another source"),
    ],
)
def test_whatever_shows_another_process_shows_a_restart(
    house: House, first: dict[str, Any], second: dict[str, Any], detail: str
) -> None:
    house.hear(**first, display_name="A")
    house.wait(S)
    assert house.hear(**second, component_id="c") is Verdict.CHANGED
    stored = house.get()
    assert (stored.restarts, stored.conflict, stored.status) == (1, False, ACTIVE)
    assert (stored.hint.display_name, stored.hint.component_id) == ("", "c")
    assert stored.first_seen_ns == house.now
    assert stored.history == (Transition(house.now, ACTIVE, Cause.HEARD, detail),)


def test_a_predecessor_that_stays_silent_was_one(house: House) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    revision = house.store.revision
    for _ in range(20):
        house.wait(TTL // 2)
        assert house.hear(**NEXT) is Verdict.REFRESHED
    assert house.store.revision == revision
    assert house.get().restarts == 1


@pytest.mark.parametrize(("silence", "verdict"), [(TTL - 1, "contended"), (TTL, "changed")])
def test_a_predecessor_is_remembered_for_one_ttl(house: House, silence: int, verdict: str) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    house.wait(silence)
    house.hear(**NEXT)
    assert house.hear(**HERE) == verdict


def test_a_successor_on_another_host_waits_until_the_holder_is_stale(house: House) -> None:
    house.hear(**HERE)
    house.wait(TTL)
    assert house.hear(**AWAY) is Verdict.CHANGED
    assert (house.get().incarnation, house.get().restarts) == ("k", 1)
    # Nobody is remembered who was silent for a ttl already.
    assert house.hear(**HERE) is Verdict.CONTENDED
    assert sources(house) == ["k", "i"]


def test_a_successor_needs_no_waiting_after_a_loss(house: House) -> None:
    house.hear(**HERE)
    house.store.lost("e", source="a", incarnation="i")
    assert house.hear(**AWAY) is Verdict.CHANGED
    assert (house.status(), sources(house)) == (ACTIVE, ["k"])


def test_a_late_successor_of_a_stale_one_is_stale(house: House) -> None:
    house.hear(**HERE)
    house.wait(100 * S)
    assert house.hear(**NEXT, age=TTL) is Verdict.CHANGED
    stored = house.get()
    assert (stored.status, stored.cause, stored.incarnation) == (STALE, Cause.HEARD_LATE, "j")
    house.wait(EXPIRY - TTL)
    assert house.status() is None


def test_what_a_predecessor_said_before_its_successor_does_not_take_the_id_back(
    house: House,
) -> None:
    house.hear(**HERE, sequence=5)
    house.wait(S)
    house.hear(**NEXT, sequence=1)
    assert house.hear(**HERE, sequence=5) is Verdict.OLDER
    assert house.hear(**HERE, age=S + 1) is Verdict.OLDER
    assert sources(house) == ["j"]


def test_restarts_are_counted_for_each_id_and_for_all(house: House) -> None:
    for number in range(5):
        house.hear("a", incarnation=str(number))
        house.hear("b", incarnation=str(number // 2))
    assert (house.get("a").restarts, house.get("b").restarts) == (4, 2)
    assert house.store.stats().restarts == 6


# -- predecessors, when the holder has gone --------------------------------------------------------


def go(house: House, how: str, who: dict[str, Any]) -> Status:
    """The holder falls silent, is lost or says goodbye."""
    if how == "silent":
        house.wait(TTL)
        return STALE
    depart = house.store.lost if how == "lost" else house.store.goodbye
    assert depart("e", source=who["source"], incarnation=who["incarnation"]) == (
        Verdict.LOST if how == "lost" else Verdict.LEFT
    )
    return STALE if how == "lost" else LEFT


GONE = pytest.mark.parametrize("how", ["silent", "lost", "goodbye"])


@GONE
@pytest.mark.parametrize("sequence", [1, 4, 5])
def test_an_old_number_of_a_predecessor_brings_it_back_from_no_death_of_its_successor(
    house: House, how: str, sequence: int
) -> None:
    house.hear(**HERE, sequence=5)
    house.wait(S)
    house.hear(**NEXT, sequence=1)
    status = go(house, how, NEXT)
    for _ in range(3):
        assert house.hear(**HERE, sequence=sequence) is Verdict.OLDER
        assert (house.status(), house.get().incarnation) == (status, "j")
        house.wait(TTL // 4)


@pytest.mark.parametrize("second", [NEXT, AWAY], ids=["same place", "another host"])
@pytest.mark.parametrize("how", ["lost", "goodbye"])
def test_a_predecessor_without_numbers_has_to_wait_for_its_ttl(
    house: House, how: str, second: dict[str, Any]
) -> None:
    house.hear(**HERE, age=S)
    if second is AWAY:
        house.store.lost("e", source="a", incarnation="i")
        house.wait(0)
    last_sign_of_life = house.now - (S if second is NEXT else 0)
    house.hear(**second)
    status = go(house, how, second)
    house.wait(last_sign_of_life + TTL - 1 - house.now)
    assert house.hear(**HERE) is Verdict.OLDER
    assert (house.status(), house.get().incarnation) == (status, second["incarnation"])
    house.wait(1)
    assert house.hear(**HERE) in {Verdict.CHANGED, Verdict.NEW}
    assert (house.status(), house.get().incarnation) == (ACTIVE, "i")


@pytest.mark.parametrize("how", ["lost", "goodbye"])
def test_a_predecessor_that_proves_to_live_takes_its_id_back_at_once(
    house: House, how: str
) -> None:
    house.hear(**HERE, sequence=5)
    house.wait(S)
    house.hear(**NEXT, sequence=1)
    house.wait(S)
    go(house, how, NEXT)
    # Said before the successor's last words, whatever arrived when.
    assert house.hear(**HERE, sequence=6, age=S + 1) is Verdict.OLDER
    assert house.hear(**HERE, sequence=6, age=S) is Verdict.CHANGED
    assert (house.status(), house.get().incarnation) == (ACTIVE, "i")
    # And it is the other one now whose late words mean nothing.
    assert house.hear(**NEXT, sequence=1) in {Verdict.OLDER, Verdict.BURIED}


def test_who_was_lost_or_left_is_remembered_beside_its_heir(house: House) -> None:
    house.hear(**HERE, sequence=5)
    house.wait(S)
    house.store.lost("e", source="a", incarnation="i")
    house.wait(S)
    house.hear(**NEXT, sequence=1)
    assert house.hear(**HERE, sequence=5) is Verdict.OLDER
    # Sent before it was lost.
    assert house.hear(**HERE, age=S + 1) is Verdict.OLDER
    house.store.goodbye("e", source="a", incarnation="j", sequence=2)
    house.hear(source="a", incarnation="k", hostname="h")
    assert house.hear(**NEXT, sequence=2) is Verdict.BURIED
    assert sources(house) == ["k"]


def test_a_tombstone_outlives_the_silence_of_whoever_held_the_id_then(house: House) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    house.wait(TTL - 1)
    house.store.goodbye("e", source="a", incarnation="i")
    house.wait(1)
    assert house.status() is STALE
    assert house.hear(**HERE) is Verdict.BURIED
    house.wait(TTL - 2)
    assert house.hear(**HERE) is Verdict.BURIED
    house.wait(1)
    assert house.hear(**HERE) is Verdict.CHANGED


@pytest.mark.parametrize("who", ["holder", "rival"])
def test_what_was_sent_before_a_loss_does_not_undo_it_beside_another_claim(
    house: House, who: str
) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    going, staying = (HERE, AWAY) if who == "holder" else (AWAY, HERE)
    house.wait(S)
    house.store.lost("e", source=going["source"], incarnation=going["incarnation"])
    assert house.hear(**going, age=1) is Verdict.OLDER
    assert sources(house) == [staying["incarnation"]]
    assert house.hear(**going) is Verdict.CONTENDED


def test_a_number_of_a_former_run_is_old_however_late_it_comes(house: House) -> None:
    house.hear(**HERE, sequence=5)
    for _ in range(10):
        house.hear(**NEXT)
        house.wait(TTL - 1)
    assert house.hear(**HERE, sequence=5) is Verdict.OLDER
    assert sources(house) == ["j"]
    assert house.hear(**HERE, sequence=6) is Verdict.CHANGED
    assert sources(house) == ["i"]


def test_a_contender_that_fell_silent_does_not_claim_again_by_what_it_said(house: House) -> None:
    house.hear(**HERE)
    house.hear(**AWAY, sequence=7)
    house.wait(TTL - 1)
    house.hear(**HERE)
    house.wait(1)
    assert not house.get().conflict
    assert house.hear(**AWAY, sequence=7) is Verdict.OLDER
    assert house.hear(**AWAY, sequence=8) is Verdict.CONTENDED


# -- conflicts -----------------------------------------------------------------------------------


def test_another_host_is_a_rival_at_once_and_nothing_is_mixed(house: House) -> None:
    house.hear(**HERE, display_name="A", metadata={"k": "1"})
    assert house.hear(**AWAY, display_name="B") is Verdict.CONTENDED
    house.wait(S)
    assert house.hear(**HERE, component_id="c") is Verdict.CHANGED
    stored = house.get()
    mine, theirs = stored.claims
    assert (stored.incarnation, stored.restarts, stored.status) == ("i", 0, ACTIVE)
    assert mine.hint == stored.hint
    assert mine.hint.metadata == {"k": "1"}
    assert theirs.hint == BeaconHint("e", hostname="g", display_name="B")
    assert (mine.last_seen_ns, theirs.last_seen_ns) == (house.now, house.now - S)


def test_a_conflict_lasts_while_both_are_heard(house: House) -> None:
    for _ in range(20):
        house.hear(**HERE)
        house.wait(TTL // 3)
        house.hear(**AWAY)
        house.wait(TTL // 3)
    assert sources(house) == ["i", "k"]
    assert house.store.stats().conflicts == 1
    assert house.get().history == ()


def test_two_processes_in_one_place_that_both_go_on_are_in_conflict(house: House) -> None:
    for _ in range(5):
        house.hear(**HERE)
        house.hear(**NEXT)
        house.wait(S)
    assert house.get().restarts == 1
    assert sorted(sources(house)) == ["i", "j"]


@pytest.mark.parametrize("end", ["silent", "lost", "goodbye"])
@pytest.mark.parametrize("who", ["holder", "rival"])
def test_a_conflict_ends_with_one_of_the_two(house: House, who: str, end: str) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    going, staying = (HERE, AWAY) if who == "holder" else (AWAY, HERE)
    if end == "silent":
        house.wait(TTL - 1)
        house.hear(**staying)
        house.wait(1)
    else:
        depart = house.store.lost if end == "lost" else house.store.goodbye
        depart("e", source=going["source"], incarnation=going["incarnation"])
    stored = house.get()
    assert (stored.conflict, stored.status) == (False, ACTIVE)
    assert stored.incarnation == staying["incarnation"]
    assert stored.restarts == (who == "holder")
    assert house.store.stats().conflicts == 0
    house.wait(TTL)
    assert house.status() is STALE


def test_an_heir_brings_its_own_words_and_time(house: House) -> None:
    house.hear(**HERE, display_name="A")
    house.wait(S)
    house.hear(**AWAY, display_name="B", sequence=5)
    house.wait(S)
    house.store.goodbye("e", source="a", incarnation="i")
    stored = house.get()
    assert stored.hint == BeaconHint("e", hostname="g", display_name="B")
    assert stored.last_seen_ns == stored.first_seen_ns == house.now - S
    assert house.hear(**AWAY, sequence=5) is Verdict.OLDER


def test_the_freshest_of_several_inherits_and_the_others_go_on_contending(house: House) -> None:
    house.hear(source="a", hostname="a", age=4)
    house.hear(source="b", hostname="b", age=1)
    house.hear(source="c", hostname="c", age=3)
    house.store.lost("e", source="a")
    stored = house.get()
    assert (stored.source, [one.source for one in stored.claims]) == ("b", ["b", "c"])
    check_sums(house)


def test_holders_fall_silent_one_after_the_other(house: House) -> None:
    begun = house.now
    for name in "abc":
        house.hear(source=name, hostname=name)
        house.wait(S)
    house.wait(100 * S)
    # "a" went silent at 10 s, and "c" was fresher than "b".
    assert house.steps() == [
        (begun + TTL, ACTIVE, Cause.HEARD),
        (begun + 2 * S + TTL, STALE, Cause.SILENT),
    ]
    assert house.get().source == "c"


def test_a_claim_of_the_past_makes_no_conflict(house: House) -> None:
    house.hear(**HERE)
    house.wait(S)
    assert house.hear(**AWAY, age=S + 1) is Verdict.OLDER
    assert not house.get().conflict


def test_more_claims_than_are_kept_displace_the_longest_silent(house: House) -> None:
    for number in range(MAX_CLAIMS + 2):
        house.hear(source=f"s{number}", hostname=f"h{number}")
        house.wait(1)
    kept = [one.source for one in house.get().claims]
    assert kept == ["s0", f"s{MAX_CLAIMS - 1}", f"s{MAX_CLAIMS}", f"s{MAX_CLAIMS + 1}"]
    check_sums(house)


def test_the_longest_silent_gives_way_whenever_it_began(house: House) -> None:
    house.hear(source="a", hostname="a", age=9)
    house.hear(source="b", hostname="b")
    house.hear(source="c", hostname="c", age=5)
    house.hear(source="d", hostname="d", age=3)
    house.hear(source="e", hostname="e", age=4)
    assert sorted(one.source for one in house.get().claims) == ["a", "b", "d", "e"]


def test_a_successor_among_many_rivals_leaves_room_for_its_predecessor(house: House) -> None:
    house.hear(**HERE)
    for number in range(MAX_CLAIMS - 1):
        house.hear(source=f"s{number}", hostname=f"g{number}", display_name="x" * number)
        house.wait(1)
    house.hear(**NEXT)
    stored = house.get()
    assert [one.source for one in stored.claims] == ["a", "s1", "s2"]
    check_sums(house)
    assert house.hear(**HERE) is Verdict.CONTENDED
    assert len(house.get().claims) == MAX_CLAIMS
    check_sums(house)


def test_a_successor_among_rivals_leaves_them_their_claims(house: House) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    assert house.hear(**NEXT) is Verdict.CHANGED
    assert sources(house) == ["j", "k"]
    house.hear(**HERE)
    assert sources(house) == ["j", "k", "i"]


def test_a_rival_s_numbers_are_its_own(house: House) -> None:
    house.hear(**HERE, sequence=9)
    assert house.hear(**AWAY, sequence=3) is Verdict.CONTENDED
    assert house.hear(**AWAY, sequence=3) is Verdict.OLDER
    assert house.hear(**AWAY) is Verdict.CONTENDED
    assert house.hear(**AWAY, sequence=3) is Verdict.OLDER
    assert house.hear(**AWAY, sequence=4) is Verdict.CONTENDED
    assert house.hear(**HERE, sequence=10) is Verdict.REFRESHED


def test_a_conflict_is_forgotten_with_its_id(house: House) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    house.store.forget("e")
    assert house.store.stats().conflicts == 0
    house.hear(**AWAY)
    assert sources(house) == ["k"]


def test_after_a_goodbye_of_the_only_one_there_is_no_conflict_to_inherit(house: House) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    house.store.goodbye("e", source="a", incarnation="j")
    # The predecessor has been silent; it does not hold the id again.
    assert house.status() is LEFT
    check_sums(house)


# -- those who have gone -------------------------------------------------------------------------


def test_a_predecessor_s_goodbye_changes_nothing_for_its_successor(house: House) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    before = house.get()
    assert house.store.goodbye("e", source="a", incarnation="i") is Verdict.LEFT
    assert house.get() == before


@pytest.mark.parametrize("second", [NEXT, AWAY], ids=["same place", "another host"])
def test_what_was_under_way_at_a_goodbye_takes_the_id_from_nobody(
    house: House, second: dict[str, Any]
) -> None:
    house.hear(**HERE, sequence=5)
    house.hear(**second)
    house.hear(**HERE, sequence=6)
    assert house.get().conflict
    house.store.goodbye("e", source="a", incarnation="i", sequence=8)
    for sequence in (0, 7, 8):
        house.wait(1)
        assert house.hear(**HERE, sequence=sequence) is Verdict.BURIED
    assert sources(house) == [second["incarnation"]]
    assert house.store.stats().buried == 3


def test_whoever_comes_back_after_its_goodbye_is_a_rival_of_the_heir(house: House) -> None:
    house.hear(**HERE, sequence=5)
    house.hear(**AWAY)
    house.store.goodbye("e", source="a", incarnation="i", sequence=6)
    assert house.hear(**HERE, sequence=7) is Verdict.CONTENDED
    assert sources(house) == ["k", "i"]


def test_a_tombstone_beside_a_holder_stands_for_one_ttl(house: House) -> None:
    house.hear(**HERE)
    house.hear(**NEXT)
    house.store.goodbye("e", source="a", incarnation="i")
    house.wait(TTL - 1)
    house.hear(**NEXT)
    assert house.hear(**HERE) is Verdict.BURIED
    house.wait(1)
    assert house.hear(**HERE) is Verdict.CHANGED


def test_a_rival_departs_once(house: House) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    assert house.store.goodbye("e", source="b", incarnation="k") is Verdict.LEFT
    assert house.store.goodbye("e", source="b", incarnation="k") is Verdict.OLDER
    assert house.store.lost("e", source="b", incarnation="k") is Verdict.OLDER


def test_a_rival_that_was_lost_may_come_back_at_once(house: House) -> None:
    house.hear(**HERE)
    house.hear(**AWAY)
    assert house.store.lost("e", source="b", incarnation="k") is Verdict.LOST
    assert house.hear(**AWAY) is Verdict.CONTENDED


def test_a_repeated_goodbye_from_before_a_rival_s_last_words_changes_nothing(
    house: House,
) -> None:
    house.hear(**HERE)
    house.hear(**AWAY, sequence=5)
    assert house.store.goodbye("e", source="b", incarnation="k", sequence=4) is Verdict.OLDER
    assert house.get().conflict
