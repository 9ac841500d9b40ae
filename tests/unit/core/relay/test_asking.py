from __future__ import annotations

from beacon_core.relay.alarms import Alarms
from beacon_core.relay.asking import HELLO, Asking
from beacon_core.relay.effects import Effect, Send
from beacon_core.relay.frames import Advertisement, Range, Reset, decode
from beacon_core.relay.peer import Peer
from beacon_core.relay.settings import Republishing
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType

MS = 10**6


class Fixture:
    def __init__(self, *, linked: bool = True) -> None:
        self.alarms: Alarms[tuple[str, int, int]] = Alarms()
        self.effects: list[Effect] = []
        self.asking = Asking(9, Republishing(max_asks=2), self.alarms, self.effects, 0)
        self.asking.linked = linked
        self.peer = Peer(7)
        self.peer.epoch = 2

    def asked(self) -> list[Reset]:
        sent = [decode(one.header, one.payload) for one in self.effects if isinstance(one, Send)]
        self.effects.clear()
        return [one for one in sent if isinstance(one, Reset)]


def track(missing: int, mode: Mode = Mode.ORDERED) -> Track:
    kind = TopicType("t", "h")
    one = Track(Advertisement(7, 2, 4, 0, 0, 0, 0, "/n", kind, Qos(), mode), 0, 0)
    one.announce(0, missing)
    return one


def test_a_hello_is_said_when_it_may_be_and_again_until_it_is_answered_or_tired() -> None:
    one = Fixture()
    one.asking.need_hello(0)
    assert one.asked() == [Reset(0, 0, 9, hello=1)]
    assert one.alarms.next_ns() == 100 * MS
    one.asking.need_hello(50 * MS)
    assert one.asked() == []
    assert one.alarms.pop_due(100 * MS) == HELLO
    one.asking.need_hello(100 * MS)
    assert one.asked() == [Reset(0, 0, 9, hello=2)]
    assert one.alarms.next_ns() is None
    one.asking.greeted()
    one.asking.need_hello(200 * MS)
    assert one.alarms.next_ns() == 300 * MS
    one.asking.greeted()
    assert one.alarms.next_ns() is None


def test_without_a_link_nothing_is_asked() -> None:
    one = Fixture(linked=False)
    one.peer.wanted[1] = 0
    one.asking.need_hello(0)
    one.asking.ask_new(one.peer, 0)
    one.asking.care_for(7, track(3), 0, stands_still=True)
    assert one.asked() == []
    assert one.alarms.next_ns() is None


def test_only_new_wishes_are_asked_at_once_and_all_after_a_while() -> None:
    one = Fixture()
    one.peer.wanted.update({1: 0, 2: 1})
    one.asking.ask_new(one.peer, 0)
    assert one.asked() == [Reset(7, 2, 9, wanted=(1,))]
    assert one.peer.wanted == {1: 1, 2: 1}
    one.asking.ask_new(one.peer, 0)
    assert one.asked() == []
    assert one.alarms.pop_due(100 * MS) == ("want", 7, 0)
    one.asking.ask_wanted(one.peer, [1, 2], 100 * MS)
    assert one.asked() == [Reset(7, 2, 9, wanted=(1, 2))]
    assert one.alarms.next_ns() == 300 * MS


def test_what_is_missing_is_asked_for_after_a_moment_and_not_waited_for_too_long() -> None:
    one = Fixture()
    gap = track(3)
    one.asking.care_for(7, gap, 0, stands_still=True)
    gap.announce(0, 9)
    one.asking.care_for(7, gap, 10 * MS, stands_still=True)
    assert one.alarms.pop_due(20 * MS) == ("ask", 7, 4)
    one.asking.ask_for(one.peer, gap, 20 * MS)
    assert one.asked() == [Reset(7, 2, 9, ranges=(Range(4, 0, 9),))]
    assert gap.outstanding == set(range(9))
    assert one.alarms.pop_due(120 * MS) == ("ask", 7, 4)
    assert one.alarms.pop_due(1000 * MS) == ("gap", 7, 4)
    assert one.asking.waited_before(7, 4) == 3


def test_progress_begins_the_wait_anew_and_its_end_ends_it() -> None:
    one = Fixture()
    gap = track(3, Mode.BEST_EFFORT)
    one.asking.care_for(7, gap, 0, stands_still=True)
    gap.cursor = 1
    one.asking.care_for(7, gap, 500 * MS, stands_still=True)
    assert one.alarms.next_ns() == 1500 * MS
    one.asking.care_for(7, gap, 600 * MS, stands_still=False)
    assert one.alarms.next_ns() is None
    one.asking.care_for(7, track(3), 0, stands_still=True)
    one.asking.rest(7, 4)
    assert one.alarms.next_ns() is None
