from __future__ import annotations

import attrs

from beacon_core.relay.frames import Advertisement, Content
from beacon_core.relay.lane import Cause, Lane, LaneState
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.republishing import FrameCounts, stats_of, status_of
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType

KIND = TopicType("t", "h")


def test_nothing_is_counted_at_first() -> None:
    assert not any(attrs.asdict(FrameCounts()).values())


def lane() -> Lane:
    one = Lane(1, 7, "/n", 3)
    track = Track(Advertisement(7, 1, 1, 0, 0, 0, 0, "/n", KIND, Qos(), Mode.STATE), 0, 0)
    track.place(Content(7, 1, 1, 2, 0, b"x", 7), Fate.DELIVERED, room=True)
    one.add(track)
    return one


def test_the_books_of_all_lanes_and_of_the_past_are_added_up() -> None:
    past = Ledger()
    past.enter(2)
    past.settle(Fate.DELIVERED, 2)
    stats = stats_of(
        past, [lane()], held_bytes=401, pending=5, origins=1, routes=1, frames=FrameCounts()
    )
    assert (stats.entered, stats.held, stats.missing, stats.pending) == (5, 1, 2, 5)
    assert stats.fates == {Fate.DELIVERED: 2}


def test_a_lane_tells_what_waits_and_what_is_missing() -> None:
    one = lane()
    status = status_of(one)
    assert (status.state, status.type, status.mode) == (LaneState.IDLE, None, Mode.STATE)
    assert (status.waiting, status.missing, status.since_ns) == (1, 2, 3)
    one.offers = (KIND, Qos())
    one.tracks.clear()
    one.move(Cause.MADE, 8)
    assert (status_of(one).type, status_of(one).mode, status_of(one).since_ns) == (KIND, None, 8)
