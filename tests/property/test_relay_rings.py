"""Relays beside each other: no message goes round for ever, mirrored links do mirrored things.

What is drawn: rings of two to four relays with any name maps, and links both ways on which anything
may happen, at either end.

    BEACON_RELAY_STEPS=100000 pytest tests/property/test_relay_rings.py   as long as in CI
"""

from __future__ import annotations

import os
from collections import Counter
from typing import Any

import hypothesis
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from beacon_core.relay.effects import Effect, Send
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import Content, decode
from beacon_core.relay.names import Link, NameMap, Rule, find_loop
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode, Qos, TopicType
from tests.property.relay_net import MS, End, Net, Published
from tests.property.running import first_seed

STEPS = int(os.environ.get("BEACON_RELAY_STEPS", "10000"))
KIND = TopicType("pkg/msg/T", "RIHS01_1")
SEEN = SeenTopic(KIND, Qos(depth=3))

seeded = hypothesis.seed(first_seed())
often = settings(
    max_examples=max(5, STEPS // 500),
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)

met: Counter[str] = Counter()


# ruff: noqa: FBT001 - what is drawn is given by name
# -- rings

patterns = st.builds(
    lambda parts, rest: "/" + "/".join([*parts, *rest]),
    st.lists(st.sampled_from(["a", "b", "*"]), min_size=1, max_size=2),
    st.sampled_from([[], ["**"]]),
)


@st.composite
def rules(draw: st.DrawFn) -> Rule:
    pattern = draw(patterns)
    if draw(st.integers(0, 5)) == 0:
        return Rule(allow=False, pattern=pattern)
    wild = [one for one in pattern[1:].split("/") if one in {"*", "**"}]
    to = [draw(st.sampled_from(["a", "b", "c"])), *wild] if draw(st.booleans()) else []
    return Rule(allow=True, pattern=pattern, to="/" + "/".join(to) if to else "")


maps = st.lists(rules(), min_size=1, max_size=3).map(lambda some: NameMap(tuple(some)))


def ring(names: list[NameMap], *, tells: bool) -> Net:
    """Network ``n0`` to ``n1`` by the first map, and so on, and back."""
    net = Net(tells=tells)
    count = len(names)
    for at in range(count):
        net.add(f"to-{at}", f"n{(at + 1) % count}", f"c{at}")
        net.add(f"from-{at}", f"n{at}", f"c{at}")
    for at, one in enumerate(names):
        own = [(at + 1) % count + 1]
        republishing = Republishing(match_ns=0, max_routes=12)
        republisher = Republisher(asker=at + 1, now_ns=net.now, own=own, settings=republishing)
        net.receive_by(net.ends[f"to-{at}"], republisher)
        forwarding = Forwarding(max_routes=12)
        forwarder = Forwarder(
            origin=at + 1, epoch=1, names=one, now_ns=net.now, settings=forwarding
        )
        net.send_by(net.ends[f"from-{at}"], forwarder)
    return net


@seeded
@often
@given(
    names=st.lists(maps, min_size=2, max_size=4),
    topics=st.lists(
        st.sampled_from(["/a", "/b", "/a/a", "/a/b", "/c/a", "/a/b/a"]), min_size=1, max_size=3
    ),
    into=st.integers(0, 3),
    tells=st.booleans(),
)
def passes_each_relay_at_most_once(
    names: list[NameMap],
    topics: list[str],
    into: int,
    tells: bool,
) -> None:
    count = len(names)
    links = [Link(f"n{at}", f"n{(at + 1) % count}", one) for at, one in enumerate(names)]
    loops = find_loop(links) is not None
    if loops and not tells:
        # Nothing prevents that: so such names are refused.
        met["refused"] += 1
        return
    met["a loop, and they tell" if loops else "no loop"] += 1
    net = ring(names, tells=tells)
    network = f"n{into % count}"
    for topic in topics:
        net.topic(network, topic, SEEN)
    net.pass_time(2500 * MS)
    for number, topic in enumerate(topics):
        net.publish(network, topic, b"%d" % number)
        net.flow()
    net.pass_time(500 * MS)
    heard = Counter((one.topic, one.payload) for one in net.published)
    assert all(times <= count for times in heard.values())
    met["came through"] += bool(heard)
    so_far = len(net.published)
    net.pass_time(8000 * MS)
    assert len(net.published) == so_far


def test_a_message_passes_each_relay_of_a_ring_at_most_once_under_each_name() -> None:
    met.clear()
    passes_each_relay_at_most_once()
    kinds = {"refused", "no loop", "a loop, and they tell", "came through"}
    assert met.keys() == kinds or STEPS < 20_000


# -- the mirrored link

BOTH = NameMap(
    (
        Rule(allow=False, pattern="/far/**"),
        Rule(allow=True, pattern="/latest", to="/far/latest", mode=Mode.LATEST),
        Rule(allow=True, pattern="/slow", to="/far/slow", shaping=Shaping(rate_hz=5, priority=7)),
        Rule(allow=True, pattern="/*", to="/far/*"),
    )
)
ends = st.sampled_from([0, 1])
names_of_topics = st.sampled_from(["/a", "/latest", "/slow", "/state"])
inputs = st.one_of(
    st.tuples(st.just("publish"), ends, names_of_topics, st.integers(0, 3)),
    st.tuples(st.just("seen"), ends, names_of_topics, st.integers(1, 2)),
    st.tuples(st.just("gone"), ends, names_of_topics),
    st.tuples(st.just("flow")),
    st.tuples(st.just("lose"), ends, st.integers(0, 50)),
    st.tuples(st.just("repeat"), ends, st.integers(0, 50)),
    st.tuples(st.just("overtake"), ends, st.integers(0, 50)),
    st.tuples(st.just("down"), ends),
    st.tuples(st.just("up"), ends),
    st.tuples(st.just("restart"), ends),
    st.tuples(st.just("later"), st.sampled_from([1, 30, 500, 3000])),
)


class Pair:
    """A link both ways. ``swapped``: who was left is right, with all that happens to it."""

    def __init__(self, *, swapped: bool) -> None:
        self.net = Net(tells=True)
        self.who = [1, 0] if swapped else [0, 1]
        self.lives = 1
        self.count = 0
        for place in (0, 1):
            self.net.add(f"end-{place}", f"n{place}", "c")
        for person in (0, 1):
            self.begin(person)

    def end(self, person: int) -> End:
        return self.net.ends[f"end-{self.who[person]}"]

    def begin(self, person: int) -> None:
        now, origin = self.net.now, 10 + person
        settings = Republishing(match_ns=0)
        asker = 100 * self.lives + person
        republisher = Republisher(asker=asker, now_ns=now, own=[origin], settings=settings)
        self.net.receive_by(self.end(person), republisher)
        forwarding = Forwarding(link_bytes_per_s=20_000.0, hold_bytes=20_000)
        self.net.send_by(
            self.end(person),
            Forwarder(origin=origin, epoch=self.lives, names=BOTH, now_ns=now, settings=forwarding),
        )

    def do(self, what: str, *args: Any) -> None:
        if what == "flow":
            self.net.flow()
        elif what == "later":
            self.net.pass_time(args[0] * MS)
        else:
            getattr(self, what)(args[0], *args[1:])

    def publish(self, person: int, topic: str, size: int) -> None:
        for _ in range(3):
            self.count += 1
            payload = b"%d" % self.count * (1 + 40 * size)
            self.net.publish(self.end(person).network, topic, payload)

    def seen(self, person: int, topic: str, number: int) -> None:
        qos = Qos(durable=topic == "/state", depth=2)
        seen = SeenTopic(TopicType("pkg/msg/T", f"RIHS01_{number}"), qos)
        self.net.topic(self.end(person).network, topic, seen)

    def gone(self, person: int, topic: str) -> None:
        self.net.topic(self.end(person).network, topic, None)

    def lose(self, person: int, at: int) -> None:
        self.end(person).inbox.lose(at)

    def repeat(self, person: int, at: int) -> None:
        self.net.deliver(self.end(person), at, keep=True)

    def overtake(self, person: int, at: int) -> None:
        self.net.deliver(self.end(person), at)

    def down(self, person: int) -> None:
        self.end(person).inbox.cut()
        self.net.tell_sender(self.end(person), "link_down")
        self.net.tell_receiver(self.end(person), "link_down")

    def up(self, person: int) -> None:
        self.net.tell_sender(self.end(person), "link_up")
        self.net.tell_receiver(self.end(person), "link_up")

    def restart(self, person: int) -> None:
        self.lives += 1
        self.begin(person)


@seeded
@often
@given(st.lists(inputs, max_size=40))
def test_mirrored_inputs_of_a_link_both_ways_have_the_mirrored_effects(
    happens: list[tuple[Any, ...]],
) -> None:
    traces: list[list[list[Effect]]] = []
    for swapped in (False, True):
        pair = Pair(swapped=swapped)
        for one in happens:
            pair.do(*one)
        pair.net.pass_time(3000 * MS)
        traces.append([pair.end(person).effects for person in (0, 1)])
    assert traces[0] == traces[1]


# -- what one route suffers is no other's

shapes = st.just(UNSHAPED) | st.builds(
    Shaping,
    rate_hz=st.none() | st.just(20.0),
    max_age_ns=st.none() | st.just(100 * MS),
    priority=st.integers(0, 7),
)
troubles = st.one_of(
    st.tuples(st.just("publish"), st.sampled_from(["/sound", "/ill"]), st.integers(1, 5)),
    st.tuples(st.just("later"), st.sampled_from([1, 7, 30, 200, 1500])),
    st.tuples(st.just("fails")),
    st.tuples(st.just("changes"), st.integers(1, 3)),
    st.tuples(st.just("goes")),
    st.tuples(st.just("matches"), st.booleans()),
)


class Ward:
    """A sound route, and beside it one to which everything happens; or not, if it is not there."""

    def __init__(self, modes: tuple[Mode, Mode], shape: tuple[Shaping, Shaping], ill: str) -> None:
        self.ill = ill
        self.net = Net(tells=True, matches=False)
        self.net.loses = self.lost
        self.sends: Counter[tuple[int, int]] = Counter()
        self.count: Counter[str] = Counter()
        sound, other = (
            Rule(allow=True, pattern=topic, to=f"/r{topic}", mode=mode, shaping=one)
            for topic, mode, one in zip(("/sound", "/ill"), modes, shape, strict=True)
        )
        if ill == "denied":
            other = Rule(allow=False, pattern="/ill")
        sender, receiver = self.net.add("s", "n0", "c"), self.net.add("r", "n1", "c")
        settings = Republishing(gap_ns=300 * MS)
        self.net.receive_by(receiver, Republisher(asker=9, now_ns=self.net.now, settings=settings))
        names = NameMap((sound, other))
        self.net.send_by(sender, Forwarder(origin=7, epoch=1, names=names, now_ns=self.net.now))
        self.receiver = receiver
        self.net.topic("n0", "/sound", SEEN)
        self.changes(1)
        self.net.flow()

    def lost(self, effect: Send) -> bool:
        """Contents are lost by their route, number and how often they were sent: alike each time.

        Of the sound route each third, of the ill one nearly all.
        """
        frame = decode(effect.header, effect.payload)
        if not isinstance(frame, Content):
            return False
        sound = frame.route == 1
        self.sends[frame.route, frame.seq] += 1
        mixed = frame.seq * 7 + self.sends[frame.route, frame.seq] * 5
        return mixed % 3 == 0 if sound else mixed % 8 != 0

    def do(self, what: str, *args: Any) -> None:
        getattr(self, what)(*args)

    def publish(self, topic: str, count: int) -> None:
        for _ in range(count):
            self.count[topic] += 1
            self.net.publish("n0", topic, b"%s %d" % (topic.encode(), self.count[topic]))
        self.net.flow()

    def later(self, ms: int) -> None:
        self.net.pass_time(ms * MS)

    def fails(self) -> None:
        assert self.receiver.receiver is not None
        publishers = self.receiver.receiver.publishers
        for handle in [handle for handle, one in publishers.items() if one.topic == "/r/ill"]:
            del publishers[handle]
            self.net.tell_receiver(self.receiver, "publisher_failed", handle, "broken")

    def changes(self, number: int) -> None:
        if self.ill != "absent":
            kind = TopicType("pkg/msg/T", f"RIHS01_{number}")
            self.net.topic("n0", "/ill", SeenTopic(kind, Qos(depth=number)))
            self.net.flow()

    def goes(self) -> None:
        if self.ill != "absent":
            self.net.topic("n0", "/ill", None)
            self.net.flow()

    def matches(self, sound: bool) -> None:
        assert self.receiver.receiver is not None
        topic = "/r/sound" if sound else "/r/ill"
        for handle, one in list(self.receiver.receiver.publishers.items()):
            if one.topic == topic:
                self.net.tell_receiver(self.receiver, "matched", handle, 1, 1)

    def sound_ones(self) -> list[Published]:
        return [one for one in self.net.published if one.topic == "/r/sound"]


@seeded
@often
@given(
    happens=st.lists(troubles, max_size=40),
    modes=st.tuples(st.sampled_from(Mode), st.sampled_from(Mode)),
    shape=st.tuples(shapes, shapes),
)
def test_whatever_happens_to_one_route_the_others_publish_the_same_at_the_same_time(
    happens: list[tuple[Any, ...]], modes: tuple[Mode, Mode], shape: tuple[Shaping, Shaping]
) -> None:
    outcomes = []
    for ill in ("absent", "denied", "there"):
        ward = Ward(modes, shape, ill)
        for one in happens:
            ward.do(*one)
        ward.later(5000)
        outcomes.append(ward.sound_ones())
    assert outcomes[0] == outcomes[1] == outcomes[2]
