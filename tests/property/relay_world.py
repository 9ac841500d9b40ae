"""Two sides of a relay, the networks beside them, and an oracle that sees all that is sent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs

from beacon_core.relay.effects import (
    Arm,
    CreatePublisher,
    DestroyPublisher,
    Publish,
    Send,
    Subscribe,
    Unsubscribe,
)
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import RouteState, SeenTopic
from beacon_core.relay.frames import CONTENT, KIND_AT, Advertisement, Content, Digest, decode
from beacon_core.relay.lane import LaneState
from beacon_core.relay.ledger import Fate
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode, Qos, TopicType
from beacon_fake.conduit import FakeConduit
from tests.property.relay_parts import MS, ORIGIN, Recorder, Taken, names
from tests.property.relay_watch import Watch

__all__ = ["MS", "ORIGIN", "World", "seen"]


HEAL_TURNS = 400
"""Of half a second: routes of one topic follow each other, each with a publisher that may have to
wait for 3 s."""


class World:
    """The oracle checks each publication as it is made."""

    def __init__(
        self,
        forwarding: Forwarding,
        republishing: Republishing,
        shaping: Shaping = UNSHAPED,
        priorities: Sequence[int] = (0, 0, 0, 0),
    ) -> None:
        self.forwarding, self.republishing = forwarding, republishing
        self.shaping, self.names = shaping, names(shaping, priorities)
        self.now = 1_000_000 * MS
        self.to_sink, self.to_source = FakeConduit(), FakeConduit()
        self.topics: dict[str, SeenTopic] = {}
        self.expected = 1
        self.broken_publishers = False
        self.taken: dict[bytes, Taken] = {}
        self.first_sent_ns: dict[bytes, int] = {}
        self.ever_published: set[bytes] = set()
        self.serial = 0
        self.epoch = 0
        self.asker = 0
        self.met: set[str] = set()
        self.joined: int | None = None
        self.state_then: dict[int, range] = {}
        # By route: the state that there was when the sink came.
        self.start_sink()
        self.start_source()

    # -- lives

    def start_source(self) -> None:
        self.epoch += 1
        epoch, now = self.epoch, self.now

        def make() -> Forwarder:
            return Forwarder(
                origin=ORIGIN, epoch=epoch, names=self.names, now_ns=now, settings=self.forwarding
            )

        self.source = Recorder(make)
        self.watch = Watch(self.source.core, (ORIGIN, epoch), self.forwarding, self.shaping)
        self.source_due: int | None = None
        self.paid_ns = 0.0
        self.given = 0
        self.joined = None
        self.routes: dict[int, Subscribe] = {}
        self.subscribed: dict[str, int] = {}
        self.on_source("link_up")
        for topic, seen in sorted(self.topics.items()):
            self.on_source("topic_seen", topic, seen)

    def start_sink(self) -> None:
        self.asker += 1
        asker, now = self.asker, self.now

        def make() -> Republisher:
            return Republisher(asker=asker, now_ns=now, settings=self.republishing)

        self.sink = Recorder(make)
        self.sink_due: int | None = None
        self.sink_began = self.now
        self.sink_epoch = -1
        self.standing: dict[tuple[int, int, int], int] = {}
        # By epoch, route and number: since when it stands still there.
        self.joined = None
        self.publishers: dict[int, CreatePublisher] = {}
        self.published: set[bytes] = set()
        self.last: dict[str, tuple[int, int, int]] = {}
        self.on_sink("link_up")

    # -- what happens

    def on_source(self, method: str, *args: Any) -> None:
        if method.startswith("link"):
            self.source_linked = method == "link_up"
        owed = self.watch.owed(args[0], args[1], self.now) if method == "frame" else set()
        effects = self.source.call(method, *args, self.now)
        if method == "frame":
            self.watch.answers(effects, owed, self.now)
        for effect in effects:
            match effect:
                case Send():
                    self.sent(effect)
                case Subscribe():
                    self.routes[effect.handle] = effect
                    self.subscribed[effect.topic] = effect.handle
                case Unsubscribe():
                    topic = self.routes[effect.handle].topic
                    del self.subscribed[topic]
                case Arm():
                    self.source_due = effect.due_ns
                case _:
                    raise AssertionError(effect)
        if method.startswith("link"):
            self.watch.linked(up=self.source_linked)
        self.watch.settled()

    def on_sink(self, method: str, *args: Any) -> None:
        if method.startswith("link"):
            self.sink_linked = method == "link_up"
        fresh = []
        for effect in self.sink.call(method, *args, self.now):
            match effect:
                case Send():
                    self.to_source.send(effect.header, effect.payload)
                case CreatePublisher():
                    assert effect.handle not in self.publishers
                    assert all(p.topic != effect.topic for p in self.publishers.values())
                    self.publishers[effect.handle] = effect
                    fresh.append(effect.handle)
                case DestroyPublisher():
                    del self.publishers[effect.handle]
                case Publish():
                    self.check(effect)
                case Arm():
                    self.sink_due = effect.due_ns
                case _:
                    raise AssertionError(effect)
        peer = self.sink.core._peers.get(ORIGIN)
        if self.joined is None and peer is not None and peer.epoch == self.epoch:
            self.joined = self.serial
            self.state_then = self.state_told(args)
        self.watch_sink()
        self.break_publishers(fresh)

    def watch_sink(self) -> None:
        """A life that is over does not come back; and who stands still, does since then."""
        peer = self.sink.core._peers.get(ORIGIN)
        assert peer is None or peer.epoch >= self.sink_epoch
        standing: dict[tuple[int, int, int], int] = {}
        if peer is not None:
            self.sink_epoch = peer.epoch
            for lane in peer.lanes.values():
                track = lane.head
                if (
                    self.sink_linked
                    and lane.state is LaneState.LIVE
                    and track is not None
                    and track.cursor < track.next
                    and track.advertised.epoch == peer.epoch
                    and track.advertised.route not in peer.patient
                ):
                    place = (peer.epoch, track.advertised.route, track.cursor)
                    standing[place] = self.standing.get(place, self.now)
        self.standing = standing

    def break_publishers(self, fresh: list[int]) -> None:
        for handle in fresh:
            if self.broken_publishers and handle in self.publishers:
                del self.publishers[handle]
                self.on_sink("publisher_failed", handle, "no such type")

    def publish(self, topic: str, size: int, *, first: int = 0, hop: int = 0) -> bytes | None:
        """A message on the source's network; its bytes if the forwarder numbered it."""
        self.serial += 1
        payload = self.serial.to_bytes(8, "little") * (size // 8 + 1)
        number = self.subscribed.get(topic, 0)
        route = self.source.core._routes.get(number)
        before = 0 if route is None else route.history.next
        self.given += 1
        effects = self.source.call("message", number, payload, self.now, first=first, hop=hop)
        numbered = route is not None and route.history.next > before
        if numbered:
            assert first != ORIGIN
            assert hop < self.forwarding.max_hops
            aged = topic not in ("/ordered/b", "/twin") and self.shaping.max_age_ns is not None
            name, kind, mode = route.ruling.name, self.topics[topic].type, route.mode
            self.taken[payload] = Taken(
                self.epoch, number, before, self.now, name, kind, mode, aged, first or ORIGIN, hop
            )
            self.watch.took(number, before)
        for effect in effects:
            assert isinstance(effect, Send | Arm)
            if isinstance(effect, Send):
                assert numbered or effect.payload != payload
                self.sent(effect)
            else:
                self.source_due = effect.due_ns
        self.watch.settled()
        return payload if numbered else None

    def publish_late(self, at: int) -> None:
        """A message of a subscription that has ended: nobody may take it for the topic's own."""
        ended = sorted(self.routes.keys() - self.subscribed.values())
        if ended:
            self.given += 1
            self.serial += 1
            payload = b"late" + self.serial.to_bytes(8, "little")
            self.on_source("message", ended[at % len(ended)], payload)

    def seen(self, topic: str, seen: SeenTopic) -> None:
        self.topics[topic] = seen
        self.on_source("topic_seen", topic, seen)

    def gone(self, topic: str) -> None:
        self.topics.pop(topic, None)
        self.on_source("topic_gone", topic)

    def deliver_to_sink(self, at: int = 0, *, keep: bool = False) -> None:
        if (frame := self.to_sink.take(at, keep=keep)) is not None:
            self.on_sink("frame", frame.header, frame.payload)

    def deliver_to_source(self, at: int = 0, *, keep: bool = False) -> None:
        if (frame := self.to_source.take(at, keep=keep)) is not None:
            self.on_source("frame", frame.header, frame.payload)

    def deliver_those(self, route: int) -> None:
        """Frames of one route overtake all others."""
        at = 0
        while at < len(self.to_sink):
            frame = self.to_sink.take(at, keep=True)
            assert frame is not None
            read = decode(frame.header, frame.payload)
            if isinstance(read, Advertisement | Content) and read.route == route:
                self.deliver_to_sink(at)
            else:
                at += 1

    def flow(self) -> None:
        """All that is under way gets through, and what follows from it."""
        for _ in range(200_000):
            if not len(self.to_sink) + len(self.to_source):
                return
            self.deliver_to_sink()
            self.deliver_to_source()
        raise AssertionError("they never stop talking")

    def match_all(self) -> None:
        for handle in list(self.publishers):
            if handle in self.publishers:
                self.on_sink("matched", handle, self.expected, self.expected)

    def pass_time(self, ns: int, *, flowing: bool = False) -> None:
        """Let time pass; ticks come when they are due."""
        until = self.now + ns
        for _ in range(100_000):
            if flowing:
                self.flow()
            dues = [due for due in (self.source_due, self.sink_due) if due is not None]
            self.now = max(self.now, min([until, *dues]))
            self.tick()
            if self.now >= until:
                return
        raise AssertionError("time stands still")

    def tick(self) -> None:
        if self.source_due is not None and self.source_due <= self.now:
            self.on_source("tick")
            assert self.source_due is None or self.source_due > self.now
        if self.sink_due is not None and self.sink_due <= self.now:
            self.on_sink("tick")
            assert self.sink_due is None or self.sink_due > self.now

    # -- what must hold

    def sent(self, effect: Send) -> None:
        """Each frame of the source: nothing in it is too old."""
        if self.shaping.max_age_ns is not None:
            taken = self.taken.get(effect.payload)
            assert taken is None or not taken.aged or self.is_fresh(taken)
        rate = self.forwarding.link_bytes_per_s
        if rate is not None:
            size = len(effect.header) + len(effect.payload)
            # A content goes only while all before it is paid for, but for a tenth of a second.
            assert effect.header[KIND_AT] != CONTENT or self.paid_ns <= self.now + 100 * MS + 1
            self.paid_ns = max(self.paid_ns, self.now) + size / rate * 1e9
        self.watch.sent(effect, self.now)
        self.first_sent_ns.setdefault(effect.payload, self.now)
        self.to_sink.send(effect.header, effect.payload)

    def is_fresh(self, taken: Taken) -> bool:
        assert self.shaping.max_age_ns is not None
        return self.now < taken.at_ns + self.shaping.max_age_ns

    def state_told(self, args: tuple[Any, ...]) -> dict[int, range]:
        """What of state topics whoever comes late is to have first, by the answer to its hello."""
        answer = decode(*args[:2])
        assert isinstance(answer, Digest)
        depths = {
            route: one.qos.depth
            for route, one in self.routes.items()
            if one.topic.startswith("/state")
        }
        return {
            one.route: range(max(one.low, one.next - depths[one.route]), one.next)
            for one in answer.entries
            if one.route in depths
        }

    def check(self, effect: Publish) -> None:
        """Each publication: whole, of its type, not again, in order, and not of the past."""
        taken = self.taken[effect.payload]
        publisher = self.publishers[effect.handle]
        assert publisher.type == taken.type
        assert publisher.topic == taken.name
        assert (effect.first, effect.hop) == (taken.first, taken.hop + 1)
        assert effect.payload not in self.published
        if taken.mode is not Mode.STATE:
            assert effect.payload not in self.ever_published
            # It may have waited; but what somebody before may have had is not shown.
            assert self.first_sent_ns[effect.payload] >= self.sink_began
        place = (taken.epoch, taken.route, taken.seq)
        assert place > self.last.get(taken.name, (0, 0, -1))
        is_old = self.first_sent_ns[effect.payload] < self.sink_began
        if is_old and taken.epoch == self.epoch:
            # Whoever comes late gets the last of the state, and nothing else of before.
            self.met.add("state of before")
            assert taken.seq in self.state_then[taken.route] or taken.seq >= (
                self.state_then[taken.route].stop
            )
        self.last[taken.name] = place
        self.published.add(effect.payload)
        self.ever_published.add(effect.payload)

    def check_books(self) -> None:
        self.watch.check()
        self.met |= self.watch.met
        patience_ns = self.republishing.gap_ns
        assert all(self.now < since + patience_ns for since in self.standing.values())
        source, sink = self.source.core.stats(), self.sink.core.stats()
        assert source.entered == self.given == sum(source.fates.values()) + source.held
        assert source.held_bytes <= self.forwarding.hold_bytes
        assert source.routes <= self.forwarding.max_routes
        assert sink.entered == sum(sink.fates.values()) + sink.held + sink.missing
        assert sink.missing >= 0
        assert sink.fates.get(Fate.DELIVERED, 0) == len(self.published)
        # Of a LATEST route, one content is held whatever the cap is.
        latest = len(self.publishers) * 3000
        assert 0 <= sink.held_bytes <= self.republishing.hold_bytes + latest
        if not sink.held + sink.pending:
            assert sink.held_bytes == 0
        self.met |= {f"sink {fate}" for fate in sink.fates}
        self.met |= {f"source {fate}" for fate in source.fates}
        self.met |= {f"frames {k}" for k, v in attrs.asdict(sink.frames).items() if v}
        self.met |= {f"lane {one.state}" for one in self.sink.core.lanes()}

    def heal(self) -> None:
        """Nothing fails any more, for long enough."""
        self.broken_publishers = False
        self.link()
        for turn in range(HEAL_TURNS):
            self.flow()
            self.match_all()
            self.pass_time(500 * MS, flowing=True)
            sink = self.sink.core.stats()
            # Each new publisher of a topic may have to wait for seconds, one after the other.
            waits = any(one.state is LaneState.WAIT_MATCH for one in self.sink.core.lanes())
            if turn > 40 and not waits and not sink.missing + sink.held + sink.pending:
                return

    def link(self) -> None:
        """A side that was not told of an outage must find out by itself what it has missed."""
        if not self.source_linked:
            self.on_source("link_up")
        if not self.sink_linked:
            self.on_sink("link_up")

    def meet(self) -> None:
        """The two sides know each other, and what can match does."""
        self.link()
        self.flow()
        self.pass_time(150 * MS, flowing=True)
        self.match_all()

    def check_known(self) -> None:
        """The sink knows each route, and how far it has come."""
        peer, routes = self.sink.core._peers.get(ORIGIN), self.source.core._routes
        if self.sink.core.stats().frames.crowded:
            return
        assert peer is not None
        assert peer.epoch == self.epoch
        assert {number: peer.known[number].next for number in routes if number in peer.known} == {
            number: one.told_next for number, one in routes.items()
        }

    def check_healed(self) -> None:
        """All that was announced has ended, and what is published now arrives at once."""
        sink = self.sink.core.stats()
        assert sink.missing == sink.held == sink.held_bytes == sink.pending == 0
        self.check_known()
        self.check_losses()
        for status in self.source.core.routes():
            if status.state is RouteState.OPEN:
                payload = self.publish(status.topic, 0)
                assert payload is None or self.arrives(payload), status
        if self.serial % 4 == 0:
            # It costs as much as the run itself.
            for recorder in (self.source, self.sink):
                assert recorder.replays_alike()

    def check_losses(self) -> None:
        """What came after the sink had joined was published, or is in the sink's books as lost."""
        if self.joined is None:
            return
        there = {one.route for one in self.source.core.routes()}
        lost = [
            taken
            for payload, taken in self.taken.items()
            if taken.epoch == self.epoch
            and taken.route in there
            and int.from_bytes(payload[:8], "little") > self.joined
            and payload not in self.published
        ]
        sink = self.sink.core.stats()
        if sink.frames.crowded:
            return
        assert len(lost) <= sink.entered - sink.fates.get(Fate.DELIVERED, 0)
        self.check_state()
        patient = (
            self.republishing.gap_ns > 10**12
            and self.forwarding.hold_bytes >= 10**6
            and self.shaping.max_age_ns is None
        )
        if patient and Fate.REFUSED not in sink.fates:
            self.met.add("nothing ordered may be lost")
            assert not [one for one in lost if one.mode is Mode.ORDERED]

    def check_state(self) -> None:
        """If nothing was lost, whoever came late has all of the state that there was, exactly."""
        if self.sink.core.stats().fates.keys() - {Fate.DELIVERED}:
            return
        there = {one.route for one in self.source.core.routes()}
        published = {
            (taken.route, taken.seq)
            for payload, taken in self.taken.items()
            if taken.epoch == self.epoch and payload in self.published
        }
        for route, seqs in self.state_then.items():
            if route in there and self.routes[route].topic == "/state/a":
                self.met.add("exactly the state of before")
                assert {(route, seq) for seq in seqs} <= published

    def arrives(self, payload: bytes) -> bool:
        self.flow()
        self.match_all()
        self.pass_time(20 * MS, flowing=True)
        return payload in self.published


def seen(number: int = 1, *, depth: int = 3) -> SeenTopic:
    """A topic of one of several types."""
    return SeenTopic(TopicType("pkg/msg/T", f"RIHS01_{number}"), Qos(depth=depth))
