from __future__ import annotations

import pytest

from beacon_core.relay.effects import Arm, Effect, Send, Subscribe, Unsubscribe
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import RouteState, SeenTopic
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
)
from beacon_core.relay.ledger import Fate
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.settings import Forwarding
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.values import Mode, Qos, TopicType

MS = 10**6
T1, T2 = TopicType("a/msg/B", "RIHS01_1"), TopicType("a/msg/B", "RIHS01_2")
NAMES = NameMap(
    (
        Rule(allow=False, pattern="/no/**"),
        Rule(allow=True, pattern="/latest", to="/r/latest", mode=Mode.LATEST),
        Rule(allow=True, pattern="/twin", to="/r/a"),
        Rule(allow=True, pattern="/**", to="/r/**"),
    )
)


class Side:
    """A forwarder, and the frames that it sent."""

    def __init__(self, *, linked: bool = True, **settings: int) -> None:
        self.core = Forwarder(
            origin=7, epoch=2, names=NAMES, now_ns=0, settings=Forwarding(**settings)
        )
        self.now = 0
        self.handles: dict[str, int] = {}
        if linked:
            self.do("link_up")

    def do(self, method: str, *args: object, **named: object) -> list[Effect | Frame]:
        effects: list[Effect] = getattr(self.core, method)(*args, self.now, **named)
        self.handles.update(
            {one.topic: one.handle for one in effects if isinstance(one, Subscribe)}
        )
        return [read(one) if isinstance(one, Send) else one for one in effects]

    def sent(self, method: str, *args: object, **named: object) -> list[Effect | Frame]:
        """Only frames."""
        done = self.do(method, *args, **named)
        return [one for one in done if not isinstance(one, Arm | Subscribe | Unsubscribe)]

    def take(self, topic: str, payload: bytes, **named: object) -> list[Effect | Frame]:
        """A message of the topic's last subscription; the frames that follow."""
        return self.sent("message", self.handles.get(topic, 0), payload, **named)

    def see(self, topic: str, kind: TopicType = T1, **qos: object) -> list[Effect | Frame]:
        return self.do("topic_seen", topic, SeenTopic(kind, Qos(**qos), b"int32 x"))  # type: ignore[arg-type]

    def ask(self, **what: object) -> list[Effect | Frame]:
        reset = Reset(7, 2, 99, **what)  # type: ignore[arg-type]
        return self.sent("frame", *encode(reset))

    def meanwhile(self, ms: int) -> list[Effect | Frame]:
        """The frames of so long a time."""
        sent = []
        for _ in range(ms):
            self.now += MS
            sent += self.sent("tick")
        return sent

    def fates(self) -> dict[Fate, int]:
        return self.core.stats().fates


def read(one: Send) -> Frame:
    frame = decode(one.header, one.payload)
    assert not isinstance(frame, Malformed)
    return frame


def seqs(frames: list[Effect | Frame]) -> list[int]:
    return [one.seq for one in frames if isinstance(one, Content)]


def test_a_topic_that_is_seen_is_subscribed_and_advertised_under_its_new_name() -> None:
    side = Side()
    subscribe, advert = side.see("/a")
    assert subscribe == Subscribe(1, "/a", T1, Qos())
    assert advert == Advertisement(7, 2, 1, 2, 0, 0, 0, "/r/a", T1, Qos(), Mode.ORDERED)
    assert side.see("/a") == []


def test_a_message_is_sent_untouched_with_the_next_number() -> None:
    side = Side()
    side.see("/a")
    payload = b"anything"
    assert side.take("/a", payload, stamp_ns=5) == [Content(7, 2, 1, 0, 5, payload, first=7)]
    assert seqs(side.take("/a", b"")) == [1]


@pytest.mark.parametrize(
    ("qos", "mode"),
    [
        (Qos(), Mode.ORDERED),
        (Qos(reliable=False), Mode.BEST_EFFORT),
        (Qos(durable=True), Mode.STATE),
    ],
)
def test_the_mode_follows_from_the_quality_of_service(qos: Qos, mode: Mode) -> None:
    side = Side()
    side.do("topic_seen", "/a", SeenTopic(T1, qos))
    assert side.core.routes()[0].mode is mode


