from __future__ import annotations

from beacon_core.relay.greeting import Greeting, pause_ns
from beacon_core.relay.settings import Republishing

MS = 10**6
SETTINGS = Republishing(max_asks=3)


def test_each_pause_is_twice_as_long_up_to_the_longest() -> None:
    pauses = [pause_ns(SETTINGS, asks) // MS for asks in (0, 1, 2, 4, 5, 10**9)]
    assert pauses == [100, 200, 400, 1600, 2000, 2000]


def test_hellos_are_numbered_and_get_tired_until_one_is_answered() -> None:
    greeting = Greeting(SETTINGS, 5)
    assert greeting.free_ns == 5
    assert [greeting.say(10), greeting.say(20)] == [1, 2]
    assert greeting.free_ns == 20 + 200 * MS
    assert not greeting.tired
    greeting.say(30)
    assert greeting.tired
    greeting.answered()
    assert not greeting.tired
    greeting.say(40)
    assert greeting.free_ns == 40 + 100 * MS


def test_only_the_last_hellos_are_remembered() -> None:
    greeting = Greeting(SETTINGS, 0)
    for now_ns in range(70):
        greeting.say(now_ns)
    assert greeting.said_ns(6) is None
    assert greeting.said_ns(7) == 6
    assert greeting.said_ns(71) is None
