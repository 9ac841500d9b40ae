"""Messages are taken whole, with who sent them, and nothing is left of what went wrong."""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nothing to take")

from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.graph import publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.taking import KEPT_BYTES, Buffer, Taken, taker

Eventually = Callable[..., None]

HEADER = b"\0\1\0\0"


class Topic:
    """One with a subscription and publishers in one context, which find each other at once."""

    def __init__(self, domain: int) -> None:
        self.own = OwnNode("taking", domain)
        self.type = message_type(TYPE_NAME, TYPE_HASH)
        self.subscription = self.own.node.create_subscription(
            self.type, "/topic", print, QoSProfile(depth=100), raw=True
        )
        self.take = taker(self.subscription.handle)

    def publisher(self) -> Publisher:
        return self.own.node.create_publisher(self.type, "/topic", QoSProfile(depth=100))


@pytest.fixture
def topic(domain: int) -> Iterator[Topic]:
    made = Topic(domain)
    yield made
    made.own.close()


def next_of(topic: Topic, eventually: Eventually) -> Taken:
    found: list[Taken] = []

    def arrived() -> bool:
        if taken := topic.take():
            found.append(taken)
        return bool(found)

    eventually(arrived)
    return found[0]


def test_a_message_comes_with_the_gid_that_the_graph_shows_its_number_and_its_time(
    topic: Topic, eventually: Eventually
) -> None:
    first, second = topic.publisher(), topic.publisher()
    gids = []
    for number, publisher in enumerate((first, first, second), 1):
        before_ns = time.time_ns()
        publisher.publish(HEADER + b"abcd")
        payload, gid, sequence, stamp_ns = next_of(topic, eventually)
        assert payload == HEADER + b"abcd"
        assert sequence == (number if publisher is first else 1)
        assert before_ns <= stamp_ns <= time.time_ns()
        gids.append(gid)
    assert gids[0] == gids[1] != gids[2]
    listed = publishers(topic.own.node, "/topic")
    assert {one.gid for one in listed} == set(gids)


def test_a_publisher_made_anew_has_another_gid(topic: Topic, eventually: Eventually) -> None:
    gids = set()
    for _ in range(5):
        publisher = topic.publisher()
        publisher.publish(HEADER)
        gids.add(next_of(topic, eventually)[1])
        topic.own.node.destroy_publisher(publisher)
    assert len(gids) == 5


def test_where_nothing_has_come_there_is_nothing(topic: Topic) -> None:
    assert topic.take() is None


def test_what_is_held_is_a_copy(topic: Topic, eventually: Eventually) -> None:
    publisher = topic.publisher()
    publisher.publish(HEADER + b"first")
    first = next_of(topic, eventually)
    publisher.publish(HEADER + b"other")
    next_of(topic, eventually)
    assert first[0].startswith(HEADER + b"first")


def test_a_large_message_is_taken_whole_and_its_memory_given_back(
    topic: Topic, eventually: Eventually
) -> None:
    buffer = Buffer()
    topic.take = taker(topic.subscription.handle, buffer)
    publisher = topic.publisher()
    for size in (8, 60_000, 8, 3_000_000, 8):
        payload = HEADER + bytes(range(256)) * (size // 256 + 1)
        publisher.publish(payload)
        assert next_of(topic, eventually)[0] == payload
        assert 4096 <= buffer.capacity <= KEPT_BYTES


def test_a_buffer_that_may_keep_more_is_made_once_and_serves_several(
    topic: Topic, eventually: Eventually
) -> None:
    buffer = Buffer(kept_bytes=4_000_000)
    take = topic.take = taker(topic.subscription.handle, buffer)
    publisher = topic.publisher()
    for size in (8, 3_000_000, 8):
        publisher.publish(HEADER + bytes(size))
        assert next_of(topic, eventually)[0] == HEADER + bytes(size)
    assert buffer.capacity >= 3_000_000
    topic.take = taker(topic.subscription.handle, buffer)
    publisher.publish(HEADER + b"abcd")
    assert next_of(topic, eventually)[0] == HEADER + b"abcd"
    assert take() is None


def test_a_fault_is_told_in_the_words_of_ros_and_not_taken_for_silence(
    capfd: pytest.CaptureFixture[str],
) -> None:
    nobody = c.create_string_buffer(64)
    take = taker(SimpleNamespace(pointer=c.addressof(nobody)))
    for _ in range(2):
        with pytest.raises(RuntimeError, match=r"^taking a message failed: .*impl"):
            take()
    assert capfd.readouterr().err == ""
