"""The roster: what follows from a token that comes or goes, and when."""

from __future__ import annotations

import pytest

from beacon_zenoh import roster as module
from beacon_zenoh.keys import Token
from beacon_zenoh.roster import ASK_AGAIN_NS, GRACE_NS, SETTLE_NS, Due, Roster

ENGINE = Token("engine", "run-1")
NOTHING = Due()
LATER = 10**12


@pytest.fixture
def roster() -> Roster:
    """With one token, whose hint was heard."""
    made = Roster()
    made.appeared(ENGINE, 0)
    made.heard(ENGINE)
    return made


def asked_at(roster: Roster) -> list[int]:
    """All times at which it wants somebody to be asked."""
    times = []
    while (due_ns := roster.next_due_ns()) is not None:
        if roster.due(due_ns).ask:
            times.append(due_ns)
    return times


def test_a_new_one_has_nothing_to_do() -> None:
    assert Roster().next_due_ns() is None
    assert Roster().due(LATER) == NOTHING
    assert len(Roster()) == 0


def test_a_token_that_goes_is_a_loss_after_the_grace_and_only_once(roster: Roster) -> None:
    roster.due(LATER)
    roster.vanished(ENGINE, LATER)
    assert len(roster) == 0
    assert roster.next_due_ns() == LATER + GRACE_NS
    assert roster.due(LATER + GRACE_NS - 1) == NOTHING
    assert roster.due(LATER + GRACE_NS) == Due(lost=(ENGINE,))
    assert roster.due(2 * LATER) == NOTHING


def test_a_token_that_is_back_within_the_grace_is_no_loss(roster: Roster) -> None:
    roster.vanished(ENGINE, 0)
    roster.appeared(ENGINE, GRACE_NS - 1)
    roster.heard(ENGINE)
    assert roster.due(LATER) == NOTHING


def test_the_grace_begins_anew_when_it_goes_again(roster: Roster) -> None:
    roster.vanished(ENGINE, 0)
    roster.appeared(ENGINE, 10)
    roster.vanished(ENGINE, 20)
    assert roster.due(GRACE_NS + 10).lost == ()
    assert roster.due(GRACE_NS + 20).lost == (ENGINE,)


