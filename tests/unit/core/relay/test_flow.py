from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.relay.effects import Publish
from beacon_core.relay.flow import Flow
from beacon_core.relay.frames import HEAD, Advertisement, Content, encode
from beacon_core.relay.lane import Cause, Lane
from beacon_core.relay.ledger import Fate
from beacon_core.relay.peer import Known
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType

ADVERT = Advertisement(7, 2, 1, 0, 0, 0, 3, "/n", TopicType("t", "h"), Qos(), Mode.ORDERED)
NEXT = Content(7, 2, 1, 3, 9, b"x", first=4, hop=2)


class Fixture:
    """A route whose next content is number 3."""

    def __init__(self) -> None:
        self.lane = Lane(1, 7, "/n", 0)
        self.lane.handle = 5
        self.lane.move(Cause.MADE, 0)
        self.lane.move(Cause.WAITED, 0)
        self.track = Track(ADVERT, 0, 0)
        self.track.cursor = self.track.next = 3
        self.lane.add(self.track)
        self.known = Known(0, 3, 0)
        self.flow = Flow(own={8})
        self.flow.add(self.lane, self.track, self.known)

    def come(self, content: Content) -> object:
        return self.flow.through(*encode(content))

    def books(self) -> tuple[int, int, int, int, dict[Fate, int]]:
        one = self.track
        return one.next, one.cursor, self.known.next, one.ledger.entered, one.ledger.fates()


def test_just_the_next_one_goes_out_untouched_and_is_counted() -> None:
    one = Fixture()
    assert one.come(NEXT) == [Publish(5, b"x", 9, first=4, hop=3)]
    assert one.books() == (4, 4, 4, 1, {Fate.DELIVERED: 1})
    one.known.next = 9
    assert one.come(attrs.evolve(NEXT, seq=4)) is not None
    assert one.books() == (5, 5, 9, 2, {Fate.DELIVERED: 2})


@pytest.mark.parametrize(
    "change",
    [
        {"seq": 2},
        {"seq": 4},
        {"epoch": 1},
        {"epoch": 3},
        {"route": 2},
        {"origin": 6},
        {"first": 8},
    ],
)
def test_whatever_is_not_just_the_next_one_takes_the_long_way(change: dict[str, Any]) -> None:
    one = Fixture()
    before = one.books()
    assert one.come(attrs.evolve(NEXT, **change)) is None
    assert one.books() == before


def _missing(one: Fixture) -> None:
    one.track.announce(0, 4)


def _ended(one: Fixture) -> None:
    one.track.end(Fate.RESTARTED)


def _failed(one: Fixture) -> None:
    one.lane.move(Cause.FAILED, 0)


def _handle_gone(one: Fixture) -> None:
    one.lane.handle = None


def _removed(one: Fixture) -> None:
    one.flow.remove(7, 1)
    one.flow.remove(7, 1)


def _older_came(one: Fixture) -> None:
    one.lane.add(Track(attrs.evolve(ADVERT, route=0), 0, 0))


@pytest.mark.parametrize(
    "happens", [_missing, _ended, _failed, _handle_gone, _removed, _older_came]
)
def test_a_route_that_does_not_flow_any_more_takes_the_long_way(
    happens: Callable[[Fixture], None],
) -> None:
    one = Fixture()
    happens(one)
    before = one.books()
    assert one.come(NEXT) is None
    assert one.books() == before


@pytest.mark.parametrize("at", [0, 1, 3])
def test_a_frame_of_another_kind_takes_the_long_way(at: int) -> None:
    one = Fixture()
    header = bytearray(encode(NEXT)[0])
    header[at] += 1
    assert one.flow.through(bytes(header), b"x") is None
    assert one.flow.through(bytes(header[:-1]), b"x") is None
    assert one.flow.through(HEAD.pack(1, 2, 0, 0, 7, 2, 1, 3, 0, 4) + b"more", b"") is None
