from __future__ import annotations

import pytest

from beacon_core.relay.frames import Advertisement
from beacon_core.relay.lane import TRANSITIONS, Cause, Lane, LaneState
from beacon_core.relay.ledger import Fate
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType


def track(route: int, *, epoch: int = 1, mode: Mode = Mode.ORDERED) -> Track:
    kind = TopicType("t", "h")
    return Track(Advertisement(1, epoch, route, 0, 0, 0, 0, "/n", kind, Qos(), mode), 0, 0)


def test_routes_take_turns_by_life_and_number() -> None:
    lane = Lane(1, 1, "/n", 0)
    assert lane.head is None
    new, old, oldest = track(1, epoch=2), track(5), track(2)
    for one in (new, old, oldest):
        lane.add(one)
    assert lane.tracks == [oldest, old, new]
    assert lane.head is oldest


def test_only_the_head_passes_and_only_when_live() -> None:
    lane = Lane(1, 1, "/n", 0)
    head, second = track(1), track(2)
    lane.add(head)
    lane.add(second)
    lane.move(Cause.MADE, 5)
    assert not lane.lets_pass(head)
    lane.move(Cause.MATCHED, 6)
    assert lane.lets_pass(head)
    assert not lane.lets_pass(second)
    assert (lane.reason, lane.since_ns) == ("all subscriptions have matched", 6)


def test_a_refused_lane_lets_all_go_but_state() -> None:
    lane = Lane(1, 1, "/n", 0)
    lane.move(Cause.MADE, 0)
    lane.move(Cause.FAILED, 0, "no such type")
    assert (lane.state, lane.reason) == (LaneState.REFUSED, "no such type")
    ordered, state = track(1), track(2, mode=Mode.STATE)
    lane.add(ordered)
    assert lane.lets_pass(ordered)
    lane.tracks = [state]
    assert not lane.lets_pass(state)
    state.end(Fate.RESTARTED)
    assert lane.lets_pass(state)


def test_what_is_not_in_the_table_cannot_happen() -> None:
    lane = Lane(1, 1, "/n", 0)
    with pytest.raises(LookupError):
        lane.move(Cause.MATCHED, 0)
    assert {state for state, _ in TRANSITIONS} == set(LaneState)