def test_a_type_change_is_a_new_route_and_closes_the_old_one() -> None:
    side = Side()
    side.see("/a")
    side.take("/a", b"old")
    unsubscribe, closed, subscribe, opened = side.see("/a", T2)
    assert unsubscribe == Unsubscribe(1)
    assert isinstance(closed, Advertisement)
    assert (closed.route, closed.closed, closed.revision, closed.next) == (1, True, 1, 1)
    assert subscribe == Subscribe(2, "/a", T2, Qos())
    assert isinstance(opened, Advertisement)
    assert (opened.route, opened.type) == (2, T2)
    assert [one.state for one in side.core.routes()] == [RouteState.CLOSED, RouteState.OPEN]


def test_a_closed_route_can_be_asked_for_until_it_has_lingered() -> None:
    side = Side(linger_ns=1500 * MS)
    side.see("/a")
    side.take("/a", b"x")
    side.do("topic_gone", "/a")
    side.now = 1499 * MS
    side.do("tick")
    assert seqs(side.ask(ranges=(Range(1, 0, 1),))) == [0]
    side.now = 1500 * MS
    side.do("tick")
    assert side.core.routes() == []
    assert side.ask(wanted=(1,), ranges=(Range(1, 0, 1),)) == []
    assert side.fates() == {Fate.SENT: 1}
    assert side.core.stats().held_bytes == 0


def test_a_route_that_closes_without_a_link_lingers_once_there_is_one() -> None:
    side = Side(linked=False)
    side.see("/a")
    side.take("/a", b"x")
    side.do("topic_gone", "/a")
    side.now = 10**12
    assert side.do("tick") == []
    side.do("link_up")
    assert seqs(side.ask(ranges=(Range(1, 0, 1),))) == [0]
    side.do("link_down")
    side.now += 10**12
    side.do("tick")
    assert len(side.core.routes()) == 1
    side.do("link_up")
    side.now += 5000 * MS
    side.do("tick")
    assert side.core.routes() == []


def test_a_message_that_was_never_sent_ends_as_withdrawn() -> None:
    side = Side(linked=False)
    side.see("/a")
    side.take("/a", b"x")
    side.do("topic_gone", "/a")
    side.do("link_up")
    side.now = 5000 * MS
    side.do("tick")
    assert side.fates() == {Fate.WITHDRAWN: 1}


def test_what_is_refused_says_why_and_is_admitted_when_it_can_be() -> None:
    side = Side(max_routes=2)
    for topic in ("/a", "/no/b", "/twin", "/c", "/d"):
        side.see(topic)
    refused = {one.topic: one.reason for one in side.core.routes() if one.route is None}
    assert refused == {
        "/no/b": "denied by rule 0: /no/**",
        "/twin": "/r/a is fed by /a already",
        "/d": "there are 2 routes already",
    }
    assert side.core.explain("/no/b").reason == refused["/no/b"]
    side.do("topic_gone", "/d")
    side.do("topic_gone", "/a")
    side.now = 5000 * MS
    side.do("tick")
    assert [one.topic for one in side.core.routes() if one.route] == ["/c", "/twin"]


@pytest.mark.parametrize(
    ("topic", "seen", "reason"),
    [
        ("/" + "a" * 255, SeenTopic(T1), "missing, too long"),
        ("/a", SeenTopic(TopicType("a", "")), "missing, too long"),
        ("/a", SeenTopic(TopicType("a\ud800", "b")), "not printable"),
        ("/a", SeenTopic(T1, definition=bytes(2**20 + 1)), "its definition is too long"),
    ],
)
def test_what_no_frame_can_carry_is_refused(topic: str, seen: SeenTopic, reason: str) -> None:
    side = Side()
    assert side.do("topic_seen", topic, seen) == []
    assert reason in side.core.routes()[0].reason


def test_a_message_of_no_route_is_counted() -> None:
    side = Side()
    assert side.take("/a", b"x") == []
    assert side.fates() == {Fate.WITHDRAWN: 1}


def test_a_late_message_of_an_old_subscription_is_never_taken_for_one_of_the_new_type() -> None:
    side = Side()
    side.see("/a")
    old = side.handles["/a"]
    side.see("/a", T2)
    assert side.handles["/a"] != old
    assert side.sent("message", old, b"x") == []
    assert side.fates() == {Fate.WITHDRAWN: 1}


