"""Several forwarders and two republishers on one conduit, with every fault and every cap at once.

Each republisher follows fewer forwarders than there are, so that they give way to each other when
they have been silent. The oracle knows what each forwarder took, and checks each publication of
either republisher; in the end everything is healed, and whoever is followed is heard.

    BEACON_MACHINE_SEED=7 pytest tests/property/test_relay_many.py       another run than usual
    BEACON_RELAY_STEPS=100000 pytest tests/property/test_relay_many.py   as long as in CI
"""

from __future__ import annotations

import os
from collections import Counter

import attrs
import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from beacon_core.relay.effects import CreatePublisher, Publish, Send, Subscribe
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import CONTENT, HEAD
from beacon_core.relay.ledger import Fate
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode, Qos, TopicType
from tests.property.relay_net import MS, End, Net
from tests.property.running import run

STEPS = int(os.environ.get("BEACON_RELAY_STEPS", "10000")) // 20
STEPS_PER_RUN = 100
SOURCES, SINKS = 3, 2
TOPICS = ["/ordered", "/latest", "/best", "/state"]
MODES = dict(zip(TOPICS, (Mode.ORDERED, Mode.LATEST, Mode.BEST_EFFORT, Mode.STATE), strict=True))

met: Counter[str] = Counter()


@attrs.frozen
class Taken:
    """A message that a forwarder has numbered."""

    origin: int
    epoch: int
    route: int
    seq: int
    at_ns: int
    topic: str
    type: TopicType


class Life:
    """One life of a republisher, as the oracle sees it."""

    def __init__(self, began_ns: int) -> None:
        self.began_ns = began_ns
        self.published: set[bytes] = set()
        self.last: dict[tuple[int, str], tuple[int, int, int]] = {}


