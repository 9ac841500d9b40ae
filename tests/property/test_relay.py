"""Both sides of the relay, with every fault and every cap at once.

One machine draws messages, topics that come, go and change their type or quality of service, frames
that are lost, repeated and overtaken, links that break, sides being restarted, publishers that
cannot be made, subscriptions that match late, hostile bytes, time that passes or jumps, and caps
and rates from next to nothing to plenty. The oracle (relay_world.py) sees all that is sent, checks
each publication and, after each step, the books of both sides. In the end everything is healed:
then all that was announced must have ended, and new messages must arrive.

    BEACON_MACHINE_SEED=7 pytest tests/property/test_relay.py       another run than usual
    BEACON_RELAY_STEPS=100000 pytest tests/property/test_relay.py   as long as in CI
"""

from __future__ import annotations

import os
import random
from collections import Counter

import attrs
import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    initialize,
    invariant,
    rule,
)

from beacon_core.relay.effects import Send
from beacon_core.relay.frames import Content, Digest, Malformed, Range, Reset, decode, encode
from beacon_core.relay.ledger import Fate
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.shaping import UNSHAPED, Shaping
from tests.property.relay_scenes import Scenes
from tests.property.relay_world import MS, ORIGIN, World, seen
from tests.property.running import run

STEPS = int(os.environ.get("BEACON_RELAY_STEPS", "10000")) * 19 // 20
# The others are those of test_relay_many.py and test_relay_rings.py, which cost more each.
STEPS_PER_RUN = 100

TOPICS = ["/ordered/a", "/ordered/b", "/latest/a", "/best/a", "/state/a", "/twin", "/denied"]
FOREVER = 10**18
met: Counter[str] = Counter()

topics = st.sampled_from(TOPICS)
places = st.integers(0, 1000)


