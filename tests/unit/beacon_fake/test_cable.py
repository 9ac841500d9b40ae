from __future__ import annotations

import pytest

from beacon_core.errors import UsageError
from beacon_core.ports.conduit import ConduitLimits
from beacon_core.testing.relay.conduit_harness import End
from beacon_fake.cable import FakeCable


def plugged(cable: FakeCable, count: int = 2) -> list[End]:
    return [End(cable.end()).start() for _ in range(count)]


def payloads(end: End) -> list[bytes]:
    return [payload for _, payload in end.sink.frames]


def test_frames_wait_until_they_are_let_through_in_any_order() -> None:
    cable = FakeCable()
    one, other = plugged(cable)
    for payload in (b"a", b"b", b"c"):
        assert one.conduit.send(b"h", payload)
    assert (len(cable), other.sink.frames) == (3, [])
    assert cable.deliver(4)
    assert cable.deliver(keep=True)
    assert cable.deliver_all() == 2
    assert not cable.deliver()
    assert payloads(other) == [b"b", b"a", b"a", b"c"]
    assert one.sink.frames == []


def test_a_frame_to_two_ends_is_two_under_way() -> None:
    cable = FakeCable()
    one, *others = plugged(cable, 3)
    one.conduit.send(b"h", b"a")
    assert len(cable) == 2
    cable.lose()
    assert cable.deliver_all() == 1
    assert cable.lost == 1
    assert sorted(map(payloads, others)) == [[], [b"a"]]


def test_no_more_is_lost_than_is_there() -> None:
    cable = FakeCable()
    one, _ = plugged(cable)
    for payload in (b"a", b"b", b"c"):
        one.conduit.send(b"h", payload)
    cable.lose(1, 9)
    cable.lose(5)
    assert (len(cable), cable.lost) == (1, 2)


def test_what_there_is_no_room_for_is_refused_until_there_is() -> None:
    cable = FakeCable(most_bytes=10)
    one, _ = plugged(cable)
    assert one.conduit.send(b"1234", b"5678")
    assert not one.conduit.send(b"123", b"")
    assert one.conduit.send(b"1", b"2")
    cable.deliver()
    assert one.conduit.send(b"123", b"4567")


def test_what_is_over_a_limit_is_refused() -> None:
    cable = FakeCable(ConduitLimits(2, 3))
    one, _ = plugged(cable)
    assert one.conduit.limits() == ConduitLimits(2, 3)
    assert one.conduit.send(b"12", b"123")
    assert not one.conduit.send(b"123", b"")
    assert not one.conduit.send(b"", b"1234")


def test_a_cut_loses_what_is_under_way_and_both_ends_are_told_once() -> None:
    cable = FakeCable()
    ends = plugged(cable)
    ends[0].conduit.send(b"h", b"a")
    cable.cut()
    cable.cut()
    assert not ends[0].conduit.send(b"h", b"b")
    cable.mend()
    assert (len(cable), cable.lost) == (0, 1)
    assert [[up for up, _ in end.sink.links] for end in ends] == [[True, False, True]] * 2


def test_an_end_that_closed_hears_nothing_of_what_is_under_way() -> None:
    cable = FakeCable()
    one, other = plugged(cable)
    one.conduit.send(b"h", b"a")
    other.conduit.close()
    other.conduit.close()
    cable.deliver_all()
    assert other.sink.frames == []
    assert not one.sink.up
    assert other.sink.up


def test_an_end_starts_once() -> None:
    cable = FakeCable()
    one, _ = plugged(cable)
    closed = End(cable.end())
    closed.conduit.close()
    for end in (one, closed):
        with pytest.raises(UsageError):
            end.start()
