"""The log of ended ids: what a reader that stood at some revision is told, and when it is late."""

from __future__ import annotations

from beacon_core.removals import Removals


def log(*ids: str, limit: int = 100) -> Removals:
    """The first id ended at revision 1, the second at revision 2, and so on."""
    removals = Removals(limit)
    for revision, entity_id in enumerate(ids, start=1):
        removals.add(revision, entity_id)
    return removals


def test_nothing_has_ended_at_first() -> None:
    assert log().since(0, ()) == ()
    assert log().floor == 0


def test_what_ended_after_a_revision_is_told_in_the_order_of_the_ends() -> None:
    removals = log("c", "a", "b")
    assert removals.since(0, ()) == ("c", "a", "b")
    assert removals.since(1, ()) == ("a", "b")
    assert removals.since(2, ()) == ("b",)
    assert removals.since(3, ()) == ()


def test_whoever_came_back_is_not_gone() -> None:
    assert log("a", "b").since(0, {"a": 1}) == ("b",)


def test_whoever_ended_twice_is_told_once_at_the_last_end() -> None:
    assert log("a", "b", "a").since(0, ()) == ("b", "a")


def test_no_more_than_the_limit_is_kept() -> None:
    removals = log(*(f"e{number}" for number in range(1000)), limit=3)
    assert removals.since(0, ()) == ("e997", "e998", "e999")


def test_the_floor_is_the_earliest_revision_from_which_nothing_is_missed() -> None:
    removals = log("a", "b", limit=2)
    assert removals.floor == 0
    removals.add(3, "c")
    # A reader at 1 has seen the end of "a" and misses nothing; one at 0 would.
    assert removals.floor == 1
    assert removals.since(1, ()) == ("b", "c")
