"""A full store, by count or by bytes: who gives way to whom, and when nobody does."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.limits import hint_bytes
from beacon_core.outcome import Verdict
from tests.unit.core.house import EXPIRY, TTL, House, S, check_sums

ACTIVE, STALE, LEFT = Status.ACTIVE, Status.STALE, Status.LEFT
BASE = hint_bytes(BeaconHint("e"))
"""What a hint is accounted for that says nothing but an id of one letter."""


def present(house: House) -> str:
    return "".join(sorted(one.entity_id for one in house.store.changes_since(0).hints))


# -- by count ------------------------------------------------------------------------------------


def test_the_expired_hold_no_room() -> None:
    house = House(max_hints=2)
    house.hear("a")
    house.hear("b")
    house.wait(EXPIRY)
    assert [house.hear("c"), house.hear("d")] == [Verdict.NEW, Verdict.NEW]
    assert house.store.stats().displaced == 0


def test_the_order_of_giving_way() -> None:
    house = House(max_hints=6)
    house.hear("f")
    house.wait(S)
    house.hear("f")
    house.hear("e", age=S)
    house.hear("e", age=S // 2)
    house.wait(S)
    house.hear("d")
    house.hear("c", age=S)
    house.wait(TTL - 1)
    house.hear("b")
    house.store.goodbye("b")
    house.hear("a")
    house.wait(1)
    # "b" has left; "c" and "d" were heard once; "e" and "f" more often; "a" is active.
    gone = []
    for number, name in enumerate("uvwxyz"):
        before = set(present(house))
        verdict = house.hear(name)
        gone += sorted(before - set(present(house)))
        assert verdict is (Verdict.NEW if number < 5 else Verdict.STORE_FULL)
    assert gone == ["b", "c", "d", "e", "f"]
    check_sums(house)


def test_a_known_id_is_always_refreshed() -> None:
    house = House(max_hints=2)
    house.hear("a")
    house.hear("b", age=TTL)
    assert house.hear("a", display_name="A") is Verdict.CHANGED
    assert house.hear("b") is Verdict.REFRESHED
    assert house.hear("c") is Verdict.STORE_FULL
    assert house.hear("a", source="another") is Verdict.CHANGED


def test_a_flood_of_invented_ids_displaces_itself() -> None:
    house = House(max_hints=20)
    for name in "abcdefghij":
        house.hear(name)
        house.wait(1)
        house.hear(name)
    house.wait(TTL)
    for number in range(1000):
        house.hear(f"junk{number}", age=TTL)
    assert {one for one in present(house) if len(one) == 1} >= set("abcdefghij")
    assert house.store.stats().displaced == 990
    assert house.store.size() == 20


def test_a_flood_of_invented_ids_cannot_displace_the_active() -> None:
    house = House(max_hints=20)
    for name in "abcdefghij":
        house.hear(name)
    verdicts = [house.hear(f"junk{number}") for number in range(1000)]
    assert verdicts.count(Verdict.STORE_FULL) == house.store.stats().refused == 990
    assert all(house.status(name) is ACTIVE for name in "abcdefghij")


def test_a_hint_that_is_stale_at_its_first_hearing_gives_way_too() -> None:
    house = House(max_hints=1)
    house.hear("a", age=TTL)
    assert house.hear("b") is Verdict.NEW
    assert present(house) == "b"


def test_whoever_gave_way_begins_anew() -> None:
    house = House(max_hints=1)
    house.hear("a", display_name="A", age=TTL)
    since = house.store.revision
    house.hear("b", age=TTL)
    assert house.store.changes_since(since).gone == ("a",)
    assert house.hear("a") is Verdict.NEW
    assert house.get("a").hint == BeaconHint("a")


# -- by bytes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "size"),
    [("x" * 12, 12), ("é" * 12, 12), ("ż" * 6, 12), ("🤖" * 3, 12), ("\udc80" * 6, 12)],
)
def test_text_counts_as_the_bytes_it_takes(text: str, size: int) -> None:
    house = House(max_bytes=BASE + size)
    assert house.hear("e", display_name=text) is Verdict.NEW
    assert house.store.stats().bytes == BASE + size
    house = House(max_bytes=BASE + size - 1)
    assert house.hear("e", display_name=text) is Verdict.STORE_FULL


def test_as_many_of_the_stale_give_way_as_a_large_hint_needs() -> None:
    house = House(max_bytes=4 * BASE)
    house.hear("z")
    for number, name in enumerate("abc"):
        house.hear(name, age=TTL + 3 - number)
    assert house.hear("l", display_name="x" * BASE) is Verdict.NEW
    assert present(house) == "clz"
    assert house.store.stats().bytes == 4 * BASE


def test_nobody_gives_way_unless_that_is_enough() -> None:
    house = House(max_bytes=4 * BASE)
    house.hear("y")
    house.hear("z")
    house.hear("a", age=TTL)
    revision = house.store.revision
    assert house.hear("l", display_name="x" * (BASE + 1)) is Verdict.STORE_FULL
    assert (present(house), house.store.revision) == ("ayz", revision)
    assert house.store.stats().refused == 1


def test_the_stale_give_way_to_a_known_hint_that_grows() -> None:
    house = House(max_bytes=3 * BASE)
    house.hear("a")
    house.hear("b", age=TTL + 1)
    house.hear("c", age=TTL)
    assert house.hear("a", display_name="x" * BASE) is Verdict.CHANGED
    assert present(house) == "ac"


def test_a_known_hint_that_cannot_grow_keeps_its_words_and_is_refreshed() -> None:
    house = House(max_bytes=2 * BASE)
    house.hear("a")
    house.hear("b")
    house.wait(TTL - 1)
    assert house.hear("a", display_name="x") is Verdict.STORE_FULL
    house.wait(1)
    assert (house.status("a"), house.status("b")) == (ACTIVE, STALE)
    assert house.get("a").hint == BeaconHint("a")
    check_sums(house)


def test_a_stale_hint_that_grows_does_not_give_way_to_itself() -> None:
    house = House(max_bytes=3 * BASE)
    house.hear("a", age=TTL + 20)
    house.hear("b", age=TTL + 10)
    house.hear("c", age=TTL + 5)
    # Late words: it stays STALE, is the longest silent but for a moment, and grows.
    assert house.hear("a", age=TTL + 19, display_name="x" * BASE) is Verdict.CHANGED
    assert present(house) == "ac"
    assert house.status("a") is STALE
    # And it may give way the next time.
    assert house.hear("d", display_name="x" * (2 * BASE)) is Verdict.NEW
    assert present(house) == "d"
    check_sums(house)


def test_a_tombstone_that_comes_back_larger_does_not_give_way_to_itself() -> None:
    house = House(max_bytes=2 * BASE + 10)
    house.hear("a", incarnation="i")
    house.store.goodbye("a")
    house.hear("b", age=TTL)
    assert house.hear("a", incarnation="j", display_name="x" * 20) is Verdict.CHANGED
    assert present(house) == "a"
    check_sums(house)


def test_a_hint_that_shrinks_always_may() -> None:
    house = House(max_bytes=2 * BASE + 100)
    house.hear("a", display_name="x" * 100)
    house.hear("b")
    assert house.hear("a", display_name="y") is Verdict.CHANGED
    assert house.store.stats().bytes == 2 * BASE + 1
    assert house.hear("b", display_name="x" * 99) is Verdict.CHANGED


def test_a_hint_larger_than_the_store_is_refused() -> None:
    house = House(max_bytes=1)
    assert house.hear() is Verdict.STORE_FULL
    assert house.store.stats().bytes == 0


# -- rivals --------------------------------------------------------------------------------------


def test_rival_claims_cannot_fill_the_memory() -> None:
    house = House(max_bytes=20 * BASE)
    for number in range(50):
        for name in "abcde":
            house.hear(name, f"s{number}", hostname=f"h{number}", display_name="x" * BASE)
            house.wait(1)
            check_sums(house)
            assert house.store.stats().bytes <= 20 * BASE


def test_the_stale_give_way_to_a_rival_claim() -> None:
    house = House(max_bytes=3 * BASE + 2)
    house.hear("a", source="a", hostname="h")
    house.hear("b", age=TTL + 1)
    house.hear("c", age=TTL)
    assert house.hear("a", source="b", hostname="g") is Verdict.CONTENDED
    assert present(house) == "ac"


def test_a_conflict_that_ends_frees_its_room() -> None:
    house = House(max_bytes=2 * BASE + 2)
    house.hear("a", source="a", hostname="h")
    house.hear("a", source="b", hostname="g")
    assert house.hear("c") is Verdict.STORE_FULL
    house.store.goodbye("a", source="b")
    assert house.hear("c") is Verdict.NEW


def test_a_successor_needs_room_beside_the_rivals() -> None:
    house = House(max_bytes=2 * BASE + 12)
    house.hear(source="a", incarnation="i", hostname="h")
    house.hear(source="b", hostname="g")
    words: dict[str, Any] = {"source": "a", "incarnation": "j", "hostname": "h"}
    assert house.hear("e", **words, display_name="x" * 11) is Verdict.STORE_FULL
    assert house.hear("e", **words, display_name="x" * 10) is Verdict.CHANGED
    assert house.store.stats().bytes == 2 * BASE + 12
    check_sums(house)


def test_a_restart_needs_no_room_for_the_predecessor() -> None:
    house = House(max_bytes=BASE)
    for incarnation in "ijklm":
        house.hear(incarnation=incarnation)
    assert house.get().restarts == 4
    assert house.store.stats().bytes == BASE
