from __future__ import annotations

from beacon_core.relay.frames import Advertisement, Content, Range
from beacon_core.relay.ledger import Fate
from beacon_core.relay.track import Placed, Track
from beacon_core.relay.values import Mode, Qos, TopicType


def track(mode: Mode = Mode.ORDERED, *, start: int = 0, closed: bool = False) -> Track:
    kind = TopicType("t", "h")
    advertised = Advertisement(1, 1, 9, 0, 0, 0, 0, "/n", kind, Qos(), mode, closed)
    return Track(advertised, start, 0)


def come(one: Track, *seqs: int, room: bool = True) -> list[Placed]:
    return [
        one.place(Content(1, 1, 9, seq, 0, b"four", 1), Fate.DELIVERED, room=room) for seq in seqs
    ]


def pops(one: Track) -> list[int]:
    seqs = []
    while (popped := one.pop()) is not None:
        seqs.append(popped[0].seq)
        one.ledger.settle(popped[1])
    return seqs


def test_contents_leave_in_order_once() -> None:
    one = track()
    assert come(one, 1, 0, 1, 2) == [Placed.HELD, Placed.HELD, Placed.AGAIN, Placed.HELD]
    assert one.held_bytes == 3 * 404
    assert pops(one) == [0, 1, 2]
    assert come(one, 1) == [Placed.AGAIN]
    assert (one.held, one.held_bytes, one.ledger.entered, one.ledger.held) == (0, 0, 3, 0)


def test_a_track_flows_once_it_has_begun_and_while_it_has_nothing() -> None:
    one = track()
    assert not one.flows
    come(one, 0)
    assert not one.flows
    assert pops(one) == [0]
    assert one.flows
    one.announce(0, 2)
    assert not one.flows
    come(one, 1)
    assert pops(one) == [1]
    assert one.flows
    one.end(Fate.RESTARTED)
    assert not one.flows


def test_a_gap_stops_what_follows_until_it_is_given_up() -> None:
    one = track()
    come(one, 0, 3)
    assert pops(one) == [0]
    assert one.is_missing()
    assert one.missing(9) == (Range(9, 1, 2),)
    one.stop_waiting(3)
    one.give_up(2, Fate.SKIPPED)
    assert not one.is_missing()
    assert pops(one) == [3]
    assert one.ledger.fates() == {Fate.DELIVERED: 2, Fate.OVERDUE: 2}


def test_what_nobody_has_any_more_is_passed_by() -> None:
    one = track()
    one.announce(4, 6)
    come(one, 5)
    assert one.missing(9) == (Range(9, 4, 1),)
    assert one.is_missing()
    come(one, 4)
    assert not one.is_missing()
    assert pops(one) == [4, 5]
    assert one.ledger.fates() == {Fate.EVICTED: 4, Fate.DELIVERED: 2}


def test_missing_ones_are_named_in_runs_up_to_a_number() -> None:
    one = track()
    come(one, 1, 4)
    one.announce(0, 1000)
    assert one.missing(3) == (Range(9, 0, 1), Range(9, 2, 2))
    assert sum(run.count for run in one.missing(600)) == 600
    assert max(run.count for run in one.missing(600)) == 256


def test_a_number_that_leaps_costs_nothing() -> None:
    one = track()
    one.announce(0, 2**64 - 1)
    assert one.is_missing()
    assert len(one.missing(64)) == 1
    one.announce(2**64 - 2, 2**64 - 1)
    assert pops(one) == []
    assert one.ledger.fates() == {Fate.EVICTED: 2**64 - 2}


def test_without_room_a_content_stays_missing() -> None:
    one = track()
    assert come(one, 0, room=False) == [Placed.NO_ROOM]
    assert one.is_missing()
    assert one.ledger.held == 1


def test_best_effort_without_room_is_given_up_since_nobody_sends_it_again() -> None:
    one = track(Mode.BEST_EFFORT)
    assert come(one, 1, room=False) == [Placed.NO_ROOM]
    assert pops(one) == []
    assert one.ledger.fates() == {Fate.SKIPPED: 2}


def test_what_may_be_next_waits_for_nothing_before_it() -> None:
    ordered, best_effort = track(), track(Mode.BEST_EFFORT)
    assert ordered.may_be_next(0)
    assert not ordered.may_be_next(1)
    assert best_effort.may_be_next(1)


def test_best_effort_waits_for_nobody() -> None:
    one = track(Mode.BEST_EFFORT)
    come(one, 2)
    assert pops(one) == [2]
    assert come(one, 1) == [Placed.AGAIN]
    one.announce(0, 4)
    assert pops(one) == []
    one.stop_waiting(4)
    assert pops(one) == []
    assert one.ledger.fates() == {Fate.SKIPPED: 3, Fate.DELIVERED: 1}


def test_latest_keeps_the_newest_only() -> None:
    one = track(Mode.LATEST)
    assert come(one, 1, 3, 2, room=False) == [Placed.HELD, Placed.HELD, Placed.AGAIN]
    assert (one.held, one.held_bytes) == (1, 404)
    assert not one.is_missing()
    assert one.missing(9) == ()
    assert pops(one) == [3]
    one.announce(6, 7)
    assert one.missing(9) == (Range(9, 6, 1),)
    assert pops(one) == []
    assert one.ledger.fates() == {Fate.DELIVERED: 1, Fate.CONFLATED: 5}


def test_a_track_is_done_when_it_is_over_and_nothing_is_left() -> None:
    assert track(closed=True).done
    one = track()
    come(one, 0, 2)
    assert not one.done
    one.end(Fate.RESTARTED)
    one.announce(0, 9)
    assert come(one, 8) == [Placed.AGAIN]
    assert pops(one) == [0, 2]
    assert one.done
    assert one.ledger.fates() == {Fate.DELIVERED: 2, Fate.RESTARTED: 1}


def test_a_track_may_begin_anywhere() -> None:
    one = track(start=5)
    assert come(one, 4, 5) == [Placed.AGAIN, Placed.HELD]
    assert one.ledger.entered == 1
