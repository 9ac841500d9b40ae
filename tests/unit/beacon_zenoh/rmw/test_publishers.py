"""Which token is whose: by number, by elimination, or nobody's."""

from __future__ import annotations

import attrs
import pytest

from beacon_zenoh.rmw import publishers as module
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.publishers import SETTLE_NS, Heard, Publishers
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key

TOPIC = Member(Kind.PUBLISHER, 0, "ab", 0, 1, "one", "/fleet", "/", "/hints", "a/msg/B", "RIHS01_0")
KEY = data_key(TOPIC.data_key)
OTHER_KEY = KEY.replace("RIHS01_0", "RIHS01_1")
LATER = 10 * SETTLE_NS


def token(number: int) -> tuple[bytes, Member]:
    member = attrs.evolve(TOPIC, member_id=number)
    return gid_of(token_key(member)), member


ONE, TWO = token(1), token(2)
STRANGER, ANOTHER = bytes(16), b"\1" * 16


def speaking(known: Publishers, gid: bytes, key: str = KEY, zid: str = "") -> Heard:
    publisher = known.meet(gid, key, zid, 0)
    known.spoke(publisher, f"of-{gid.hex()[:2]}", 1)
    return publisher


def test_by_number_it_makes_no_difference_which_comes_first() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    early = speaking(known, TWO[0])
    late = speaking(known, ONE[0])
    known.listed(*TWO, 0)
    assert (early.token, late.token) == (TWO[0], ONE[0])
    assert known.unlisted(ONE[0]) == [late]
    assert known.unlisted(TWO[0]) == [early]
    assert known.unlisted(TWO[0]) == []
    assert known.next_due_ns() is None


def test_the_one_token_that_is_left_over_is_the_stranger_s() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    known.listed(*TWO, 0)
    speaking(known, TWO[0])
    stranger = speaking(known, STRANGER)
    assert known.next_due_ns() == SETTLE_NS
    known.settle(SETTLE_NS - 1)
    assert stranger.token is None
    known.settle(SETTLE_NS)
    assert stranger.token == ONE[0]
    assert known.member(ONE[0]) == ONE[1]
    assert known.unlisted(ONE[0]) == [stranger]


def test_a_token_that_comes_after_the_messages_is_found_too() -> None:
    known = Publishers()
    stranger = speaking(known, STRANGER)
    known.settle(LATER)
    known.listed(*ONE, LATER)
    known.settle(2 * LATER)
    assert stranger.token == ONE[0]


def test_another_topic_s_token_is_nobody_s_here() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    stranger = speaking(known, STRANGER, OTHER_KEY)
    known.settle(LATER)
    assert stranger.token is None
    assert known.unlisted(ONE[0]) == []


def test_of_several_that_are_left_over_none_is_given_away() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    known.listed(*TWO, 0)
    both = [speaking(known, STRANGER), speaking(known, ANOTHER)]
    known.settle(LATER)
    assert [one.token for one in both] == [None, None]
    assert known.unlisted(ONE[0]) == []
    assert known.unlisted(TWO[0]) == both


def test_of_several_the_one_whose_session_stamped_the_messages_is_the_stranger_s() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    elsewhere = attrs.evolve(TOPIC, zid="cd")
    known.listed(gid_of(token_key(elsewhere)), elsewhere, 0)
    here, there = speaking(known, STRANGER, zid="ab"), speaking(known, ANOTHER, zid="cd")
    known.settle(LATER)
    assert known.unlisted(ONE[0]) == [here]
    assert known.unlisted(gid_of(token_key(elsewhere))) == [there]


def test_of_several_of_one_session_all_are_lost_when_the_last_has_gone() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    known.listed(*TWO, 0)
    elsewhere = attrs.evolve(TOPIC, zid="cd")
    known.listed(gid_of(token_key(elsewhere)), elsewhere, 0)
    here = [speaking(known, STRANGER, zid="ab"), speaking(known, ANOTHER, zid="ab")]
    known.settle(LATER)
    assert known.unlisted(ONE[0]) == []
    assert known.unlisted(TWO[0]) == here


def test_who_is_without_a_token_is_not_lost_with_one_that_came_and_went_for_another() -> None:
    known = Publishers()
    stranger = speaking(known, STRANGER)
    known.settle(LATER)
    known.listed(*ONE, LATER)
    speaking(known, ONE[0])
    known.settle(2 * LATER)
    assert stranger.token is None
    assert known.unlisted(ONE[0]) != [stranger]


