"""The in-memory network of topics, beyond what every topic side must do."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from beacon_core.errors import UsageError
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import Watching
from beacon_core.testing.waiting import wait_until
from beacon_fake.topic_harness import FakeTopicHarness
from beacon_fake.topic_side import FakeTopics, FakeTopicSide

TEXT, IMAGE = FakeTopicHarness.types
QOS = Qos(depth=10)
DURABLE = Qos(durable=True, depth=2)


@pytest.fixture
def network() -> FakeTopics:
    return FakeTopics()


@pytest.fixture
def watching() -> Watching:
    return Watching()


@pytest.fixture
def side(network: FakeTopics, watching: Watching) -> Iterator[FakeTopicSide]:
    made = network.side()
    made.start(watching)
    yield made
    made.close()


def eventually(true: Callable[[], object]) -> None:
    assert wait_until(true, 5.0)


def test_a_message_comes_with_who_published_it(
    network: FakeTopics, side: FakeTopicSide, watching: Watching
) -> None:
    side.subscribe(Subscribe(3, "/topic", TEXT, QOS))
    before_ns = time.time_ns()
    network.publisher("/topic", TEXT, QOS).publish(b"x", first=7, hop=2)
    eventually(lambda: watching.heard)
    (one,) = watching.heard
    assert (one.handle, one.payload, one.first, one.hop) == (3, b"x", 7, 2)
    assert before_ns <= one.stamp_ns <= time.time_ns()


def test_peers_hear_at_once_what_fits_and_nothing_else(network: FakeTopics) -> None:
    modest = network.publisher("/topic", TEXT, Qos(reliable=False))
    best = network.publisher("/topic", TEXT, DURABLE)
    wants = {
        "anything": network.subscription("/topic", TEXT, Qos(reliable=False)),
        "reliable": network.subscription("/topic", TEXT, QOS),
        "durable": network.subscription("/topic", TEXT, DURABLE),
        "another type": network.subscription("/topic", IMAGE, Qos(reliable=False)),
        "another topic": network.subscription("/other", TEXT, Qos(reliable=False)),
    }
    modest.publish(b"modest")
    best.publish(b"best")
    got = {name: one.received() for name, one in wants.items()}
    assert got["anything"] == [b"modest", b"best"]
    assert got["reliable"] == got["durable"] == [b"best"]
    assert got["another type"] == got["another topic"] == []


def test_who_comes_late_gets_the_last_of_a_durable_publisher(network: FakeTopics) -> None:
    publisher = network.publisher("/map", TEXT, DURABLE)
    for number in range(5):
        publisher.publish(b"%d" % number)
    assert network.subscription("/map", TEXT, DURABLE).received() == [b"3", b"4"]
    assert network.subscription("/map", TEXT, QOS).received() == []


def test_what_has_closed_neither_speaks_nor_hears(network: FakeTopics) -> None:
    publisher, peer = network.publisher("/t", TEXT, QOS), network.subscription("/t", TEXT, QOS)
    peer.close()
    peer.close()
    publisher.publish(b"1")
    assert peer.received() == []
    other = network.subscription("/t", TEXT, QOS)
    publisher.close()
    publisher.close()
    publisher.publish(b"2")
    assert other.received() == []


def test_two_sides_hear_each_other_and_not_themselves(network: FakeTopics) -> None:
    sides, watchers = [network.side() for _ in range(2)], [Watching() for _ in range(2)]
    for one, told in zip(sides, watchers, strict=True):
        one.start(told)
        one.subscribe(Subscribe(1, "/topic", TEXT, QOS))
        one.create_publisher(CreatePublisher(2, "/topic", TEXT, QOS, 9))
    eventually(lambda: all(told.last_match(2) == (1, 1) for told in watchers))
    sides[0].publish(Publish(2, b"x", 0, 9, 1))
    eventually(lambda: watchers[1].heard)
    assert (watchers[1].heard[0].first, watchers[1].heard[0].hop) == (9, 1)
    for one in sides:
        one.close()
    assert not watchers[0].heard


def test_a_type_that_is_refused_is_told() -> None:
    secret = TopicType("unknown_msgs/msg/Secret", "F3")
    side, watching = FakeTopics(refused=[secret]).side(), Watching()
    side.start(watching)
    side.create_publisher(CreatePublisher(1, "/topic", secret, QOS, 1))
    eventually(lambda: watching.failures)
    assert watching.failures == [(1, "unknown_msgs/msg/Secret is not known on this network")]
    side.close()


def test_what_is_subscribed_to_no_more_is_not_told_even_if_it_was_under_way(
    network: FakeTopics, side: FakeTopicSide, watching: Watching
) -> None:
    entered, release = threading.Event(), threading.Event()

    def hold() -> None:
        entered.set()
        release.wait(5.0)

    publisher = network.publisher("/topic", TEXT, QOS)
    eventually(lambda: "/topic" in watching.topics)
    side.subscribe(Subscribe(1, "/topic", TEXT, QOS))
    watching.hook = hold
    network.publisher("/other", TEXT, QOS)
    assert entered.wait(5.0)
    publisher.publish(b"under way")
    side.unsubscribe(1)
    watching.hook = None
    release.set()
    network.publisher("/mark", TEXT, QOS)
    eventually(lambda: "/mark" in watching.topics)
    assert not watching.heard


def test_it_is_started_once(network: FakeTopics, side: FakeTopicSide, watching: Watching) -> None:
    with pytest.raises(UsageError, match="make a new one"):
        side.start(watching)
    closed = network.side()
    closed.close()
    with pytest.raises(UsageError, match="make a new one"):
        closed.start(watching)


def test_it_closes_from_its_own_thread(
    network: FakeTopics, side: FakeTopicSide, watching: Watching
) -> None:
    closed = threading.Event()

    def close() -> None:
        side.close()
        closed.set()

    watching.hook = close
    network.publisher("/topic", TEXT, QOS)
    assert closed.wait(5.0)


def test_after_its_end_nothing_is_asked_of_the_network(
    network: FakeTopics, side: FakeTopicSide
) -> None:
    side.create_publisher(CreatePublisher(1, "/topic", TEXT, QOS, 1))
    peer = network.subscription("/topic", TEXT, QOS)
    side.close()
    side.publish(Publish(1, b"x", 0, 1, 1))
    side.create_publisher(CreatePublisher(2, "/topic", TEXT, QOS, 1))
    side.subscribe(Subscribe(3, "/topic", TEXT, QOS))
    side.publish(Publish(2, b"x", 0, 1, 1))
    side.destroy_publisher(2)
    side.unsubscribe(3)
    assert peer.received() == []
