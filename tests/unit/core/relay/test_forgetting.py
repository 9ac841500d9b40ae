from __future__ import annotations

from beacon_core.relay.forgetting import MAX_REMEMBERED, Forgotten, Memory
from beacon_core.relay.frames import Digest
from beacon_core.relay.lane import Lane
from beacon_core.relay.peer import Peer
from beacon_core.relay.settings import Republishing

S = 10**9
SETTINGS = Republishing(max_origins=2, forget_ns=30 * S)


def peer(origin: int, heard_s: int, *routes: int) -> Peer:
    one = Peer(origin)
    one.join(Digest(origin, 4, 1, 0, full=True, fingerprint=0, entries=()), 0)
    one.heard_ns = heard_s * S
    for route in routes:
        one.learn(route, 0, 0, 0)
    return one


def test_the_least_recently_heard_of_the_silent_and_idle_ones_gives_way() -> None:
    forgotten = Forgotten(SETTINGS, 5)
    peers = {1: peer(1, 9)}
    assert forgotten.make_room(peers, 10 * S, linked=True)
    assert list(peers) == [1]
    peers[2] = peer(2, 8)
    assert not forgotten.make_room(peers, 37 * S, linked=True)
    assert not forgotten.make_room(peers, 50 * S, linked=False)
    assert forgotten.make_room(peers, 50 * S, linked=True)
    assert list(peers) == [1]
    peers[3] = peer(3, 5)
    peers[3].lanes["/n"] = Lane(1, 3, "/n", 0)
    assert forgotten.make_room(peers, 50 * S, linked=True)
    assert list(peers) == [3]


def test_of_one_that_was_forgotten_nothing_of_before_is_wanted() -> None:
    forgotten = Forgotten(SETTINGS, 5)
    peers = {1: peer(1, 0, 7, 9), 2: peer(2, 1)}
    forgotten.make_room(peers, 40 * S, linked=True)
    assert forgotten.recall(3, 4, followed=False) == Memory(5)
    assert forgotten.recall(2, 5, followed=True) == Memory(5)
    for life in (3, 4):
        assert forgotten.recall(1, life, followed=False) == Memory(40 * S + 1, 4, 9)
    assert forgotten.recall(1, 5, followed=False) == Memory(5)
    forgotten.follow(1)
    assert forgotten.recall(1, 4, followed=False) == Memory(5)


def test_of_very_many_only_the_time_is_remembered() -> None:
    forgotten = Forgotten(Republishing(max_origins=0, forget_ns=0), 5)
    for number in range(MAX_REMEMBERED + 2):
        assert forgotten.make_room({number: peer(number, 0, 3)}, 100 + number, linked=True)
    assert forgotten.recall(0, 4, followed=False) == Memory(102)
    assert forgotten.recall(10**6, 4, followed=False) == Memory(102)
    assert forgotten.recall(2, 4, followed=False) == Memory(103, 4, 3)