def test_what_has_come_back_or_come_too_far_is_not_sent() -> None:
    side = Side()
    side.see("/a")
    assert side.take("/a", b"x", first=7, hop=1) == []
    assert side.take("/a", b"x", first=3, hop=4) == []
    assert side.take("/a", b"x", first=3, hop=3) == [Content(7, 2, 1, 0, 0, b"x", first=3, hop=3)]
    assert side.fates() == {Fate.ECHO: 1, Fate.HOPS: 1}


def test_a_message_that_is_too_large_is_refused_whichever_limit_it_is() -> None:
    side = Side(message_bytes=4)
    side.see("/a")
    side.take("/a", b"12345")
    other = Side(hold_bytes=403)
    other.see("/a")
    other.take("/a", b"1234")
    assert side.fates() == other.fates() == {Fate.OVERSIZE: 1}


def test_without_a_link_messages_are_kept_and_best_effort_ones_are_not() -> None:
    side = Side(linked=False)
    assert side.see("/a") == [Subscribe(1, "/a", T1, Qos())]
    side.see("/b", reliable=False)
    assert side.take("/a", b"x") == side.take("/b", b"x") == []
    assert side.ask(hello=1) == []
    assert (side.core.stats().held, side.fates()) == (1, {Fate.UNLINKED: 1})
    digest = side.sent("link_up")[0]
    assert isinstance(digest, Digest)
    assert digest.full
    assert digest.entries == (Entry(1, 0, 0, 1), Entry(2, 0, 0, 0))
    assert seqs(side.take("/b", b"x")) == [0]
    assert side.fates() == {Fate.UNLINKED: 1, Fate.SENT: 1}


def test_latest_and_state_keep_only_the_last() -> None:
    side = Side(linked=False)
    side.see("/latest")
    side.see("/s", durable=True, depth=2)
    for _ in range(3):
        side.take("/latest", b"x")
        side.take("/s", b"x")
    latest, state = side.core.routes()
    assert (latest.held, latest.fates) == (1, {Fate.CONFLATED: 2})
    assert (state.held, state.fates) == (2, {Fate.EVICTED: 1})


def test_the_cap_takes_the_oldest_of_the_route_that_holds_most() -> None:
    side = Side(hold_bytes=3 * 401)
    side.see("/big")
    side.see("/small")
    for _ in range(3):
        side.take("/big", b"x")
    side.take("/small", b"x")
    assert [(one.held, one.next) for one in side.core.routes()] == [(2, 3), (1, 1)]
    side.take("/big", b"x")
    assert [(one.held, one.next) for one in side.core.routes()] == [(2, 4), (1, 1)]
    assert side.core.stats().held_bytes == 3 * 401


def test_a_digest_each_period_names_what_changed_and_stands_for_the_rest() -> None:
    side = Side()
    side.see("/a")
    side.now = 5000 * MS
    side.see("/b")
    (digest,) = side.sent("tick")
    assert isinstance(digest, Digest)
    assert (digest.full, digest.age_ns, digest.asker) == (False, 5000 * MS, 0)
    assert digest.entries == (Entry(2, 0, 0, 0),)
    assert side.do("tick") == []


def test_a_hello_is_answered_with_all_routes_but_not_too_often() -> None:
    side = Side()
    side.see("/a")
    (answer,) = side.ask(hello=3)
    assert isinstance(answer, Digest)
    assert (answer.full, answer.asker, answer.hello) == (True, 99, 3)
    assert side.ask(hello=4) == []
    side.now = 50 * MS
    reset = Reset(0, 0, 99, hello=5)
    assert len(side.sent("frame", *encode(reset))) == 1


def test_of_several_that_say_hello_at_once_each_is_answered_in_its_turn() -> None:
    side = Side()
    for asker, hello in ((1, 5), (2, 6), (3, 7), (2, 8)):
        side.sent("frame", *encode(Reset(0, 0, asker, hello=hello)))
    answers = [one for one in side.meanwhile(200) if isinstance(one, Digest)]
    assert [(one.asker, one.hello) for one in answers] == [(2, 8), (3, 7)]
    for asker in range(1, 100):
        side.sent("frame", *encode(Reset(0, 0, asker, hello=1)))
    side.do("link_down")
    side.do("link_up")
    assert len(side.meanwhile(200)) == 0


def test_an_advertisement_is_repeated_when_asked_for_with_its_definition_if_wished() -> None:
    side = Side()
    side.see("/a")
    assert side.ask(wanted=(1, 8)) == []
    side.now = 50 * MS
    (plain,) = side.ask(wanted=(1,))
    side.now = 100 * MS
    (told,) = side.ask(wanted=(1, 1, 1), definitions=True)
    assert isinstance(plain, Advertisement)
    assert isinstance(told, Advertisement)
    assert (plain.definition, told.definition) == (None, b"int32 x")