def test_a_stamp_of_the_router_tells_nothing() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    stranger = speaking(known, STRANGER, zid="ef")
    known.settle(LATER)
    assert stranger.token == ONE[0]


def test_who_came_one_by_one_is_told_apart() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    first = speaking(known, STRANGER)
    known.settle(LATER)
    known.listed(*TWO, 0)
    second = speaking(known, ANOTHER)
    known.settle(LATER)
    assert known.unlisted(TWO[0]) == [second]
    assert known.unlisted(ONE[0]) == [first]


def test_a_tie_by_number_outdoes_one_by_elimination() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    stranger = speaking(known, STRANGER)
    known.settle(LATER)
    owner = speaking(known, ONE[0])
    assert (stranger.token, owner.token) == (None, ONE[0])
    assert known.unlisted(ONE[0]) == [owner]


def test_who_had_a_token_by_elimination_gives_it_back_for_its_own() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    publisher = speaking(known, TWO[0])
    known.settle(LATER)
    assert publisher.token == ONE[0]
    known.listed(*TWO, LATER)
    assert publisher.token == TWO[0]
    stranger = speaking(known, STRANGER)
    known.settle(LATER)
    assert stranger.token == ONE[0]


def test_a_token_that_comes_back_is_its_owner_s_again() -> None:
    known = Publishers()
    known.listed(*ONE, 0)
    stranger = speaking(known, STRANGER)
    known.settle(LATER)
    known.unlisted(ONE[0])
    known.listed(*ONE, LATER)
    known.settle(2 * LATER)
    assert stranger.token == ONE[0]


def test_who_must_be_admitted_is_not_without_a_token() -> None:
    known = Publishers(admits=lambda member: member.member_id == 1)
    publisher, stranger = speaking(known, ONE[0]), speaking(known, TWO[0])
    assert not publisher.allowed
    known.listed(*ONE, 0)
    known.listed(*TWO, 0)
    assert publisher.allowed
    assert not stranger.allowed


def test_the_last_word_of_each_is_known_by_its_number() -> None:
    known = Publishers()
    publisher = known.meet(STRANGER, KEY, "", 0)
    known.spoke(publisher, "engine", 1)
    known.spoke(publisher, "brake", 2)
    known.spoke(publisher, "engine", 3)
    assert publisher.entities == {"engine": 3, "brake": 2}
    assert publisher.numbers == {3: "engine", 2: "brake"}
    publisher.missed.update(("engine", "brake"))
    known.spoke(publisher, "engine", 4)
    known.left(publisher, "brake")
    known.left(publisher, "nobody")
    assert publisher.entities == {"engine": 4}
    assert publisher.numbers == {4: "engine"}
    assert not publisher.missed


def test_a_flood_of_publishers_is_heard_but_only_so_many_are_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "MAX_PUBLISHERS", 2)
    known = Publishers()
    speaking(known, STRANGER)
    speaking(known, ANOTHER)
    assert speaking(known, ONE[0]).name == ONE[0].hex()
    assert ONE[0] not in known.heard
    assert known.refused == 1


def test_who_is_missed_anyway_makes_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_PUBLISHERS", 2)
    known = Publishers()
    speaking(known, STRANGER)
    gone = speaking(known, ANOTHER)
    gone.missed.update(gone.entities)
    speaking(known, ONE[0])
    assert set(known.heard) == {STRANGER, ONE[0]}
    assert known.refused == 0


def test_a_flood_of_entities_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_SPOKEN_FOR", 2)
    known = Publishers()
    publisher = known.meet(STRANGER, KEY, "", 0)
    for name in ("a", "b", "c"):
        known.spoke(publisher, name, 1)
    assert set(publisher.entities) == {"a", "b"}
    assert known.refused == 1
    known.left(publisher, "a")
    known.spoke(publisher, "c", 2)
    assert set(publisher.entities) == {"b", "c"}


def test_who_is_met_twice_at_once_is_one() -> None:
    known = Publishers()
    assert known.meet(STRANGER, KEY, "", 0) is known.meet(STRANGER, KEY, "", 0)
    assert len(known) == 0