def test_a_repeated_report_changes_nothing(roster: Roster) -> None:
    roster.vanished(ENGINE, 0)
    roster.vanished(ENGINE, GRACE_NS // 2)
    roster.vanished(Token("never-seen"), 0)
    assert roster.due(GRACE_NS) == Due(lost=(ENGINE,))
    assert roster.due(LATER) == NOTHING


@pytest.mark.parametrize("token", [ENGINE, Token("engine")])
def test_who_said_goodbye_is_not_lost_whichever_is_reported_first(token: Token) -> None:
    for goodbye_first in (True, False):
        roster = Roster()
        roster.appeared(token, 0)
        roster.heard(ENGINE)
        if goodbye_first:
            roster.left(ENGINE)
            roster.vanished(token, 1)
        else:
            roster.vanished(token, 1)
            roster.left(ENGINE)
        assert roster.due(LATER) == NOTHING
        assert not roster.awaited


def test_who_speaks_again_after_a_goodbye_can_be_lost_again(roster: Roster) -> None:
    roster.left(ENGINE)
    assert "engine" in roster.awaited
    roster.heard(ENGINE)
    roster.due(LATER)
    roster.vanished(ENGINE, LATER)
    assert roster.due(LATER + GRACE_NS) == Due(lost=(ENGINE,))


def test_the_goodbye_of_one_run_is_not_that_of_another(roster: Roster) -> None:
    successor = Token("engine", "run-2")
    roster.appeared(successor, 0)
    roster.heard(successor)
    roster.left(ENGINE)
    roster.vanished(ENGINE, 1)
    roster.vanished(successor, 1)
    assert roster.due(1 + GRACE_NS) == Due(lost=(successor,))


def test_a_token_without_a_hint_is_asked_about_three_times_and_then_left_alone() -> None:
    roster = Roster()
    roster.appeared(ENGINE, 0)
    assert "engine" in roster.awaited
    first, second = SETTLE_NS, SETTLE_NS + ASK_AGAIN_NS[0]
    assert asked_at(roster) == [first, second, second + ASK_AGAIN_NS[1]]
    assert not roster.awaited


def test_nobody_is_asked_once_a_hint_was_heard() -> None:
    roster = Roster()
    roster.appeared(ENGINE, 0)
    assert roster.due(SETTLE_NS).ask == ("engine",)
    roster.heard(ENGINE)
    assert not roster.awaited
    assert asked_at(roster) == []


def test_an_entity_with_several_tokens_is_asked_about_once() -> None:
    roster = Roster()
    roster.appeared(ENGINE, 0)
    roster.appeared(Token("engine"), 1)
    assert roster.due(SETTLE_NS + 1).ask == ("engine",)


def test_a_goodbye_of_somebody_without_a_token_is_nothing() -> None:
    roster = Roster()
    roster.left(ENGINE)
    assert not roster.awaited
    assert roster.due(LATER) == NOTHING


def test_when_the_session_was_replaced_only_who_does_not_come_back_is_lost(roster: Roster) -> None:
    other = Token("other")
    roster.appeared(other, 0)
    roster.heard(other)
    roster.all_vanished(1000)
    assert len(roster) == 0
    roster.appeared(other, 500)
    roster.heard(other)
    assert roster.due(1000) == Due(lost=(ENGINE,))
    assert len(roster) == 1


def test_a_flood_of_tokens_is_counted_and_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_TOKENS", 3)
    roster = Roster()
    for number in range(5):
        roster.appeared(Token(f"robot-{number}"), 0)
    assert (len(roster), roster.refused) == (3, 2)
    roster.appeared(Token("robot-0"), 1)
    assert roster.refused == 2
    assert set(roster.awaited) == {"robot-0", "robot-1", "robot-2"}
    roster.vanished(Token("robot-0"), 2)
    roster.appeared(Token("robot-4"), 3)
    assert (len(roster), roster.refused) == (3, 2)


def test_a_flood_of_tokens_that_come_and_go_is_counted_and_overlooked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "MAX_TOKENS", 3)
    roster = Roster()
    for number in range(10):
        token = Token(f"robot-{number}")
        roster.appeared(token, number)
        roster.vanished(token, number)
        assert len(roster._missing) <= 3
        assert len(roster.awaited) <= 3
    assert (len(roster), roster.refused, roster.overlooked) == (0, 0, 14)
    assert roster.due(GRACE_NS + 9).lost == (
        Token("robot-0"),
        Token("robot-1"),
        Token("robot-2"),
    )
    # Whose loss was overlooked may come back, and is awaited as soon as there is room.
    while (due_ns := roster.next_due_ns()) is not None:
        roster.due(due_ns)
    roster.appeared(Token("robot-9"), LATER)
    assert set(roster.awaited) == {"robot-9"}


def test_a_token_that_flaps_leaves_no_heap_of_timers_behind() -> None:
    roster = Roster()
    for number in range(10_000):
        roster.appeared(ENGINE, number)
        roster.vanished(ENGINE, number)
        assert len(roster._timers) <= 2 * 2 + 64 + 1
    assert roster.due(GRACE_NS + 9_999).lost == (ENGINE,)
    assert roster.overlooked == 0


def test_timers_are_tidied_away_without_losing_one() -> None:
    roster = Roster()
    for number in range(100):
        roster.appeared(Token(f"robot-{number}"), number)
    for number in range(50):
        roster.heard(Token(f"robot-{number}"))
        roster.left(Token(f"robot-{number}"))
    for number in range(50, 60):
        roster.vanished(Token(f"robot-{number}"), 100)
    for flap in range(1_000):
        roster.appeared(ENGINE, 100 + flap)
    roster.heard(ENGINE)
    due = roster.due(SETTLE_NS + 2_000)
    assert due.lost == tuple(Token(f"robot-{number}") for number in range(50, 60))
    assert due.ask == tuple(f"robot-{number}" for number in range(50, 100))
