from __future__ import annotations

import attrs
import pytest

from beacon_core.relay.effects import (
    Arm,
    CreatePublisher,
    DestroyPublisher,
    Effect,
    Publish,
    Send,
)
from beacon_core.relay.frames import (
    Advertisement,
    Content,
    Digest,
    Entry,
    Frame,
    Malformed,
    Range,
    Reset,
    decode,
    encode,
    fingerprint,
)
from beacon_core.relay.lane import LaneState
from beacon_core.relay.ledger import Fate
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import Republishing
from beacon_core.relay.values import Mode, Qos, TopicType

MS = 10**6
T1, T2 = TopicType("a/msg/B", "RIHS01_1"), TopicType("a/msg/B", "RIHS01_2")


class Side:
    """A republisher, and a forwarder made of paper: origin 7."""

    def __init__(
        self, *, linked: bool = True, own: tuple[int, ...] = (), **settings: object
    ) -> None:
        self.core = Republisher(
            asker=9,
            now_ns=0,
            own=own,
            settings=Republishing(**{"match_ns": 0, **settings}),  # type: ignore[arg-type]
        )
        self.now = 0
        self.control = 0
        if linked:
            self.do("link_up")

    def do(self, method: str, *args: object) -> list[Effect | Frame]:
        effects: list[Effect] = getattr(self.core, method)(*args, self.now)
        done = [read(one) if isinstance(one, Send) else one for one in effects]
        return [one for one in done if not isinstance(one, Arm)]

    def come(self, frame: Frame) -> list[Effect | Frame]:
        return self.do("frame", *encode(frame))

    def join(
        self, *entries: Entry, epoch: int = 2, age: int = 0, hello: int = 1, origin: int = 7
    ) -> list[Effect | Frame]:
        self.control += 1
        frame = Digest(origin, epoch, self.control, age, True, 0, entries, 9, hello)
        return self.come(frame)

    def digest(
        self, *entries: Entry, full: bool = False, others: tuple[tuple[int, int, int], ...] = ()
    ) -> list[Effect | Frame]:
        self.control += 1
        return self.come(Digest(7, 2, self.control, 0, full, fingerprint(others), entries))

    def advert(
        self, route: int = 1, *, name: str = "/n", kind: TopicType = T1, **more: object
    ) -> list[Effect | Frame]:
        self.control += 1
        frame = Advertisement(7, 2, route, self.control, 0, 0, 0, name, kind, Qos(), Mode.ORDERED)
        return self.come(attrs.evolve(frame, **more))  # type: ignore[arg-type]

    def content(self, seq: int, route: int = 1, *, payload: bytes = b"x", **more: int) -> list[int]:
        """Which contents are published thereupon, by their stamp: that is their number."""
        frame = Content(7, 2, route, seq, seq, payload, 7)
        return published(self.come(attrs.evolve(frame, **more)))  # type: ignore[arg-type]

    def later(self, ms: int) -> list[Effect | Frame]:
        self.now += ms * MS
        return self.do("tick")

    def fates(self) -> dict[Fate, int]:
        return self.core.stats().fates

    def state(self) -> LaneState:
        (lane,) = self.core.lanes()
        return lane.state


def read(one: Send) -> Frame:
    frame = decode(one.header, one.payload)
    assert not isinstance(frame, Malformed)
    return frame


def published(done: list[Effect | Frame]) -> list[int]:
    return [one.stamp_ns for one in done if isinstance(one, Publish)]


def asked(done: list[Effect | Frame]) -> list[Range]:
    return [run for one in done if isinstance(one, Reset) for run in one.ranges]


def wanted(done: list[Effect | Frame]) -> list[int]:
    return [route for one in done if isinstance(one, Reset) for route in one.wanted]


def hellos(done: list[Effect | Frame]) -> list[int]:
    return [one.hello for one in done if isinstance(one, Reset) and one.hello]


def live(**settings: object) -> Side:
    """It has joined a forwarder that has one topic, and publishes it."""
    side = Side(**settings)  # type: ignore[arg-type]
    side.join()
    side.advert()
    return side


# -- joining


def test_it_says_hello_until_it_is_answered_or_has_asked_often_enough() -> None:
    side = Side(linked=False)
    assert hellos(side.do("link_up")) == [1]
    said = []
    for ms in range(0, 20_000, 50):
        said += [(ms + 50, hello) for hello in hellos(side.later(50))]
    assert said == [(100, 2), (300, 3), (700, 4), (1500, 5), (3100, 6), (5100, 7), (7100, 8)]
    other = Side()
    other.join()
    assert other.later(10_000) == []


