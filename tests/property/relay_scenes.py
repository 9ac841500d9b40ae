"""Short scenes for the relay's machine: what seldom comes about by single moves."""

from __future__ import annotations

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from beacon_core.relay.forwarding import RouteState
from beacon_core.relay.frames import Digest, Range, Reset, decode, encode
from beacon_core.relay.shaping import UNSHAPED
from tests.property.relay_world import MS, ORIGIN, World, seen

__all__ = ["Scenes"]

topics = st.sampled_from(["/ordered/a", "/ordered/b", "/latest/a", "/best/a", "/state/a"])
few = st.integers(0, 3)


# ruff: noqa: FBT001 - rules get what is drawn for them, by name
class Scenes(RuleBasedStateMachine):
    world: World

    def say(self, topic: str, count: int, size: int = 0) -> None:
        for _ in range(count):
            self.world.publish(topic, size)

    def another(self, topic: str) -> int | None:
        """A topic changes its type; its new route."""
        kind = self.world.topics.get(topic, seen(1)).type
        self.world.seen(topic, seen(2 if kind == seen(1).type else 1))
        return self.world.subscribed.get(topic)

    @rule(topic=topics, old=few, new=few, known=st.booleans(), live=st.booleans(), late=few)
    def a_route_is_overtaken_by_a_newer_one_of_its_topic(
        self, topic: str, old: int, new: int, known: bool, live: bool, late: int
    ) -> None:
        self.world.meet()
        before = self.world.subscribed.get(topic, 0)
        first = self.another(topic)
        self.world.deliver_those(before)
        if known:
            self.world.flow()
        self.say(topic, old)
        second = self.another(topic)
        self.say(topic, new)
        if first is None or second is None:
            return
        self.world.deliver_those(second)
        if live:
            self.world.match_all()
        self.say(topic, late)
        self.world.deliver_those(second)
        self.world.deliver_those(first)
        self.world.match_all()
        self.world.pass_time(50 * MS, flowing=True)

    @rule(topic=topics, restarted=st.booleans(), kept=st.booleans(), count=few)
    def frames_of_an_older_life_come_late(
        self, topic: str, restarted: bool, kept: bool, count: int
    ) -> None:
        world = self.world
        world.seen(topic, seen())
        world.meet()
        if restarted:
            world.start_sink()
        world.on_sink("link_up")
        while len(world.to_source):
            world.deliver_to_source()
        self.say(topic, count)
        frames = [world.to_sink.take(at, keep=True) for at in range(len(world.to_sink))]
        if not kept:
            world.to_sink.cut()
        world.start_source()
        world.meet()
        self.say(topic, count)
        world.pass_time(200 * MS, flowing=True)
        for frame in frames:
            assert frame is not None
            world.on_sink("frame", frame.header, frame.payload)
        self.say(topic, 1)
        world.pass_time(200 * MS, flowing=True)

    @rule(topic=topics, count=few, changes=st.booleans())
    def all_is_lost_for_a_while_and_then_nothing_is_said(
        self, topic: str, count: int, changes: bool
    ) -> None:
        self.world.meet()
        if changes:
            self.another(topic)
        self.say(topic, count)
        for _ in range(14):
            self.cut()
            self.world.pass_time(500 * MS)
        self.cut()
        self.world.pass_time(6000 * MS, flowing=True)
        self.world.check_known()

    def cut(self) -> None:
        self.world.to_sink.cut()
        self.world.to_source.cut()

    @rule(topic=topics, count=few)
    def digests_are_lost_and_what_they_would_have_told_is_known(
        self, topic: str, count: int
    ) -> None:
        world = self.world
        world.seen(topic, seen())
        world.meet()
        self.say(topic, count)
        world.pass_time(6000 * MS, flowing=True)
        sink, shape = world.sink.core, (world.shaping, world.forwarding.link_bytes_per_s)
        closed = any(one.state is RouteState.CLOSED for one in world.source.core.routes())
        stats = sink.stats()
        missing = stats.missing + stats.pending + stats.held + stats.frames.crowded
        if closed or missing or shape != (UNSHAPED, None):
            return
        self.say(topic, count)
        for _ in range(12):
            world.pass_time(500 * MS)
            self.lose_digests()
        world.pass_time(1000 * MS)
        before = world.sink.core._asking.greeting._last
        world.flow()
        assert world.sink.core._asking.greeting._last == before

    def lose_digests(self) -> None:
        """What else there is, gets through."""
        world = self.world
        for _ in range(len(world.to_sink)):
            frame = world.to_sink.take(keep=True)
            if frame is not None and isinstance(decode(frame.header, frame.payload), Digest):
                world.to_sink.lose(0)
            else:
                world.deliver_to_sink()

    @rule(topic=topics, before=few, count=st.integers(2, 9), part=st.sampled_from([2, 3, 5]))
    def a_gap_stays_while_later_messages_come(
        self, topic: str, before: int, count: int, part: int
    ) -> None:
        world = self.world
        world.seen(topic, seen())
        world.meet()
        self.say(topic, before)
        world.flow()
        self.say(topic, 1)
        world.to_sink.cut()
        pause_ns = min(world.republishing.gap_ns, 1000 * MS) // part
        for _ in range(count):
            self.say(topic, 1)
            while len(world.to_sink):
                world.deliver_to_sink()
            world.to_source.cut()
            world.pass_time(pause_ns)
            world.check_books()

    @rule(topic=topics, count=st.integers(2, 12), size=st.sampled_from([0, 200]))
    def what_was_lost_is_gone_when_it_is_asked_for(self, topic: str, count: int, size: int) -> None:
        world = self.world
        world.seen(topic, seen())
        world.meet()
        world.pass_time(60 * MS, flowing=True)
        self.say(topic, count, size)
        world.to_sink.lose(0, len(world.to_sink) - 1)
        world.pass_time(60 * MS, flowing=True)

    @rule(topic=topics, first=st.sampled_from([0, 3, ORIGIN]), hop=st.integers(0, 5))
    def a_message_that_relays_have_passed_on_comes(self, topic: str, first: int, hop: int) -> None:
        self.world.publish(topic, 8, first=first, hop=hop)

    @rule(topic=topics, beside=st.sampled_from([-1, 0, 1]), count=few)
    def all_is_asked_for_at_the_very_age(self, topic: str, beside: int, count: int) -> None:
        world = self.world
        self.say(topic, 1 + count)
        world.pass_time((world.shaping.max_age_ns or 25 * MS) + beside)
        route = world.subscribed.get(topic)
        if route is not None:
            low = world.source.core._routes[route].history.low
            ranges = (Range(route, max(0, low - 1), 200),)
            asked = Reset(ORIGIN, world.epoch, 99, ranges=ranges)
            world.on_source("frame", *encode(asked))

    @rule(
        some=st.lists(st.tuples(topics, st.integers(1, 40)), min_size=2, max_size=5),
        size=st.sampled_from([0, 200, 499]),
        ms=st.sampled_from([1, 30, 300]),
    )
    def more_comes_than_the_link_takes(
        self, some: list[tuple[str, int]], size: int, ms: int
    ) -> None:
        self.world.link()
        for topic, count in some:
            self.say(topic, count, size)
            self.world.pass_time(ms * MS)
        self.world.pass_time(300 * MS)

    @rule(topic=topics, count=st.integers(2, 30), changes=st.booleans())
    def a_topic_goes_while_its_messages_wait(self, topic: str, count: int, changes: bool) -> None:
        self.world.seen(topic, seen())
        self.world.meet()
        self.say(topic, count, 499)
        if changes:
            self.another(topic)
        else:
            self.world.gone(topic)
        self.world.pass_time(300 * MS, flowing=True)

    @precondition(lambda self: self.world.forwarding.link_bytes_per_s is not None)
    @rule(count=st.integers(60, 120))
    def all_classes_wait_behind_a_busy_one(self, count: int) -> None:
        world = self.world
        for topic in ("/ordered/a", "/ordered/b", "/latest/a", "/best/a", "/state/a"):
            world.seen(topic, seen())
        world.meet()
        world.pass_time(1000 * MS, flowing=True)
        self.say("/ordered/b", 3, 2000)  # so that nothing may go at once
        for topic in ("/ordered/b", "/ordered/a", "/latest/a", "/best/a"):
            self.say(topic, count if topic == "/ordered/a" else 3)
        world.pass_time(500 * MS, flowing=True)