# ruff: noqa: FBT001 - rules get what is drawn for them, by name
class Machine(Scenes):
    @initialize(
        hold=st.sampled_from([500, 1500, 6000, 10**6]),
        sink_hold=st.sampled_from([0, 500, 1500, 6000, 10**6]),
        largest=st.sampled_from([16, 500, 3000]),
        routes=st.sampled_from([1, 3, 20]),
        gap=st.sampled_from([50 * MS, 1000 * MS, FOREVER]),
        match=st.sampled_from([0, 500 * MS]),
        delay=st.sampled_from([None, None, 0, 3000 * MS]),
        window=st.sampled_from([1, 3, 64]),
        first=st.integers(0, len(TOPICS)),
        link=st.sampled_from([None, None, 50_000.0]),
        shaping=st.just(UNSHAPED)
        | st.builds(
            Shaping,
            st.none() | st.sampled_from([5.0, 100.0]),
            st.none() | st.just(50_000.0),
            st.none() | st.sampled_from([30 * MS, 5000 * MS]),
        ),
        priorities=st.just([0, 0, 0, 0])
        | st.lists(st.sampled_from([0, 1, 6, 7]), min_size=4, max_size=4),
        jostling=st.sampled_from([0, 0, 0, 0, 0, 0, 1, -1]),
    )
    def begin(
        self,
        hold: int,
        sink_hold: int,
        largest: int,
        routes: int,
        gap: int,
        match: int,
        delay: int | None,
        window: int,
        first: int,
        link: float | None,
        shaping: Shaping,
        priorities: list[int],
        jostling: int,
    ) -> None:
        if jostling:
            # All there is room for, but the link: what waits, waits for who goes first.
            hold, largest, routes, link, shaping = 10**6, 3000, 20, 50_000.0, UNSHAPED
            # Upwards, in the order of the modes, or downwards: then /ordered/a goes first, of which
            # many can wait.
            priorities = sorted(priorities if any(priorities) else [0, 1, 6, 7])[::jostling]
            first = len(TOPICS)
        self.world = World(
            Forwarding(
                hold_bytes=hold,
                message_bytes=largest,
                max_routes=routes,
                link_bytes_per_s=link,
            ),
            Republishing(
                hold_bytes=sink_hold,
                max_routes=40,
                gap_ns=gap,
                match_ns=match,
                advertise_delay_ns=delay,
                ask_window=window,
            ),
            shaping,
            priorities,
        )
        for topic in TOPICS[:first]:
            self.world.seen(topic, seen())

    @rule(size=st.sampled_from([0, 8, 200]), count=st.integers(1, 9))
    def all_topics_are_published(self, size: int, count: int) -> None:
        for _ in range(count):
            for topic in TOPICS:
                self.world.publish(topic, size)

    @rule(topic=topics, size=st.sampled_from([0, 8, 200, 499, 2000, 4000]), count=st.integers(1, 9))
    def publish(self, topic: str, size: int, count: int) -> None:
        for _ in range(count):
            self.world.publish(topic, size)

    @rule(at=places)
    def a_message_of_a_subscription_that_has_ended_comes_late(self, at: int) -> None:
        self.world.publish_late(at)

    @rule(count=st.integers(1, 30))
    def frames_flow(self, count: int) -> None:
        for _ in range(count):
            self.world.deliver_to_sink()
            self.world.deliver_to_source()

    @rule()
    def all_frames_flow(self) -> None:
        self.world.flow()

    @rule(at=places, keep=st.booleans())
    def a_frame_overtakes_or_is_repeated(self, at: int, keep: bool) -> None:
        self.world.deliver_to_sink(at, keep=keep)

    @rule(at=places, keep=st.booleans())
    def a_question_overtakes_or_is_repeated(self, at: int, keep: bool) -> None:
        self.world.deliver_to_source(at, keep=keep)

    @rule(at=places, count=st.integers(1, 9), there=st.booleans())
    def frames_are_lost(self, at: int, count: int, there: bool) -> None:
        (self.world.to_sink if there else self.world.to_source).lose(at, count)

    @rule(there=st.booleans(), back=st.booleans(), told=st.booleans())
    def the_link_breaks(self, there: bool, back: bool, told: bool) -> None:
        if there:
            self.world.to_sink.cut()
        if back:
            self.world.to_source.cut()
        if told:
            self.world.on_source("link_down")
            self.world.on_sink("link_down")

    @rule(source=st.booleans())
    def a_side_hears_that_the_link_is_up(self, source: bool) -> None:
        if source:
            self.world.on_source("link_up")
        else:
            self.world.on_sink("link_up")

    @rule(topic=topics, number=st.integers(1, 2), depth=st.integers(1, 3))
    def a_topic_is_seen_or_changes(self, topic: str, number: int, depth: int) -> None:
        self.world.seen(topic, seen(number, depth=depth))

    @rule(topic=topics)
    def a_topic_goes(self, topic: str) -> None:
        self.world.gone(topic)

    @rule(matched=st.integers(0, 2))
    def subscriptions_match(self, matched: int) -> None:
        for handle in list(self.world.publishers):
            if handle in self.world.publishers:
                self.world.on_sink("matched", handle, matched, 1)

    @rule(broken=st.booleans())
    def publishers_can_be_made_or_not(self, broken: bool) -> None:
        self.world.broken_publishers = broken

    @rule(at=places)
    def a_publisher_fails(self, at: int) -> None:
        if self.world.publishers:
            handle = sorted(self.world.publishers)[at % len(self.world.publishers)]
            del self.world.publishers[handle]
            self.world.on_sink("publisher_failed", handle, "it broke")

    @rule(ms=st.sampled_from([1, 10, 21, 50, 100, 500, 1000, 2500, 6000]), flowing=st.booleans())
    def time_passes(self, ms: int, flowing: bool) -> None:
        self.world.pass_time(ms * MS, flowing=flowing)

    @rule(seconds=st.sampled_from([5, 100, 10**6]))
    def time_jumps(self, seconds: int) -> None:
        self.world.now += seconds * 1000 * MS
        self.world.tick()

    @rule()
    def the_source_is_restarted(self) -> None:
        self.world.start_source()

    @rule()
    def the_sink_is_restarted(self) -> None:
        self.world.start_sink()

    @rule(noise=st.binary(max_size=80), payload=st.binary(max_size=8))
    def noise_comes(self, noise: bytes, payload: bytes) -> None:
        if isinstance(decode(noise, payload), Malformed):
            self.world.on_sink("frame", noise, payload)
            self.world.on_source("frame", noise, payload)

    @rule(seed=st.integers(0, 2**32), there=st.booleans())
    def a_frame_is_spoilt(self, seed: int, there: bool) -> None:
        draw = random.Random(seed)  # noqa: S311
        frame = (self.world.to_sink if there else self.world.to_source).take(seed, keep=True)
        if frame is None:
            return
        header = bytearray(frame.header)
        header[draw.randrange(len(header))] = draw.randrange(256)
        spoilt = bytes(header[: draw.choice([len(header), draw.randrange(len(header))])])
        read = decode(spoilt, frame.payload)
        if isinstance(read, Malformed | Reset):
            self.world.on_source("frame", spoilt, frame.payload)
        if there and not_believed(read, self.world.epoch):
            self.world.on_sink("frame", spoilt, frame.payload)

    @rule(epoch=st.integers(0, 2**64 - 1), origin=st.sampled_from([1, 2, ORIGIN]), route=places)
    def somebody_makes_up_frames(self, epoch: int, origin: int, route: int) -> None:
        made_up = Content(origin, epoch, route, 3, 0, b"made up", origin)
        if not_believed(made_up, self.world.epoch):
            self.world.on_sink("frame", *encode(made_up))
        ranges = (Range(route % 9, route, 200), Range(route % 7, 0, 256))
        wanted = tuple(range(route % 50))
        asked = Reset(ORIGIN, self.world.epoch, 99, route, wanted=wanted, ranges=ranges)
        self.world.on_source("frame", *encode(asked))

    @invariant()
    def the_books_are_right(self) -> None:
        if hasattr(self, "world"):
            met["steps"] += 1
            self.world.check_books()

    def teardown(self) -> None:
        if hasattr(self, "world"):
            self.world.heal()
            self.world.check_books()
            self.world.check_healed()
            met.update(self.world.met)