def test_nothing_is_believed_of_a_forwarder_that_has_not_answered() -> None:
    side = Side()
    side.now = 200 * MS
    assert hellos(side.advert()) == [2]
    side.content(0)
    side.join(hello=77)
    assert side.core.stats().origins == 0
    assert side.core.stats().frames.unjoined == 3


def test_an_answer_to_a_hello_long_ago_is_not_understood() -> None:
    side = Side()
    for _ in range(70):
        side.now += 3000 * MS
        side.advert()
    side.join(hello=1)
    assert side.core.stats().origins == 0
    side.join(hello=70)
    assert side.core.stats().origins == 1


def test_of_a_forwarder_that_was_there_before_only_what_follows_is_published() -> None:
    side = Side()
    assert wanted(side.join(Entry(1, 0, 0, 5), age=10)) == [1]
    side.advert(low=0, next=5)
    assert side.content(4) == []
    assert side.content(5) == [5]
    assert side.core.stats().frames.again == 1


def test_of_a_forwarder_that_came_later_everything_is_published() -> None:
    side = Side()
    side.now = 500 * MS
    side.advert()
    side.join(Entry(1, 0, 0, 1), age=500 * MS, hello=2)
    side.advert(next=1)
    assert side.content(0) == [0]


def test_a_restarted_forwarder_is_joined_anew_and_its_publisher_stays() -> None:
    side = live()
    side.content(0)
    side.content(2)
    side.now = 200 * MS
    later = attrs.evolve(ADVERT, epoch=3, control=99)
    assert hellos(side.come(later)) == [2]
    assert published(side.join(epoch=3, hello=2)) == [2]
    assert side.come(later) == []
    assert published(side.come(Content(7, 3, 1, 0, 0, b"x", 7))) == [0]
    assert side.content(1) == []
    assert side.fates() == {Fate.DELIVERED: 3, Fate.RESTARTED: 1}
    assert side.core.stats().frames.stale == 1


ADVERT = Advertisement(7, 2, 1, 1, 0, 0, 0, "/n", T1, Qos(), Mode.ORDERED)


def test_what_waits_to_be_published_survives_the_forwarders_restart() -> None:
    side = live(match_ns=500 * MS)
    side.content(0)
    side.content(2)
    assert side.join(epoch=3) == []
    side.come(attrs.evolve(ADVERT, epoch=3, control=99))
    side.come(Content(7, 3, 1, 0, 70, b"x", 7))
    assert published(side.later(500)) == [0, 2, 70]


def test_being_told_twice_is_being_told_once() -> None:
    side = live()
    side.content(0)
    assert wanted(side.join(Entry(1, 0, 0, 1))) == []
    assert side.content(0) == []
    assert side.content(1) == [1]


def test_an_answer_of_a_life_that_is_over_changes_nothing_however_late_it_comes() -> None:
    side = live()
    side.join(epoch=3)
    assert side.join(Entry(1, 0, 0, 9), epoch=2) == []
    assert side.core.stats().frames.stale == 1
    side.come(attrs.evolve(ADVERT, epoch=3, control=99))
    assert published(side.come(Content(7, 3, 1, 0, 5, b"x", 7))) == [5]


def test_without_a_link_it_says_no_hello() -> None:
    side = Side(linked=False)
    assert side.advert() == side.later(10_000) == []


def test_what_waited_for_an_advertisement_of_a_life_that_is_over_is_dropped() -> None:
    side = Side()
    side.join()
    side.content(0, route=4)
    assert side.core.stats().pending == 1
    side.join(epoch=3)
    assert (side.core.stats().pending, side.core.stats().held_bytes) == (0, 0)
    assert side.core.stats().frames.unadvertised == 1


def test_too_many_forwarders_are_refused() -> None:
    side = Side(max_origins=1)
    side.join()
    side.join(origin=8)
    assert (side.core.stats().origins, side.core.stats().frames.crowded) == (1, 1)


def forgotten() -> Side:
    """It had joined 7, and published 0 and 1 of a state; then 7 was closed and 8 has come instead.

    Its first hello was said at 0, its last at 40 s, just before 8 came.
    """
    side = Side(max_origins=1)
    side.join()
    side.advert(mode=Mode.STATE)
    assert side.content(0) == [0]
    assert side.content(1) == [1]
    side.advert(revision=1, closed=True, mode=Mode.STATE, next=2)
    side.later(1000)
    side.now = 40_000 * MS
    assert hellos(side.come(Content(8, 1, 1, 0, 0, b"x", 8))) == [2]
    side.join(origin=8, epoch=1, hello=2)
    assert side.core.stats().origins == 1
    # It goes in turn, when 7 comes back.
    side.now = 80_000 * MS
    return side


