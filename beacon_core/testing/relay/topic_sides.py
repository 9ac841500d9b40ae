"""The conformance suite of topic sides: what every one, ours or a stranger's, is run through.

Make a subclass whose name pytest collects, and give it a harness::

    class TestMyTopicSide(TopicSideContract):
        def make_harness(self) -> TopicHarness:
            return MyHarness()

The other end is always a peer: a publisher or a subscription that knows nothing of the topic side.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import partial

import pytest

from beacon_core.ports.topic_side import TopicSide
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.values import Qos
from beacon_core.testing.harness import CLOSE_WITHIN_S, within
from beacon_core.testing.relay.topic_harness import (
    TopicHarness,
    Watching,
)
from beacon_core.testing.relay.topic_steps import (
    FIRST,
    RELIABLE,
    eventually,
    failed,
    heard_since,
    is_heard,
    is_matched,
    needs,
    new_publisher,
    nothing,
    received_since,
    seen_as,
    speak,
    subscribed,
    type_of,
)
from beacon_core.testing.waiting import wait_until

__all__ = ["TopicSideContract"]

_DURABLE = Qos(reliable=True, durable=True, depth=3)
_BEST_EFFORT = Qos(reliable=False, durable=False, depth=100)

_BODIES = {
    "empty": b"",
    "one byte": b"\0",
    "all byte values": bytes(range(256)),
    "1 MiB": bytes(range(256)) * 4096,
}

_OTHER_FIRST = 0xFEDC_BA98_7654_3210


class TopicSideContract:
    """Every check there is; each gets a new harness."""

    def make_harness(self) -> TopicHarness:
        """A harness with nothing on it yet."""
        raise NotImplementedError

    @pytest.fixture
    def harness(self) -> Iterator[TopicHarness]:
        harness = self.make_harness()
        try:
            yield harness
        finally:
            harness.close()

    @pytest.fixture
    def watching(self) -> Watching:
        return Watching()

    @pytest.fixture
    def side(self, harness: TopicHarness, watching: Watching) -> TopicSide:
        """Started."""
        side = harness.side()
        side.start(watching)
        return side

    # Topics

    @pytest.mark.usefixtures("side")
    def test_a_topic_is_seen_with_its_type_its_hash_and_its_qos(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        for number, qos in enumerate((RELIABLE, _BEST_EFFORT, _DURABLE)):
            harness.publisher(f"/topic_{number}", harness.types[0], qos)
            seen = seen_as(harness, watching, f"/topic_{number}")
            assert seen.type == harness.types[0]
            assert (seen.qos.reliable, seen.qos.durable) == (qos.reliable, qos.durable)
            assert seen.qos.depth >= 1

    def test_a_topic_that_was_there_before_is_seen(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        harness.publisher("/early", harness.types[0], RELIABLE)
        harness.side().start(watching)
        assert seen_as(harness, watching, "/early").type == harness.types[0]

    @pytest.mark.usefixtures("side")
    def test_a_subscription_alone_makes_no_topic(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        harness.subscription("/nobody_speaks", harness.types[0], RELIABLE)
        harness.publisher("/mark", harness.types[0], RELIABLE)
        seen_as(harness, watching, "/mark")
        assert "/nobody_speaks" not in watching.topics

    @pytest.mark.usefixtures("side")
    def test_a_topic_is_gone_with_its_last_publisher_and_not_before(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        peers = [harness.publisher("/topic", harness.types[0], RELIABLE) for _ in range(2)]
        seen_as(harness, watching, "/topic")
        peers[0].close()
        assert not wait_until(lambda: "/topic" not in watching.topics, harness.quiet_s)
        peers[1].close()
        eventually(harness, lambda: "/topic" not in watching.topics, "the topic is gone")

    @pytest.mark.usefixtures("side")
    def test_a_topic_is_gone_when_its_publisher_crashes(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        needs(harness, "detects_crash")
        peer = harness.publisher("/topic", harness.types[0], RELIABLE, mortal=True)
        seen_as(harness, watching, "/topic")
        harness.crash(peer)
        eventually(harness, lambda: "/topic" not in watching.topics, "the topic is gone")

    @pytest.mark.usefixtures("side")
    def test_a_change_of_type_is_told(self, harness: TopicHarness, watching: Watching) -> None:
        before, after = harness.types
        peer = harness.publisher("/topic", before, RELIABLE)
        assert seen_as(harness, watching, "/topic").type == before
        peer.close()
        harness.publisher("/topic", after, RELIABLE)
        eventually(harness, lambda: type_of(watching, "/topic") == after, "the new type is told")

    @pytest.mark.usefixtures("side")
    def test_a_change_of_qos_is_told(self, harness: TopicHarness, watching: Watching) -> None:
        harness.publisher("/topic", harness.types[0], RELIABLE)
        assert seen_as(harness, watching, "/topic").qos.reliable
        weaker = harness.publisher("/topic", harness.types[0], _BEST_EFFORT)
        eventually(
            harness,
            lambda: "/topic" in watching.topics and not watching.topics["/topic"].qos.reliable,
            "a best-effort publisher has come: no reliable subscription would hear it",
        )
        weaker.close()
        eventually(
            harness,
            lambda: "/topic" in watching.topics and watching.topics["/topic"].qos.reliable,
            "it has gone",
        )

    @pytest.mark.usefixtures("side")
    def test_a_topic_is_durable_only_if_all_its_publishers_are(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        harness.publisher("/topic", harness.types[0], _DURABLE)
        assert seen_as(harness, watching, "/topic").qos.durable
        harness.publisher("/topic", harness.types[0], RELIABLE)
        eventually(harness, lambda: not watching.topics["/topic"].qos.durable, "volatile now")

    @pytest.mark.usefixtures("side")
    def test_what_does_not_change_is_told_once(
        self, harness: TopicHarness, watching: Watching
    ) -> None:
        harness.publisher("/topic", harness.types[0], RELIABLE)
        seen_as(harness, watching, "/topic")
        harness.publisher("/other", harness.types[0], RELIABLE)
        seen_as(harness, watching, "/other")
        assert [topic for topic, _ in watching.tellings].count("/topic") == 1

    def test_what_the_side_publishes_itself_is_no_topic(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        side.create_publisher(new_publisher(harness, 1, "/ours"))
        eventually(harness, lambda: watching.last_match(1) is not None, "it is made")
        harness.publisher("/mark", harness.types[0], RELIABLE)
        seen_as(harness, watching, "/mark")
        assert not wait_until(lambda: "/ours" in watching.topics, harness.quiet_s)

    # Messages in

    @pytest.mark.parametrize("body", _BODIES.values(), ids=_BODIES)
    def test_a_message_arrives_byte_for_byte_with_its_stamp(
        self, harness: TopicHarness, side: TopicSide, watching: Watching, body: bytes
    ) -> None:
        peer = subscribed(harness, side, watching, 1, "/topic")
        peer.publish(harness.message(body))
        eventually(harness, lambda: heard_since(harness, watching), "the message comes")
        heard = heard_since(harness, watching)[0]
        assert heard.handle == 1
        assert heard.payload == harness.message(body)
        assert heard.stamp_ns > 0
        assert (heard.first, heard.hop) == (0, 0)

    def test_messages_arrive_all_and_in_order(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        peer = subscribed(harness, side, watching, 1, "/topic")
        sent = [harness.message(b"%d" % number) for number in range(50)]
        for payload in sent:
            peer.publish(payload)
        eventually(harness, lambda: len(heard_since(harness, watching)) >= 50, "all messages come")
        assert [one.payload for one in heard_since(harness, watching)] == sent

    def test_nothing_arrives_that_is_not_subscribed_to(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        silent = harness.publisher("/silent", harness.types[0], RELIABLE)
        seen_as(harness, watching, "/silent")
        silent.publish(harness.message(b"not asked for"))
        peer = subscribed(harness, side, watching, 1, "/topic")
        silent.publish(harness.message(b"not asked for"))
        peer.publish(harness.message(b"asked for"))
        eventually(
            harness,
            lambda: harness.message(b"asked for") in watching.payloads(1),
            "the message that was asked for comes",
        )
        assert harness.message(b"not asked for") not in [one.payload for one in watching.heard]

    def test_nothing_arrives_after_the_subscription_has_ended(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        ending = subscribed(harness, side, watching, 1, "/ending")
        staying = subscribed(harness, side, watching, 2, "/staying")
        side.unsubscribe(1)
        wait_until(lambda: False, harness.quiet_s / 3)
        told = len(watching.payloads(1))
        ending.publish(harness.message(b"late"))
        staying.publish(harness.message(b"mark"))
        eventually(
            harness, lambda: harness.message(b"mark") in watching.payloads(2), "the mark comes"
        )
        assert not wait_until(lambda: len(watching.payloads(1)) > told, harness.quiet_s)

    def test_a_topic_is_subscribed_again_after_its_type_has_changed(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        after, before = harness.types
        peer = harness.publisher("/topic", before, RELIABLE)
        seen_as(harness, watching, "/topic")
        side.subscribe(Subscribe(1, "/topic", before, RELIABLE))
        peer.close()
        eventually(harness, lambda: "/topic" not in watching.topics, "the old type is gone")
        side.unsubscribe(1)
        subscribed(harness, side, watching, 2, "/topic")
        assert watching.topics["/topic"].type == after

    def test_a_durable_subscription_hears_what_was_said_before(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "latches")
        peer = harness.publisher("/map", harness.types[0], _DURABLE)
        peer.publish(harness.message(b"latched"))
        seen_as(harness, watching, "/map")
        side.subscribe(Subscribe(1, "/map", harness.types[0], _DURABLE))
        eventually(
            harness, lambda: watching.payloads(1) == [harness.message(b"latched")], "it is told"
        )

    def test_what_the_side_publishes_does_not_come_back(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        peer = subscribed(harness, side, watching, 1, "/both")
        other = harness.subscription("/both", harness.types[0], RELIABLE)
        side.create_publisher(new_publisher(harness, 2, "/both"))
        is_matched(harness, watching, 2)
        side.publish(Publish(2, harness.message(b"ours"), 0, FIRST, 1))
        eventually(harness, lambda: harness.message(b"ours") in other.received(), "others hear it")
        peer.publish(harness.message(b"theirs"))
        eventually(
            harness, lambda: harness.message(b"theirs") in watching.payloads(1), "theirs comes"
        )
        assert harness.message(b"ours") not in watching.payloads(1)

    # Other relays

    def test_what_another_relay_publishes_comes_with_who_took_it_first_and_its_hops(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "tells_relays")
        other, others = harness.side(), Watching()
        other.start(others)
        other.create_publisher(new_publisher(harness, 1, "/relayed"))
        seen_as(harness, watching, "/relayed")
        side.subscribe(Subscribe(7, "/relayed", harness.types[0], RELIABLE))
        is_matched(harness, others, 1)
        for first, hop in ((FIRST, 1), (_OTHER_FIRST, 1), (FIRST, 2)):
            payload = harness.message(b"%x %d" % (first, hop))
            other.publish(Publish(1, payload, 0, first, hop))
        eventually(harness, lambda: len(watching.payloads(7)) == 3, "all three come")
        assert {(one.payload, one.first, one.hop) for one in watching.heard} == {
            (harness.message(b"%x %d" % pair), *pair)
            for pair in ((FIRST, 1), (_OTHER_FIRST, 1), (FIRST, 2))
        }

    def test_messages_of_one_publisher_stay_in_order_whoever_took_them_first(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        peer = harness.subscription("/mixed", harness.types[0], RELIABLE)
        side.create_publisher(new_publisher(harness, 1, "/mixed"))
        is_matched(harness, watching, 1)
        sent = [harness.message(b"%d" % number) for number in range(9)]
        for number, payload in enumerate(sent):
            first = (FIRST, FIRST, _OTHER_FIRST)[number % 3]
            side.publish(Publish(1, payload, 0, first, 1))
        eventually(harness, lambda: len(peer.received()) >= 9, "all messages come")
        assert peer.received() == sent

    # Publishers

    def test_a_publisher_that_nobody_hears_is_told_so(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        side.create_publisher(new_publisher(harness, 1, "/alone"))
        eventually(harness, lambda: watching.last_match(1) == (0, 0), "nobody is there")
        assert not watching.failures

    def test_who_matches_is_told_as_they_come_and_go(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        first = harness.subscription("/topic", harness.types[0], RELIABLE)
        side.create_publisher(new_publisher(harness, 1, "/topic"))
        eventually(harness, lambda: watching.last_match(1) == (1, 1), "one is there")
        second = harness.subscription("/topic", harness.types[0], _BEST_EFFORT)
        eventually(harness, lambda: watching.last_match(1) == (2, 2), "two are there")
        first.close()
        second.close()
        eventually(harness, lambda: watching.last_match(1) == (0, 0), "nobody is there any more")

    def test_a_subscription_that_wants_more_than_is_offered_is_not_expected(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        harness.subscription("/topic", harness.types[0], RELIABLE)
        harness.subscription("/topic", harness.types[0], _BEST_EFFORT)
        side.create_publisher(new_publisher(harness, 1, "/topic", _BEST_EFFORT))
        eventually(harness, lambda: watching.last_match(1) == (1, 1), "the modest one is there")
        assert not wait_until(lambda: watching.last_match(1) != (1, 1), harness.quiet_s)

    @pytest.mark.parametrize("body", _BODIES.values(), ids=_BODIES)
    def test_what_is_published_arrives_typed_and_intact(
        self, harness: TopicHarness, side: TopicSide, watching: Watching, body: bytes
    ) -> None:
        peer = harness.subscription("/topic", harness.types[0], RELIABLE)
        side.create_publisher(new_publisher(harness, 1, "/topic"))
        is_matched(harness, watching, 1)
        side.publish(Publish(1, harness.message(body), 0, FIRST, 1))
        eventually(harness, lambda: bool(peer.received()), "the message comes")
        assert peer.received() == [harness.message(body)]

    def test_a_durable_publisher_serves_who_comes_late_with_its_last_messages(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "latches")
        side.create_publisher(new_publisher(harness, 1, "/map", _DURABLE))
        eventually(harness, lambda: watching.last_match(1) is not None, "it is made")
        sent = [harness.message(b"%d" % number) for number in range(5)]
        for payload in sent:
            side.publish(Publish(1, payload, 0, FIRST, 1))
        late = harness.subscription("/map", harness.types[0], _DURABLE)
        eventually(harness, lambda: len(late.received()) >= 3, "the last three come")
        assert not wait_until(lambda: len(late.received()) > 3, harness.quiet_s)
        assert late.received() == sent[-3:]

    def test_a_publisher_that_cannot_be_made_is_told_with_a_reason(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "refuses_types")
        for handle, bad in enumerate(harness.bad_types, 1):
            side.create_publisher(CreatePublisher(handle, f"/topic_{handle}", bad, RELIABLE, 1))
            eventually(harness, partial(failed, watching, handle), f"{bad} is refused")
            assert len(dict(watching.failures)[handle]) > 10
            side.publish(Publish(handle, harness.message(b"x"), 0, FIRST, 1))
            side.destroy_publisher(handle)
        assert not watching.matches

    def test_a_refused_publisher_is_no_trouble_for_others(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "refuses_types")
        peer = harness.subscription("/topic", harness.types[0], RELIABLE)
        side.create_publisher(CreatePublisher(1, "/bad", harness.bad_types[0], RELIABLE, 1))
        side.create_publisher(new_publisher(harness, 2, "/topic"))
        is_matched(harness, watching, 2)
        side.publish(Publish(2, harness.message(b"fine"), 0, FIRST, 1))
        eventually(harness, lambda: peer.received() == [harness.message(b"fine")], "it comes")

    def test_what_was_published_goes_out_before_the_publisher_ends(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        needs(harness, "acknowledges")
        peer = harness.subscription("/topic", harness.types[0], RELIABLE)
        side.create_publisher(new_publisher(harness, 1, "/topic"))
        is_matched(harness, watching, 1)
        is_heard(harness, side, 1, peer)
        sent = [harness.message(b"%d" % number) for number in range(20)]
        for payload in sent:
            side.publish(Publish(1, payload, 0, FIRST, 1))
        within(CLOSE_WITHIN_S, lambda: side.destroy_publisher(1))
        eventually(harness, lambda: len(received_since(harness, peer)) >= 20, "all came")
        assert received_since(harness, peer) == sent

    def test_a_publisher_gives_way_to_one_of_another_type(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        known, other = harness.types
        side.create_publisher(CreatePublisher(1, "/topic", other, RELIABLE, FIRST))
        eventually(harness, lambda: watching.last_match(1) is not None, "the first is made")
        side.destroy_publisher(1)
        side.create_publisher(CreatePublisher(2, "/topic", known, RELIABLE, FIRST))
        peer = harness.subscription("/topic", known, RELIABLE)
        is_matched(harness, watching, 2)
        side.publish(Publish(2, harness.message(b"new"), 0, FIRST, 1))
        eventually(harness, lambda: peer.received() == [harness.message(b"new")], "it comes")
        assert not watching.failures

    # Closing

    def test_it_closes_in_time_twice_and_is_silent_afterwards(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        peer = subscribed(harness, side, watching, 1, "/topic")
        side.create_publisher(new_publisher(harness, 2, "/out"))
        eventually(harness, lambda: watching.last_match(2) is not None, "it is made")
        within(CLOSE_WITHIN_S, side.close)
        calls = watching.calls
        peer.publish(harness.message(b"late"))
        harness.publisher("/late", harness.types[0], RELIABLE)
        assert not wait_until(lambda: watching.calls > calls, harness.quiet_s)
        within(CLOSE_WITHIN_S, side.close)

    def test_it_closes_before_it_was_started(self, harness: TopicHarness) -> None:
        within(CLOSE_WITHIN_S, harness.side().close)

    def test_it_closes_in_the_middle_of_traffic(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        peer = subscribed(harness, side, watching, 1, "/topic")
        done = threading.Event()
        speaking = threading.Thread(target=speak, args=(peer, harness.message(b"x"), done))
        speaking.start()
        try:
            eventually(harness, lambda: len(watching.heard) > 20, "traffic flows")
            within(CLOSE_WITHIN_S, side.close)
            calls = watching.calls
            assert not wait_until(lambda: watching.calls > calls, harness.quiet_s)
        finally:
            done.set()
            speaking.join()

    def test_what_is_asked_after_the_end_is_no_mistake(
        self, harness: TopicHarness, side: TopicSide
    ) -> None:
        side.close()
        side.subscribe(Subscribe(1, "/topic", harness.types[0], RELIABLE))
        side.unsubscribe(1)
        side.create_publisher(new_publisher(harness, 2, "/topic"))
        side.publish(Publish(2, harness.message(b"x"), 0, FIRST, 1))
        side.destroy_publisher(2)

    def test_what_nobody_knows_is_no_mistake(self, harness: TopicHarness, side: TopicSide) -> None:
        side.unsubscribe(99)
        side.publish(Publish(99, harness.message(b"x"), 0, FIRST, 1))
        side.destroy_publisher(99)

    def test_its_methods_return_while_the_watcher_is_being_told(
        self, harness: TopicHarness, side: TopicSide, watching: Watching
    ) -> None:
        """A watcher may wait for who is calling the side: that must not be for ever."""
        peer = subscribed(harness, side, watching, 1, "/topic")
        entered, release = threading.Event(), threading.Event()

        def hold() -> None:
            entered.set()
            release.wait(harness.patience_s)

        watching.hook = hold
        peer.publish(harness.message(b"x"))
        try:
            assert entered.wait(harness.patience_s)
            within(CLOSE_WITHIN_S, lambda: side.publish(nothing(harness)))
            within(CLOSE_WITHIN_S, lambda: side.unsubscribe(1))
        finally:
            watching.hook = None
            release.set()
