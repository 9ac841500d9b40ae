"""Who spoke for whom; who has gone, and who was never there."""

from __future__ import annotations

import pytest

from beacon_ros_topic import roster as module
from beacon_ros_topic.roster import UNLISTED_FOR_S, Roster

A, B, C = b"a" * 16, b"b" * 16, b"c" * 16


@pytest.fixture
def roster() -> Roster:
    return Roster()


def heard(roster: Roster, gid: bytes, *entities: str) -> None:
    roster.meet(gid).messages += len(entities)
    for entity_id in entities:
        roster.spoke(gid, entity_id)


def test_a_publisher_is_met_once_and_named_by_its_gid(roster: Roster) -> None:
    assert roster.meet(A) is roster.meet(A)
    assert roster.meet(A).name == "61" * 16


def test_one_that_was_listed_and_is_not_any_more_has_gone_with_all_it_spoke_for(
    roster: Roster,
) -> None:
    heard(roster, A, "engine", "brake", "engine")
    heard(roster, B, "lidar")
    assert roster.gone([A, B], 0.0) == []
    (gone,) = roster.gone([B], 1.0)
    assert (gone.name, list(gone.entities)) == (A.hex(), ["engine", "brake"])
    assert roster.gone([B], 2.0) == []


def test_what_it_said_goodbye_for_does_not_go_with_it(roster: Roster) -> None:
    heard(roster, A, "engine", "brake")
    roster.left(roster.meet(A), "engine")
    roster.left(roster.meet(A), "engine")
    roster.left(roster.meet(A), "stranger")
    roster.gone([A], 0.0)
    assert list(roster.gone([], 1.0)[0].entities) == ["brake"]


def test_one_that_was_heard_but_never_listed_is_forgotten_without_a_word(roster: Roster) -> None:
    heard(roster, A, "engine")
    for now_s in (5.0, 6.0, 5.0 + UNLISTED_FOR_S):
        assert roster.gone([], now_s) == []
        assert A in roster.publishers
    assert roster.gone([], 5.1 + UNLISTED_FOR_S) == []
    assert A not in roster.publishers
    assert roster.messages() == 1


def test_one_that_is_listed_late_is_missed_like_any_other(roster: Roster) -> None:
    heard(roster, A, "engine")
    roster.gone([], 0.0)
    roster.gone([A], 1.0)
    assert [one.name for one in roster.gone([], 100.0)] == [A.hex()]


def test_one_that_is_listed_and_never_heard_goes_without_having_spoken(roster: Roster) -> None:
    roster.gone([A], 0.0)
    (gone,) = roster.gone([], 1.0)
    assert gone.entities == {}


def test_one_that_comes_back_begins_anew(roster: Roster) -> None:
    heard(roster, A, "engine")
    roster.gone([A], 0.0)
    roster.gone([], 1.0)
    assert roster.meet(A).entities == {}
    assert not roster.meet(A).listed


def test_messages_are_counted_of_all_that_ever_came(roster: Roster) -> None:
    heard(roster, A, "engine", "engine")
    heard(roster, B, "brake")
    roster.gone([A, B], 0.0)
    roster.gone([B], 1.0)
    heard(roster, C, "lidar")
    assert roster.messages() == 4


class TestCaps:
    @pytest.fixture(autouse=True)
    def _few(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(module, "MAX_PUBLISHERS", 2)
        monkeypatch.setattr(module, "MAX_SPOKEN_FOR", 3)

    def test_publishers_beyond_are_heard_but_not_remembered(self, roster: Roster) -> None:
        for gid in (A, B, C, C, C):
            heard(roster, gid, "engine")
        assert set(roster.publishers) == {A, B}
        assert roster.refused == 3
        assert roster.messages() == 5

    def test_what_they_speak_for_takes_nobodys_room(self, roster: Roster) -> None:
        heard(roster, A, "engine")
        heard(roster, B, "brake")
        for number in range(100):
            heard(roster, C, f"part-{number}")
        heard(roster, B, "lidar")
        assert list(roster.meet(B).entities) == ["brake", "lidar"]

    def test_listed_ones_beyond_take_no_room_either_and_are_no_refusals(
        self, roster: Roster
    ) -> None:
        for now_s in range(5):
            assert roster.gone([A, B, C], now_s) == []
        assert len(roster.publishers) == 2
        assert roster.refused == 0

    def test_entities_beyond_are_not_missed_until_there_is_room_again(self, roster: Roster) -> None:
        heard(roster, A, "one", "two", "three", "four")
        assert roster.refused == 1
        assert list(roster.meet(A).entities) == ["one", "two", "three"]
        roster.left(roster.meet(A), "one")
        heard(roster, A, "four")
        assert list(roster.meet(A).entities) == ["two", "three", "four"]

    def test_who_goes_makes_room(self, roster: Roster) -> None:
        heard(roster, A, "one", "two", "three")
        roster.gone([A], 0.0)
        roster.gone([], 1.0)
        heard(roster, B, "one", "two", "three")
        assert len(roster.meet(B).entities) == 3
        assert roster.refused == 0