def test_a_silent_forwarder_of_which_nothing_is_left_gives_way_to_a_new_one() -> None:
    side = forgotten()
    assert side.core.stats().frames.crowded == 0
    side.join(origin=9, epoch=1, hello=2)
    side.join(origin=10, epoch=1, hello=2)
    assert (side.core.stats().origins, side.core.stats().frames.crowded) == (1, 1)


def test_one_that_has_a_topic_or_was_heard_of_late_does_not_give_way() -> None:
    side = Side(max_origins=1)
    side.join()
    side.advert()
    side.now = 10**6 * MS
    side.join(origin=8)
    assert side.core.stats().frames.crowded == 1
    other = Side(max_origins=1)
    other.join()
    other.do("link_down")
    other.now = 100_000 * MS
    other.join(origin=8)
    other.do("link_up")
    other.now += 29_000 * MS
    other.join(origin=8)
    assert (other.core.stats().origins, other.core.stats().frames.crowded) == (1, 2)
    other.now += 1000 * MS
    other.join(origin=8)
    assert other.core.stats().frames.crowded == 2


def test_nothing_of_a_forwarder_that_comes_back_is_published_twice() -> None:
    side = forgotten()
    side.join(Entry(1, 0, 0, 2), hello=1, age=40_000 * MS)
    side.join(Entry(1, 0, 0, 2), hello=2, age=40_000 * MS)
    assert side.content(1) == []
    assert side.core.stats().frames.unjoined == 4
    side.now += 10_000 * MS
    assert hellos(side.advert())
    side.join(Entry(1, 0, 0, 2), Entry(2, 0, 0, 3), hello=4, age=90_000 * MS)
    side.advert(mode=Mode.STATE, next=2)
    side.advert(2, name="/m", mode=Mode.STATE, next=3)
    assert side.content(1) == []
    assert side.content(2) == [2]
    assert [side.content(seq, route=2) for seq in (0, 1, 2, 3)] == [[0], [1], [2], [3]]


def test_a_life_before_the_one_that_was_forgotten_is_not_believed_again() -> None:
    side = forgotten()
    side.content(0)
    side.join(epoch=1, hello=3)
    assert side.core.stats().frames.unjoined == 3
    side.join(epoch=3, hello=2, age=10)
    side.come(attrs.evolve(ADVERT, epoch=3, control=99))
    assert published(side.come(Content(7, 3, 1, 0, 5, b"x", 7))) == [5]


def test_what_is_not_for_it_is_counted() -> None:
    side = Side(own=(7,))
    side.join()
    side.come(Reset(7, 2, 8))
    side.do("frame", b"noise", b"")
    frames = side.core.stats().frames
    assert (frames.own, frames.foreign, frames.malformed) == (1, 1, 1)


# -- control