def test_contents_are_sent_again_when_asked_for_but_not_too_often() -> None:
    side = Side()
    side.see("/a")
    for _ in range(3):
        side.take("/a", b"x")
    wish = (Range(1, 1, 9), Range(5, 0, 1))
    assert side.ask(ranges=wish) == []
    side.now = 20 * MS
    assert seqs(side.ask(ranges=wish)) == [1, 2]
    assert side.ask(ranges=wish) == []


def test_who_asks_for_what_is_gone_is_told_so() -> None:
    side = Side(hold_bytes=401)
    side.see("/a")
    for _ in range(3):
        side.take("/a", b"x")
    assert side.ask(ranges=(Range(1, 0, 1),)) == []
    side.now = 50 * MS
    (told,) = side.ask(ranges=(Range(1, 0, 1),))
    assert isinstance(told, Advertisement)
    assert (told.low, told.next) == (2, 3)


def test_what_is_not_for_it_is_counted_and_changes_nothing() -> None:
    side = Side()
    side.see("/a")
    for frame in (Reset(8, 2, 9, hello=1), Reset(7, 1, 9, hello=1), Content(1, 1, 1, 1, 1, b"", 1)):
        assert side.do("frame", *encode(frame)) == []
    assert side.do("frame", b"noise", b"") == []
    stats = side.core.stats()
    assert (stats.foreign, stats.malformed) == (3, 1)


def test_whatever_is_asked_it_does_not_send_more_than_its_bounds() -> None:
    side = Side()
    side.see("/a")
    for _ in range(10):
        side.take("/a", b"x")
    sent: list[Effect | Frame] = []
    for ms in range(1000):
        side.now = ms * MS
        sent += side.ask(hello=1, wanted=(1,) * 50, ranges=(Range(1, 0, 10),) * 20)
    assert sum(isinstance(one, Advertisement) for one in sent) <= 20
    assert sum(isinstance(one, Digest) for one in sent) <= 20
    assert len(seqs(sent)) <= 10 * 50


def test_time_that_goes_back_is_no_time() -> None:
    side = Side()
    side.now = 1000 * MS
    side.do("tick")
    side.now = 0
    assert side.do("tick") == []
    digest = side.ask(hello=1)[0]
    assert isinstance(digest, Digest)
    assert digest.age_ns == 1000 * MS


def test_a_message_brings_the_time_along() -> None:
    side = Side(resend_gap_ns=20 * MS)
    side.see("/a")
    side.now = 100 * MS
    side.take("/a", b"x")
    side.now = 119 * MS
    assert side.ask(ranges=(Range(1, 0, 1),)) == []
    side.now = 120 * MS
    assert seqs(side.ask(ranges=(Range(1, 0, 1),))) == [0]


# -- shaping


def shaped(
    link: float | None = None,
    mode: Mode | None = None,
    hold_bytes: int = 10**6,
    **shaping: object,
) -> Side:
    """Linked; ``/a`` is shaped so, ``/b`` is not."""
    side = Side()
    one = Shaping(**shaping)  # type: ignore[arg-type]
    names = NameMap(
        (Rule(allow=True, pattern="/a", mode=mode, shaping=one), Rule(allow=True, pattern="/**"))
    )
    settings = Forwarding(link_bytes_per_s=link, hold_bytes=hold_bytes)
    side.core = Forwarder(origin=7, epoch=2, names=names, now_ns=0, settings=settings)
    side.do("link_up")
    side.see("/a")
    side.see("/b")
    return side


def test_what_exceeds_its_rate_is_dropped_and_counted_and_has_no_number() -> None:
    side = shaped(rate_hz=10)
    assert [seqs(side.take("/a", b"x")) for _ in range(4)] == [[0], [1], [], []]
    side.now = 100 * MS
    assert seqs(side.take("/a", b"x")) == [2]
    assert side.fates() == {Fate.LIMITED: 2}
    assert seqs(side.take("/b", b"x")) == [0]


