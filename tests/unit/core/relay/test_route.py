from __future__ import annotations

from beacon_core.relay.forwarding import RouteState, SeenTopic
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.names import Ruling
from beacon_core.relay.route import Route, mode_of, new_route, stats_of, status_of, unfit
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode, Qos, TopicType

SEEN = SeenTopic(TopicType("t", "h"), Qos(depth=3))


def route(
    mode: Mode = Mode.ORDERED, shaping: Shaping = UNSHAPED, *, limited: bool = False
) -> Route:
    ruling = Ruling(True, "/r", 0, "", mode, shaping)
    return new_route(4, "/a", ruling, SEEN, 9, limited=limited)


def test_it_keeps_what_its_mode_promises() -> None:
    modes = (Mode.STATE, Mode.LATEST, Mode.BEST_EFFORT)
    assert [route(mode).history.most for mode in modes] == [3, 1, 0]
    assert route().history.most > 10**9


def test_it_goes_out_at_once_unless_its_rule_or_the_link_may_make_it_wait() -> None:
    assert route().plain
    for one in (route(shaping=Shaping(priority=1)), route(limited=True)):
        assert (one.plain, one.shaped) == (False, True)
    waits = route(Mode.BEST_EFFORT, limited=True)
    assert waits.history.most == 3
    assert route(Mode.LATEST).paced
    assert not waits.paced


def test_only_a_closed_route_tells_of_what_waits() -> None:
    one = route(limited=True)
    one.history.take(b"header", b"x", None)
    one.waiting.took(0, waits=True)
    assert one.told_next == 0
    assert status_of(one).next == 1
    one.closed = True
    assert one.told_next == 1
    assert status_of(one).state is RouteState.CLOSED
    assert status_of(route()).state is RouteState.OPEN


def test_the_mode_is_the_rules_or_follows_from_the_quality_of_service() -> None:
    free = Ruling(True, "/r", 0, "")
    assert mode_of(route().ruling, Qos(durable=True)) is Mode.ORDERED
    assert mode_of(free, Qos(durable=True)) is Mode.STATE
    assert mode_of(free, Qos()) is Mode.ORDERED
    assert mode_of(free, Qos(reliable=False)) is Mode.BEST_EFFORT


def test_the_books_of_all_routes_and_of_the_past_are_added_up() -> None:
    past, one, other = Ledger(), route(), route(Mode.BEST_EFFORT)
    past.pass_on(Fate.WITHDRAWN)
    for each in (one, other):
        each.history.take(b"header", b"x", 5)
    stats = stats_of(past, [one, other], held_bytes=401, malformed=2, foreign=3)
    assert (stats.entered, stats.held, stats.held_bytes, stats.routes) == (3, 1, 401, 2)
    assert stats.fates == {Fate.WITHDRAWN: 1, Fate.SENT: 1}
    assert (stats.malformed, stats.foreign) == (2, 3)


def test_what_no_frame_can_tell_of_is_unfit() -> None:
    assert unfit("/a", SEEN) == ""
    assert "missing" in unfit("", SEEN)
    assert "too long" in unfit("/" + "a" * 255, SEEN)
    assert "definition" in unfit("/a", SeenTopic(SEEN.type, definition=bytes(2**20 + 1)))