def not_believed(frame: object, epoch: int) -> bool:
    """It is made up, and can be told from what is not."""
    if isinstance(frame, Malformed | Reset):
        return True
    if isinstance(frame, Digest) and frame.asker:
        return False
    assert hasattr(frame, "origin")
    assert hasattr(frame, "epoch")
    return bool(frame.origin != ORIGIN or frame.epoch > epoch)


@pytest.mark.timeout(1200)
def test_whatever_happens_no_message_is_lost_uncounted_repeated_or_out_of_order() -> None:
    met.clear()
    try:
        run(Machine, runs=max(1, STEPS // STEPS_PER_RUN), steps_per_run=STEPS_PER_RUN)
    finally:
        print(f"{met['steps']} steps")  # noqa: T201


# Each way in which the original relay fails, as what happens here.


def world(
    *, forwarding: Forwarding | None = None, republishing: Republishing | None = None
) -> World:
    return World(forwarding or Forwarding(), republishing or Republishing(match_ns=0))


def talk(here: World, ms: int = 500) -> None:
    here.pass_time(ms * MS, flowing=True)


def publications(here: World, topic: str, count: int) -> list[bytes]:
    some = [here.publish(topic, 8) for _ in range(count)]
    return [one for one in some if one is not None]


def in_time(here: World, payload: bytes, ms: int) -> bool:
    talk(here, ms)
    return payload in here.published


def test_a_restarted_source_is_followed_though_its_numbers_begin_again() -> None:
    here = world()
    here.seen("/ordered/a", seen())
    talk(here)
    first = publications(here, "/ordered/a", 3)
    talk(here)
    here.start_source()
    talk(here)
    second = publications(here, "/ordered/a", 3)
    talk(here)
    assert here.published == {*first, *second}


def test_a_restarted_sink_gets_a_silent_latched_topic_back_and_no_stale_volatile_data() -> None:
    here = world()
    here.seen("/state/a", seen(depth=2))
    here.seen("/ordered/a", seen())
    talk(here)
    state = publications(here, "/state/a", 4)
    publications(here, "/ordered/a", 4)
    talk(here, 3000)
    here.start_sink()
    talk(here, 2000)
    assert here.published == set(state[-2:])


def test_a_lost_advertisement_and_a_lost_reset_are_repaired_within_two_seconds() -> None:
    here = world()
    talk(here)
    here.seen("/ordered/a", seen())
    here.to_sink.cut()
    (payload,) = publications(here, "/ordered/a", 1)
    here.deliver_to_sink()
    assert len(here.to_source)
    here.to_source.cut()
    assert in_time(here, payload, 2000)


def test_a_lost_advertisement_of_a_topic_that_says_nothing_is_repaired_too() -> None:
    here = world()
    talk(here)
    here.seen("/ordered/a", seen())
    here.to_sink.cut()
    talk(here, 2000)
    assert [one.topic for one in here.publishers.values()] == ["/r/ordered/a"]


def test_what_waits_for_an_advertisement_is_capped_and_comes_all_the_same() -> None:
    here = world(republishing=Republishing(match_ns=0, hold_bytes=5000))
    talk(here)
    here.seen("/ordered/a", seen())
    here.to_sink.cut()
    payloads = publications(here, "/ordered/a", 5000)
    while len(here.to_sink):
        here.deliver_to_sink()
    assert here.sink.core.stats().held_bytes <= 5000
    here.to_source.cut()
    talk(here, 20_000)
    assert here.published == set(payloads)


def test_contents_that_are_repeated_or_out_of_order_are_published_once_and_in_order() -> None:
    here = world()
    here.seen("/ordered/a", seen())
    talk(here)
    payloads = publications(here, "/ordered/a", 3)
    for at, keep in ((0, True), (0, False), (1, False), (0, True), (0, False)):
        here.deliver_to_sink(at, keep=keep)
    assert here.published == set(payloads)


def test_the_bytes_of_one_type_are_never_published_as_another_though_all_overlap() -> None:
    here = world()
    here.seen("/ordered/a", seen(1))
    talk(here)
    old = publications(here, "/ordered/a", 2)
    here.seen("/ordered/a", seen(2))
    new = publications(here, "/ordered/a", 2)
    while len(here.to_sink):
        here.deliver_to_sink(len(here.to_sink) - 1)
    talk(here, 2000)
    assert here.published == {*old, *new}


def test_an_empty_message_and_a_large_one_arrive_whole() -> None:
    here = world()
    here.seen("/ordered/a", seen())
    talk(here)
    large = here.publish("/ordered/a", 200_000)
    assert large is not None
    here.taken[b""] = attrs.evolve(here.taken[large], seq=1)
    effects = here.source.call("message", here.subscribed["/ordered/a"], b"", here.now)
    here.given += 1
    for effect in effects:
        assert isinstance(effect, Send)
        here.sent(effect)
    talk(here)
    assert here.published == {large, b""}


def test_one_topics_wait_does_not_make_another_late() -> None:
    here = world(republishing=Republishing(match_ns=0, advertise_delay_ns=3000 * MS))
    talk(here)
    firsts = []
    for topic in ("/ordered/a", "/ordered/b", "/best/a"):
        here.seen(topic, seen())
        firsts += publications(here, topic, 1)
        talk(here, 900)
    assert here.published == set()
    for count in (1, 2, 3):
        talk(here, 1000)
        assert here.published == set(firsts[:count])


def test_the_first_message_of_a_new_topic_is_published_as_soon_as_its_subscriber_matches() -> None:
    here = world(republishing=Republishing(match_ns=10_000 * MS))
    talk(here)
    here.seen("/ordered/a", seen())
    (payload,) = publications(here, "/ordered/a", 1)
    talk(here, 300)
    assert payload not in here.published
    here.match_all()
    assert payload in here.published


def test_nothing_of_the_first_thousand_is_lost_whoever_starts_first() -> None:
    here = world(republishing=Republishing())
    here.start_source()
    here.seen("/ordered/a", seen())
    payloads = []
    for _ in range(1000):
        payloads += publications(here, "/ordered/a", 1)
        talk(here, 1)
    talk(here, 2000)
    assert here.published == set(payloads)


def test_an_outage_within_the_cap_loses_nothing_and_beyond_it_exactly_what_is_counted() -> None:
    for hold, lost in ((10**7, 0), (50 * 416, 150)):
        here = world(forwarding=Forwarding(hold_bytes=hold))
        here.seen("/ordered/a", seen())
        talk(here)
        payloads = publications(here, "/ordered/a", 200)
        here.to_sink.cut()
        talk(here, 14_000)
        assert len(here.published) == len(payloads) - lost
        assert here.sink.core.stats().fates.get(Fate.EVICTED, 0) == lost


def test_a_buffer_overrun_and_a_restart_together_hide_nothing() -> None:
    here = world(forwarding=Forwarding(hold_bytes=2 * 416))
    here.seen("/ordered/a", seen())
    talk(here)
    publications(here, "/ordered/a", 9)
    here.to_sink.cut()
    here.start_source()
    new = publications(here, "/ordered/a", 2)
    talk(here, 3000)
    assert here.published >= set(new)
