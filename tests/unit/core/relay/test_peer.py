from __future__ import annotations

from beacon_core.relay.frames import Advertisement, Digest, Entry, fingerprint
from beacon_core.relay.lane import Lane
from beacon_core.relay.peer import Peer
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType


def digest(*entries: Entry, control: int = 5, age: int = 100, told: int = 0) -> Digest:
    return Digest(
        1, 3, control, age, full=True, fingerprint=told, entries=entries, asker=9, hello=1
    )


def advert(route: int, mode: Mode = Mode.ORDERED) -> Advertisement:
    kind = TopicType("t", "h")
    return Advertisement(1, 3, route, 1, 0, 0, 9, "/n", kind, Qos(depth=3), mode)


def test_of_an_older_forwarder_only_what_follows_is_wanted() -> None:
    peer = Peer(1)
    peer.join(digest(Entry(1, 0, 2, 9), Entry(2, 0, 8, 9)), said_hello_after_ns=99)
    assert peer.epoch == 3
    assert peer.start_of(advert(1)) == 9
    assert peer.start_of(advert(3)) == 0


def test_of_its_state_the_last_ones_are_wanted_too() -> None:
    peer = Peer(1)
    peer.join(digest(Entry(1, 0, 2, 9), Entry(2, 0, 8, 9)), said_hello_after_ns=99)
    assert peer.start_of(advert(1, Mode.STATE)) == 6
    assert peer.start_of(advert(2, Mode.STATE)) == 8


def test_of_a_younger_forwarder_everything_is_wanted() -> None:
    peer = Peer(1)
    peer.join(digest(Entry(1, 0, 2, 9)), said_hello_after_ns=100)
    assert peer.start_of(advert(1)) == 0


def test_a_route_only_ever_gets_further() -> None:
    peer = Peer(1)
    peer.learn(1, 2, 9, 5)
    known = peer.learn(1, 1, 7, 6)
    assert (known.revision, known.next, known.control) == (2, 9, 5)


def test_what_is_not_named_is_compared() -> None:
    peer = Peer(1)
    peer.learn(2, 1, 7, 5)
    peer.learn(1, 0, 3, 5)
    assert peer.agrees(digest(Entry(1, 0, 0, 3), told=fingerprint([(2, 1, 7)])))
    assert not peer.agrees(digest(Entry(1, 0, 0, 3), told=fingerprint([(2, 1, 8)])))


def test_a_full_digest_ends_what_it_does_not_name_unless_that_is_newer() -> None:
    peer = Peer(1)
    peer.join(digest(Entry(1, 0, 0, 9), Entry(4, 0, 0, 9)), said_hello_after_ns=0)
    for route, control in ((1, 2), (2, 2), (3, 8)):
        peer.learn(route, 0, 0, control)
    assert peer.forget_unnamed(digest(Entry(1, 0, 0, 9), control=7)) == [2]
    assert sorted(peer.known) == [1, 3]
    assert peer.full_control == 7
    assert (peer.start_of(advert(1)), peer.start_of(advert(4))) == (9, 0)


def test_it_is_idle_while_nothing_of_it_is_published_or_wanted() -> None:
    peer = Peer(1)
    peer.join(digest(), said_hello_after_ns=0)
    assert peer.idle
    peer.learn(4, 1, 0, 0)
    peer.want_if_unlike(4, 1)
    assert not peer.idle


def test_an_advertisement_is_wanted_unless_the_one_there_is_says_the_same() -> None:
    peer = Peer(1)
    lane, track = Lane(1, 1, "/n", 0), Track(advert(4), 0, 0)
    peer.tracks[4] = lane, track
    peer.want_if_unlike(4, 0)
    peer.learn(5, 0, 0, 0).done = True
    peer.want_if_unlike(5, 9)
    assert peer.wanted == {}
    peer.want_if_unlike(4, 1)
    peer.learn(6, 0, 0, 0)
    peer.want_if_unlike(6, 0)
    assert peer.wanted == {4: 0, 6: 0}


def test_of_state_that_was_published_before_it_was_forgotten_nothing_is_wanted() -> None:
    peer = Peer(1)
    peer.join(digest(Entry(1, 0, 2, 9), Entry(2, 0, 2, 9)), 99, gone_before=1)
    assert peer.start_of(advert(1, Mode.STATE)) == 9
    assert peer.start_of(advert(2, Mode.STATE)) == 6