def test_the_newest_of_latest_waits_for_its_turn_and_nobody_is_told_before() -> None:
    side = shaped(mode=Mode.LATEST, rate_hz=1)
    assert [seqs(side.take("/a", b"x")) for _ in range(4)] == [[0], [1], [], []]
    side.now = 100 * MS
    assert side.ask(ranges=(Range(1, 3, 9),)) == side.do("tick") == []
    (told,) = side.ask(wanted=(1,))
    assert isinstance(told, Advertisement)
    assert (told.low, told.next) == (3, 3)
    side.now = 1000 * MS
    digest, newest = side.sent("tick")
    assert isinstance(digest, Digest)
    assert isinstance(newest, Content)
    assert newest.seq == 3
    assert side.fates() == {Fate.SENT: 2, Fate.CONFLATED: 1}


def test_what_is_too_old_is_not_sent_again_and_the_other_side_is_told() -> None:
    side = shaped(max_age_ns=100 * MS)
    side.take("/a", b"x")
    side.now = 99 * MS
    assert seqs(side.ask(ranges=(Range(1, 0, 1),))) == [0]
    side.now = 150 * MS
    (told,) = side.ask(ranges=(Range(1, 0, 1),))
    assert isinstance(told, Advertisement)
    assert (told.low, told.next) == (1, 1)
    assert side.fates() == {Fate.SENT: 1}


def test_what_became_too_old_without_a_link_is_never_sent() -> None:
    side = shaped(max_age_ns=100 * MS)
    side.do("link_down")
    side.take("/a", b"x")
    side.now = 100 * MS
    digest = side.sent("link_up")[0]
    assert isinstance(digest, Digest)
    assert digest.entries[0] == Entry(1, 0, 1, 1)
    assert side.fates() == {Fate.EXPIRED: 1}


def test_a_full_link_makes_contents_wait_and_the_first_class_go_first() -> None:
    side = shaped(link=10_000, priority=7)
    for _ in range(30):
        side.take("/b", bytes(52))
    assert side.take("/a", bytes(52)) == []
    gone = [one.route for one in side.meanwhile(500) if isinstance(one, Content)]
    assert gone[:2] == [1, 2]
    assert 15 <= len(gone) <= 31
    assert (side.core.stats().held, side.fates()) == (31, {})


def test_what_is_asked_for_on_a_full_link_waits_too() -> None:
    side = shaped(link=10_000)
    side.do("link_down")
    for _ in range(20):
        assert side.take("/b", bytes(52)) == []
    side.now = 10_000 * MS
    side.do("link_up")
    first = seqs(side.ask(ranges=(Range(2, 0, 99),) * 2))
    later = seqs(side.meanwhile(300))
    assert first + later == list(range(20))
    assert first
    assert later
    assert side.take("/b", b"x", first=7) == []
    assert side.take("/b", b"x", first=3, hop=9) == []
    assert side.take("/b", bytes(2**20)) == []
    assert side.fates() == {Fate.ECHO: 1, Fate.HOPS: 1, Fate.OVERSIZE: 1}


def test_best_effort_may_wait_for_a_full_link_but_for_no_link() -> None:
    side = shaped(link=1000, mode=Mode.BEST_EFFORT)
    side.now = 2000 * MS
    assert seqs(side.take("/a", bytes(500))) == [0]
    assert side.take("/a", b"x") == []
    assert seqs(side.meanwhile(2000)) == [1]
    assert (side.core.stats().held, side.fates()) == (0, {Fate.SENT: 2})
    side.take("/a", bytes(500))
    assert side.take("/a", b"x") == []
    side.do("link_down")
    assert side.take("/a", b"x") == []
    assert (side.core.stats().held, side.fates()) == (0, {Fate.SENT: 3, Fate.UNLINKED: 2})


def test_what_may_go_at_once_needs_no_room() -> None:
    side = shaped(hold_bytes=401, priority=1)
    assert seqs(side.take("/b", b"x")) == [0]
    assert seqs(side.take("/a", b"x")) == [0]
    assert side.fates() == {Fate.SENT: 1}


def test_a_closed_route_lets_out_what_waits_and_says_how_much_that_is() -> None:
    side = shaped(link=1000)
    side.now = 2000 * MS
    assert seqs(side.take("/a", bytes(500))) == [0]
    side.take("/a", b"x")
    closed = [one for one in side.sent("topic_gone", "/a") if isinstance(one, Advertisement)]
    assert [(one.closed, one.next) for one in closed] == [(True, 2)]
    assert seqs(side.meanwhile(2000)) == [1]