def test_a_route_that_was_not_advertised_is_asked_for_again_and_again() -> None:
    side = Side()
    side.join()
    assert wanted(side.digest(Entry(1, 0, 0, 0))) == [1]
    asks = []
    for _ in range(40):
        asks += [side.now // MS for _ in wanted(side.later(100))]
    assert asks == [100, 300, 700, 1500, 3100]
    side.advert()
    assert side.later(10_000) == []


def test_a_route_that_a_digest_has_named_is_asked_for_however_long_it_takes() -> None:
    side = Side(max_asks=2)
    side.join(Entry(1, 0, 0, 0))
    for _ in range(20):
        side.later(2000)
    assert wanted(side.later(2000)) == [1]


def test_only_what_is_new_is_asked_for_at_once() -> None:
    side = Side()
    side.join()
    side.digest(Entry(1, 0, 0, 0))
    assert wanted(side.digest(Entry(1, 0, 0, 0), Entry(2, 0, 0, 0))) == [2]


def test_many_routes_are_asked_for_by_few_frames() -> None:
    side = Side()
    done = side.join(*(Entry(n, 0, 0, 0) for n in range(1, 301)))
    assert len(done) == 2
    assert wanted(done) == list(range(1, 301))


def test_a_newer_revision_is_asked_for_and_an_older_one_changes_nothing() -> None:
    side = live()
    assert wanted(side.digest(Entry(1, 1, 0, 0))) == [1]
    side.advert(revision=1, closed=True)
    side.advert(revision=0)
    assert side.core.stats().frames.stale == 1
    assert side.digest(Entry(1, 1, 0, 0)) == []


def test_a_digest_that_was_overtaken_changes_nothing() -> None:
    side = live()
    side.come(Digest(7, 2, 1, 0, full=True, fingerprint=0, entries=()))
    assert side.core.stats().frames.stale == 1
    assert side.core.stats().routes == 1


def test_routes_that_disagree_silently_make_it_ask_for_all() -> None:
    side = live()
    side.now = 500 * MS
    assert hellos(side.digest(others=((1, 0, 0),))) == []
    assert hellos(side.digest(others=((1, 0, 1),))) == [2]


def test_a_withdrawn_route_ends_and_its_publisher_goes() -> None:
    side = live()
    side.content(0)
    side.digest(Entry(1, 0, 0, 3))
    side.digest(full=True)
    assert side.fates() == {Fate.DELIVERED: 1, Fate.WITHDRAWN: 2}
    assert side.later(999) == []
    assert side.later(1) == [DestroyPublisher(1)]
    assert side.core.lanes() == []


def test_a_withdrawn_route_is_not_asked_for_any_more_and_its_late_advert_is_stale() -> None:
    side = Side()
    side.join(Entry(1, 0, 0, 0))
    side.control += 1
    side.digest(full=True)
    assert side.later(10_000) == []
    side.come(attrs.evolve(ADVERT, control=2))
    assert side.core.stats().frames.stale == 1
    assert side.core.lanes() == []


def test_a_new_route_of_the_topic_keeps_the_publisher() -> None:
    side = live()
    side.digest(full=True)
    side.later(500)
    assert side.advert(2) == []
    assert side.later(2000) == []
    assert side.content(0, route=2) == [0]


def test_more_routes_than_allowed_are_refused() -> None:
    side = Side(max_routes=1)
    side.join()
    side.content(0, route=8)
    side.content(0, route=9)
    side.digest(Entry(1, 0, 0, 0), Entry(2, 0, 0, 0))
    side.advert(3)
    side.content(0, route=3)
    assert side.core.stats().routes == 1
    assert side.core.stats().frames.crowded == 4


# -- contents


def test_contents_are_published_in_order_once_and_untouched() -> None:
    side = live()
    payload = b"anything"
    done = side.come(Content(7, 2, 1, 0, 55, payload, first=3, hop=1))
    assert done == [Publish(1, payload, 55, first=3, hop=2)]
    assert side.content(2) == []
    assert side.content(1) == [1, 2]
    assert side.content(1) == []
    assert side.core.stats().frames.again == 1


def test_contents_that_come_before_their_advertisement_wait_for_it() -> None:
    side = Side()
    side.join()
    assert wanted(side.come(Content(7, 2, 1, 1, 1, b"x", 7))) == [1]
    side.content(0)
    assert (side.core.stats().pending, side.core.stats().held_bytes) == (2, 802)
    done = side.advert(next=2)
    assert done[0] == CreatePublisher(1, "/n", T1, Qos(), 7)
    assert published(done) == [0, 1]
    assert (side.core.stats().pending, side.core.stats().held_bytes) == (0, 0)


def test_contents_of_a_route_that_nobody_advertises_are_dropped_in_the_end() -> None:
    side = Side(max_asks=3)
    side.join()
    side.content(0, route=5)
    side.later(100)
    side.later(200)
    assert side.core.stats().pending == 1
    side.later(400)
    assert side.core.stats().pending == 0
    assert side.core.stats().frames.unadvertised == 1
    assert side.later(10_000) == []


def test_a_gap_is_asked_for_when_it_does_not_close_by_itself_then_after_twice_as_long() -> None:
    side = live(gap_ns=10**12)
    side.content(2)
    assert side.later(19) == []
    assert asked(side.later(1)) == [Range(1, 0, 2)]
    assert asked(side.later(99)) == []
    assert asked(side.later(1)) == [Range(1, 0, 2)]
    assert asked(side.later(199)) == []
    assert asked(side.later(1)) == [Range(1, 0, 2)]
    side.content(0)
    assert side.content(1) == [1, 2]
    assert side.later(5000) == []


def test_a_backlog_is_asked_for_window_by_window() -> None:
    side = live(ask_window=2)
    side.digest(Entry(1, 0, 0, 5))
    assert asked(side.later(20)) == [Range(1, 0, 2)]
    side.content(0)
    assert asked(side.come(Content(7, 2, 1, 1, 1, b"x", 7))) == [Range(1, 2, 2)]


def test_a_gap_holds_up_what_follows_only_so_long() -> None:
    side = live()
    side.content(2)
    side.later(500)
    side.digest(Entry(1, 0, 0, 9))
    assert published(side.later(500)) == [2]
    assert side.fates() == {Fate.OVERDUE: 2, Fate.DELIVERED: 1}
    assert side.core.stats().missing == 6


def test_what_the_forwarder_has_no_more_is_not_waited_for() -> None:
    side = live()
    side.content(2)
    assert published(side.digest(Entry(1, 0, 2, 3))) == [2]
    assert side.fates() == {Fate.EVICTED: 2, Fate.DELIVERED: 1}


def test_without_a_link_nothing_is_asked_or_given_up() -> None:
    side = live()
    side.content(2)
    side.content(0, route=5)
    side.do("link_down")
    assert side.later(10_000) == []
    side.content(0, route=6)
    side.content(3)
    assert wanted(side.do("link_up")) == [5, 6]
    assert asked(side.later(20)) == [Range(1, 0, 2)]
    assert side.core.stats().missing == 2


def test_best_effort_passes_gaps_by_and_asks_for_nothing() -> None:
    side = Side()
    side.join()
    side.advert(mode=Mode.BEST_EFFORT)
    assert side.content(2) == [2]
    side.digest(Entry(1, 0, 0, 5))
    assert asked(side.later(1000)) == []
    assert side.fates() == {Fate.SKIPPED: 4, Fate.DELIVERED: 1}


def test_latest_asks_for_the_newest_only() -> None:
    side = Side()
    side.join()
    side.advert(mode=Mode.LATEST)
    side.digest(Entry(1, 0, 6, 7))
    assert asked(side.later(20)) == [Range(1, 6, 1)]
    assert side.content(6) == [6]


def test_what_has_no_room_is_not_taken_and_asked_for_again() -> None:
    side = live(hold_bytes=500)
    side.content(1)
    side.content(2)
    side.content(0, route=5)
    assert side.core.stats().frames.no_room == 2
    assert side.core.stats().held_bytes == 401
    assert side.content(0) == [0, 1]
    assert asked(side.later(20)) == [Range(1, 2, 1)]


def test_best_effort_passes_over_what_was_lost_without_any_room() -> None:
    side = Side(hold_bytes=0, match_ns=0)
    side.join()
    side.advert(mode=Mode.BEST_EFFORT)
    assert side.content(9) == [9]
    assert side.fates() == {Fate.SKIPPED: 9, Fate.DELIVERED: 1}


def test_what_comes_back_to_its_own_network_is_not_published() -> None:
    side = Side(own=(3,))
    side.join()
    side.advert()
    assert side.content(0, first=3) == []
    assert side.content(1) == [1]
    assert side.fates() == {Fate.ECHO: 1, Fate.DELIVERED: 1}


def test_a_content_of_a_route_that_is_over_is_nothing_new() -> None:
    side = live()
    side.advert(revision=1, closed=True)
    assert side.content(0) == []
    assert side.core.stats().frames.again == 1


# -- types


def test_another_type_waits_for_the_one_before_and_has_another_publisher() -> None:
    side = live()
    side.content(1)
    side.advert(2, kind=T2)
    assert side.content(0, route=2) == []
    side.advert(1, revision=1, closed=True, next=2)
    done = side.come(Content(7, 2, 1, 0, 0, b"x", 7))
    kinds = [one for one in done if not isinstance(one, Publish)]
    assert kinds == [DestroyPublisher(1), CreatePublisher(2, "/n", T2, Qos(), 7)]
    assert [one.handle for one in done if isinstance(one, Publish)] == [1, 1, 2]


def test_a_new_route_waits_for_older_ones_that_are_not_known_yet_but_not_for_ever() -> None:
    side = Side()
    side.join()
    side.digest(Entry(1, 0, 0, 1), Entry(2, 0, 0, 1))
    side.advert(2, kind=T2)
    assert side.content(0, route=2) == []
    side.content(0, route=1)
    done = side.advert(1, closed=True, next=1)
    assert published(done) == [0, 0]
    assert [one.type for one in done if isinstance(one, CreatePublisher)] == [T1, T2]

    other = Side()
    other.join()
    other.digest(Entry(1, 0, 0, 1), Entry(2, 0, 0, 1))
    other.advert(2)
    other.content(0, route=2)
    assert published(other.later(1000)) == [0]
    other.content(0, route=1)
    assert published(other.advert(1, closed=True, next=1)) == []
    assert other.fates() == {Fate.DELIVERED: 1, Fate.SKIPPED: 1}


def test_a_patient_route_goes_on_when_its_life_ends() -> None:
    side = Side()
    side.join()
    side.digest(Entry(1, 0, 0, 1), Entry(2, 0, 0, 1))
    side.advert(2)
    side.content(0, route=2)
    assert published(side.join(epoch=3)) == [0]
    assert side.later(5000) == [DestroyPublisher(1)]


# -- publishers


def test_messages_wait_until_all_subscriptions_have_matched() -> None:
    side = live(match_ns=500 * MS)
    assert side.content(0) == []
    assert side.state() is LaneState.WAIT_MATCH
    assert side.do("matched", 1, 1, 2) == []
    assert side.core.lanes()[0].reason == "1 of 2 subscriptions have matched"
    assert published(side.do("matched", 1, 2, 2)) == [0]
    assert side.content(1) == [1]
    assert side.do("matched", 1, 0, 5) == side.do("matched", 77, 1, 1) == []
    assert side.state() is LaneState.LIVE


def test_messages_wait_for_nobody_when_there_is_nobody_and_for_others_only_so_long() -> None:
    side = live(match_ns=500 * MS)
    side.content(0)
    assert published(side.do("matched", 1, 0, 0)) == [0]
    other = live(match_ns=500 * MS)
    other.content(0)
    assert published(other.later(499)) == []
    assert published(other.later(1)) == [0]


def test_the_originals_fixed_delay_waits_exactly_so_long() -> None:
    side = live(advertise_delay_ns=3000 * MS)
    side.content(0)
    assert side.do("matched", 1, 1, 1) == []
    assert published(side.later(2999)) == []
    assert published(side.later(1)) == [0]


def test_a_publisher_that_cannot_be_made_is_tried_again_and_keeps_only_state() -> None:
    side = Side()
    side.join()
    side.advert()
    side.advert(2, name="/s", mode=Mode.STATE)
    side.do("publisher_failed", 1, "no such type")
    side.do("publisher_failed", 2, "no such type")
    side.do("publisher_failed", 99, "not ours")
    assert side.content(0) == side.content(0, route=2) == []
    assert side.fates() == {Fate.REFUSED: 1}
    assert {one.reason for one in side.core.lanes()} == {"no such type"}
    assert side.later(4999) == []
    done = side.later(1)
    assert [one.handle for one in done if isinstance(one, CreatePublisher)] == [3, 4]
    assert published(done) == [0]
    assert side.content(1) == [1]


def test_a_refused_publisher_that_nothing_feeds_is_not_tried_again() -> None:
    side = live(retry_ns=500 * MS)
    side.do("publisher_failed", 1, "no such type")
    side.digest(full=True)
    assert side.later(500) == []
    assert side.later(500) == []
    assert side.core.lanes() == []


def test_a_refused_publisher_is_tried_again_for_the_next_that_feeds_it() -> None:
    side = live(retry_ns=500 * MS)
    side.do("publisher_failed", 1, "no such type")
    side.digest(full=True)
    side.later(500)
    assert side.advert(2) == [CreatePublisher(2, "/n", T1, Qos(), 7)]
    assert side.content(0, route=2) == [0]


def test_a_waiting_publisher_that_nothing_feeds_is_not_held_for_ever() -> None:
    side = live(match_ns=500 * MS)
    side.digest(full=True)
    assert side.later(500) == []
    assert side.later(500) == [DestroyPublisher(1)]


def test_lanes_tell_what_waits_and_what_is_missing() -> None:
    side = live()
    side.content(2)
    (lane,) = side.core.lanes()
    assert (lane.waiting, lane.missing, lane.type, lane.mode) == (1, 2, T1, Mode.ORDERED)
    side.digest(full=True)
    assert side.core.lanes()[0].mode is None


def test_time_that_goes_back_is_no_time() -> None:
    side = live(match_ns=500 * MS)
    side.later(499)
    side.content(0)
    side.now = 0
    assert published(side.later(1)) == []
    side.now = 500 * MS
    assert published(side.later(0)) == [0]


@pytest.mark.parametrize("size", [0, 1])
def test_a_message_of_any_size_arrives(size: int) -> None:
    side = live()
    assert side.content(0, payload=bytes(size)) == [0]