class Many(Net):
    """The network of forwarder ``s0`` is ``n0``, and so on; those of republishers are others."""

    def __init__(
        self, forwarding: Forwarding, republishing: Republishing, shaping: Shaping, origins: int
    ) -> None:
        super().__init__(tells=True)
        self.forwarding, self.shaping = forwarding, shaping
        self.republishing = attrs.evolve(republishing, max_origins=origins)
        self.heard = self.check
        self.taken: dict[bytes, Taken] = {}
        self.first_sent_ns: dict[bytes, int] = {}
        self.ever: dict[str, set[bytes]] = {}
        self.lives: dict[str, Life] = {}
        self.born = 0
        self.serial = 0
        for at in range(SINKS):
            self.add(f"r{at}", f"m{at}", "c")
            self.ever[f"r{at}"] = set()
            self.start_sink(at)
        for at in range(SOURCES):
            self.add(f"s{at}", f"n{at}", "c")
            self.start_source(at)

    def start_source(self, at: int) -> None:
        self.born += 1
        names = NameMap(
            tuple(Rule(True, one, f"/r{one}", mode, self.shaping) for one, mode in MODES.items())
        )
        core = Forwarder(
            origin=at + 1,
            epoch=self.born,
            names=names,
            now_ns=self.now,
            settings=self.forwarding,
        )
        self.send_by(self.ends[f"s{at}"], core)

    def start_sink(self, at: int) -> None:
        self.born += 1
        core = Republisher(asker=self.born, now_ns=self.now, settings=self.republishing)
        self.lives[f"r{at}"] = Life(self.now)
        self.receive_by(self.ends[f"r{at}"], core)

    def message(self, end: End, subscribe: Subscribe, payload: bytes, first: int, hop: int) -> None:
        assert end.sender is not None
        route = next(r for r in end.sender.core.routes() if r.route == subscribe.handle)
        origin = int(end.name[1:]) + 1
        self.taken[payload] = Taken(
            origin,
            end.sender.core._epoch,
            subscribe.handle,
            route.next,
            self.now,
            subscribe.topic,
            subscribe.type,
        )
        super().message(end, subscribe, payload, first, hop)

    def spread(self, end: End, effect: Send) -> None:
        self.first_sent_ns.setdefault(effect.payload, self.now)
        super().spread(end, effect)

    def say(self, at: int, topic: str, size: int) -> bytes:
        self.serial += 1
        payload = self.serial.to_bytes(8, "little") * (1 + size // 8)
        self.publish(f"n{at}", topic, payload)
        return payload

    def check(self, end: End, publisher: CreatePublisher, effect: Publish) -> None:
        """Whole, of its type, once, in order, for whom it is said to be, and not of the past."""
        taken, life = self.taken[effect.payload], self.lives[end.name]
        assert (effect.first, effect.hop) == (taken.origin, 1)
        assert publisher.first == taken.origin
        assert (publisher.topic, publisher.type) == (f"/r{taken.topic}", taken.type)
        assert effect.payload not in life.published
        if taken.topic != "/state":
            assert effect.payload not in self.ever[end.name]
            # It may have waited; but what somebody before may have had is not shown.
            assert self.first_sent_ns[effect.payload] >= life.began_ns
        place, key = (taken.epoch, taken.route, taken.seq), (taken.origin, taken.topic)
        assert place > life.last.get(key, (0, 0, -1))
        life.last[key] = place
        life.published.add(effect.payload)
        self.ever[end.name].add(effect.payload)

    def check_books(self) -> None:
        for name, end in self.ends.items():
            if end.sender:
                source = end.sender.core.stats()
                assert source.entered == sum(source.fates.values()) + source.held
                assert source.held_bytes <= self.forwarding.hold_bytes
            if end.receiver:
                sink = end.receiver.core.stats()
                assert sink.entered == sum(sink.fates.values()) + sink.held + sink.missing
                assert min(sink.missing, sink.held_bytes) >= 0
                assert sink.fates.get(Fate.DELIVERED, 0) == len(self.lives[name].published)
                assert sink.origins <= self.republishing.max_origins

    def heal(self) -> None:
        for end in self.ends.values():
            if end.sender:
                self.tell_sender(end, "link_up")
            if end.receiver:
                self.tell_receiver(end, "link_up")
        self.pass_time(15_000 * MS)

    def check_healed(self) -> None:
        for name, end in self.ends.items():
            if end.receiver is None:
                continue
            sink = end.receiver.core.stats()
            assert sink.missing == sink.held == sink.held_bytes == sink.pending == 0
            met.update(str(fate) for fate in sink.fates)
            for origin in self.followed(end):
                self.check_heard(name, origin)

    def check_heard(self, name: str, origin: int) -> None:
        """What is published now by a forwarder that is followed, arrives."""
        source = self.ends[f"s{origin - 1}"].sender
        assert source is not None
        for topic in sorted(source.subscribed):
            self.pass_time(2000 * MS)
            before = source.core.stats().fates.get(Fate.OVERSIZE, 0)
            payload = self.say(origin - 1, topic, 0)
            self.pass_time(20 * MS)
            arrived = payload in self.lives[name].published
            assert arrived or source.core.stats().fates.get(Fate.OVERSIZE, 0) > before
            met["arrived"] += arrived

    def followed(self, end: End) -> list[int]:
        assert end.receiver is not None
        return sorted(end.receiver.core._peers)


sources, sinks = st.integers(0, SOURCES - 1), st.integers(0, SINKS - 1)
anybody = st.sampled_from([f"s{at}" for at in range(SOURCES)] + [f"r{at}" for at in range(SINKS)])
places = st.integers(0, 1000)


class Machine(RuleBasedStateMachine):
    has_given_way = False

    @initialize(
        hold=st.sampled_from([1500, 10**6]),
        sink_hold=st.sampled_from([500, 6000, 10**6]),
        gap=st.sampled_from([50 * MS, 1000 * MS]),
        origins=st.sampled_from([1, 2, 3]),
        forget=st.sampled_from([1200 * MS, 5000 * MS]),
        link=st.sampled_from([None, None, 50_000.0]),
        shaping=st.just(UNSHAPED)
        | st.builds(
            Shaping,
            rate_hz=st.none() | st.just(100.0),
            max_age_ns=st.none() | st.just(200 * MS),
            priority=st.integers(0, 7),
        ),
        everywhere=st.integers(0, len(TOPICS)),
    )
    def begin(
        self,
        hold: int,
        sink_hold: int,
        gap: int,
        origins: int,
        forget: int,
        link: float | None,
        shaping: Shaping,
        everywhere: int,
    ) -> None:
        self.net = Many(
            Forwarding(hold_bytes=hold, link_bytes_per_s=link),
            Republishing(hold_bytes=sink_hold, gap_ns=gap, forget_ns=forget, match_ns=0),
            shaping,
            origins,
        )
        for at in range(SOURCES):
            for topic in TOPICS[:everywhere]:
                self.net.topic(f"n{at}", topic, seen(1, 2))

    @rule(at=sources, topic=st.sampled_from(TOPICS), size=st.sampled_from([0, 200]))
    def publish(self, at: int, topic: str, size: int) -> None:
        for _ in range(4):
            self.net.say(at, topic, size)

    @rule(at=sources, topic=st.sampled_from(TOPICS), number=st.integers(1, 2))
    def a_topic_is_seen_or_changes(self, at: int, topic: str, number: int) -> None:
        self.net.topic(f"n{at}", topic, seen(number, 2))

    @rule(at=sources, topic=st.sampled_from(TOPICS), all_of_them=st.booleans())
    def topics_go(self, at: int, topic: str, all_of_them: bool) -> None:
        for one in TOPICS if all_of_them else [topic]:
            self.net.topic(f"n{at}", one, None)

    @rule()
    def all_frames_flow(self) -> None:
        self.net.flow()

    @rule(who=anybody, count=st.integers(1, 20))
    def some_frames_flow(self, who: str, count: int) -> None:
        for _ in range(count):
            self.net.deliver(self.net.ends[who])

    @rule(who=anybody, at=places, keep=st.booleans())
    def a_frame_overtakes_or_is_repeated(self, who: str, at: int, keep: bool) -> None:
        self.net.deliver(self.net.ends[who], at, keep=keep)

    @rule(who=anybody, at=places, count=st.integers(1, 9))
    def frames_are_lost(self, who: str, at: int, count: int) -> None:
        self.net.ends[who].inbox.lose(at, count)

    @rule(who=anybody, told=st.booleans())
    def somebody_is_cut_off(self, who: str, told: bool) -> None:
        end = self.net.ends[who]
        end.inbox.cut()
        if told:
            self.tell(end, "link_down")

    @rule(who=anybody)
    def somebody_hears_that_the_link_is_up(self, who: str) -> None:
        self.tell(self.net.ends[who], "link_up")

    def tell(self, end: End, method: str) -> None:
        if end.sender:
            self.net.tell_sender(end, method)
        else:
            self.net.tell_receiver(end, method)

    @rule(at=sources, ms=st.sampled_from([1000, 3000, 7000]))
    def a_forwarder_is_silent_and_comes_back(self, at: int, ms: int) -> None:
        origin = at + 1
        self.net.loses = lambda effect: HEAD.unpack_from(effect.header)[4] == origin
        self.net.pass_time(ms * MS)
        self.net.loses = lambda _: False

    @precondition(lambda self: not self.has_given_way)
    @rule(at=sources, restarted=st.booleans(), count=st.integers(1, 3), lingering=st.booleans())
    def a_forwarder_gives_way_and_comes_back_in_the_same_life(
        self, at: int, restarted: bool, count: int, lingering: bool
    ) -> None:
        # It takes a while: once in each run.
        self.has_given_way, net = True, self.net
        self.nobody_else_has_topics(at)
        forget_ns = net.republishing.forget_ns
        for sink in range(SINKS) if restarted else ():
            net.start_sink(sink)
        net.pass_time(forget_ns)
        self.hear_only(at, forget_ns)
        for topic in TOPICS:
            net.topic(f"n{at}", topic, seen(1, 2))
            for _ in range(count):
                net.say(at, topic, 0)
        net.pass_time(100 * MS)
        for topic in TOPICS:
            net.topic(f"n{at}", topic, None)
        # So long a topic's publisher stays; and so long a closed route can be asked for.
        net.pass_time(net.republishing.gap_ns + 50 * MS)
        net.loses = lambda effect: HEAD.unpack_from(effect.header)[4] == at + 1
        net.pass_time(forget_ns + 1000 * MS)
        if not lingering:
            net.pass_time(5000 * MS)
        self.hear_only(at, forget_ns + 1000 * MS)

    def nobody_else_has_topics(self, at: int) -> None:
        for end in self.net.ends.values():
            self.tell(end, "link_up")
        for one in {*range(SOURCES)} - {at}:
            for topic in TOPICS:
                self.net.topic(f"n{one}", topic, None)

    def hear_only(self, at: int, ns: int) -> None:
        """The other forwarders are silent for so long."""
        others = {one + 1 for one in range(SOURCES)} - {at + 1}
        self.net.loses = lambda effect: HEAD.unpack_from(effect.header)[4] in others
        self.net.pass_time(ns)
        self.net.loses = lambda _: False

    @rule(ms=st.sampled_from([1, 21, 100, 500, 2500, 6000]), flowing=st.booleans())
    def time_passes(self, ms: int, flowing: bool) -> None:
        self.net.pass_time(ms * MS, flowing=flowing)

    @rule(at=sources)
    def a_source_is_restarted(self, at: int) -> None:
        self.net.start_source(at)

    @rule(at=sinks)
    def a_sink_is_restarted(self, at: int) -> None:
        self.net.start_sink(at)

    @rule(at=sinks, which=places)
    def a_publisher_fails(self, at: int, which: int) -> None:
        end = self.net.ends[f"r{at}"]
        assert end.receiver is not None
        publishers = end.receiver.publishers
        if publishers:
            handle = sorted(publishers)[which % len(publishers)]
            del publishers[handle]
            self.net.tell_receiver(end, "publisher_failed", handle, "it broke")

    @rule(at=sinks, origin=st.integers(1, 20), route=st.integers(0, 9))
    def somebody_makes_up_a_content(self, at: int, origin: int, route: int) -> None:
        header = HEAD.pack(1, CONTENT, 0, 0, origin + SOURCES, 1, route, 0, 0, origin)
        self.net.tell_receiver(self.net.ends[f"r{at}"], "frame", header, b"made up")

    @invariant()
    def the_books_are_right(self) -> None:
        if hasattr(self, "net"):
            met["steps"] += 1
            self.net.check_books()

    def teardown(self) -> None:
        if hasattr(self, "net"):
            self.net.heal()
            self.net.check_books()
            self.net.check_healed()
            for end in self.net.ends.values():
                if end.receiver:
                    met["forgotten"] += bool(end.receiver.core._forgotten._of)


# ruff: noqa: FBT001 - rules get what is drawn for them, by name
def seen(number: int, depth: int) -> SeenTopic:
    return SeenTopic(TopicType("pkg/msg/T", f"RIHS01_{number}"), Qos(depth=depth))


@pytest.mark.timeout(1200)
def test_many_relays_on_one_conduit_mix_up_nothing() -> None:
    met.clear()
    try:
        run(Machine, runs=max(1, STEPS // STEPS_PER_RUN), steps_per_run=STEPS_PER_RUN)
    finally:
        print(f"{met['steps']} steps")  # noqa: T201
    assert met.keys() >= {"arrived", "forgotten"} or STEPS < 2500
