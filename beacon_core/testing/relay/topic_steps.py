"""The steps that the checks of topic sides are made of."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from beacon_core.ports.topic_side import TopicSide
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos
from beacon_core.testing.relay.topic_harness import (
    Heard,
    PeerPublisher,
    PeerSubscription,
    TopicHarness,
    Watching,
)
from beacon_core.testing.waiting import wait_until

__all__ = [
    "FIRST",
    "RELIABLE",
    "eventually",
    "failed",
    "heard_since",
    "is_heard",
    "is_matched",
    "needs",
    "new_publisher",
    "nothing",
    "received_since",
    "seen_as",
    "speak",
    "subscribed",
    "type_of",
]

RELIABLE = Qos(reliable=True, durable=False, depth=100)
"""What most checks speak and listen with."""

FIRST = 0x1234_5678_9ABC_DEF0
"""The forwarder whose messages most checks publish."""

_MARK = b"are you there?"


def needs(harness: TopicHarness, capability: str) -> None:
    """Skip the check, and say why, if the network cannot do this."""
    if not getattr(harness.capabilities, capability):
        pytest.skip(f"the network lacks the capability {capability}")


def eventually(harness: TopicHarness, predicate: Callable[[], Any], what: str) -> None:
    """Wait for it, as long as the harness's patience lasts."""
    in_time = wait_until(predicate, harness.patience_s)
    assert in_time, f"did not happen within {harness.patience_s} s: {what}"


def seen_as(harness: TopicHarness, watching: Watching, topic: str) -> SeenTopic:
    """Wait until the topic is seen; gives what was told of it."""
    eventually(harness, lambda: topic in watching.topics, f"{topic} is seen")
    return watching.topics[topic]


def type_of(watching: Watching, topic: str) -> object:
    """The type of which the topic is seen; ``None`` if it is not."""
    seen = watching.topics.get(topic)
    return seen and seen.type


def failed(watching: Watching, handle: int) -> bool:
    """Has this publisher been refused?"""
    return handle in dict(watching.failures)


def new_publisher(
    harness: TopicHarness, handle: int, topic: str, qos: Qos = RELIABLE
) -> CreatePublisher:
    """What asks for a publisher of the first type."""
    return CreatePublisher(handle, topic, harness.types[0], qos, FIRST)


def nothing(harness: TopicHarness) -> Publish:
    """A message for a publisher that there is not."""
    return Publish(98, harness.message(b"x"), 0, FIRST, 1)


def is_matched(harness: TopicHarness, watching: Watching, handle: int) -> None:
    """Somebody is there, and all who should be have matched."""

    def all_there() -> bool:
        told = watching.last_match(handle)
        return told is not None and 0 < told[1] <= told[0]

    eventually(harness, all_there, f"publisher {handle} is matched")


def subscribed(
    harness: TopicHarness, side: TopicSide, watching: Watching, handle: int, topic: str
) -> PeerPublisher:
    """A peer's publisher that the side's subscription hears from now on."""
    peer = harness.publisher(topic, harness.types[0], RELIABLE)
    seen_as(harness, watching, topic)
    side.subscribe(Subscribe(handle, topic, harness.types[0], RELIABLE))

    def heard() -> bool:
        peer.publish(harness.message(_MARK))
        return bool(watching.payloads(handle))

    eventually(harness, heard, f"{topic} is heard")
    told = 0
    while told != (told := len(watching.heard)):
        wait_until(lambda: False, harness.quiet_s / 3)
    return peer


def heard_since(harness: TopicHarness, watching: Watching) -> list[Heard]:
    """What came besides what :func:`subscribed` said until it was heard, some of it late."""
    mark = harness.message(_MARK)
    return [one for one in list(watching.heard) if one.payload != mark]


def is_heard(harness: TopicHarness, side: TopicSide, handle: int, peer: PeerSubscription) -> None:
    """Publish until the peer hears it: DDS may lose what is said right after a match."""

    def heard() -> bool:
        side.publish(Publish(handle, harness.message(_MARK), 0, FIRST, 1))
        return bool(peer.received())

    eventually(harness, heard, f"publisher {handle} is heard")


def received_since(harness: TopicHarness, peer: PeerSubscription) -> list[bytes]:
    """What the peer has received besides what :func:`is_heard` said."""
    mark = harness.message(_MARK)
    return [one for one in peer.received() if one != mark]


def speak(peer: PeerPublisher, payload: bytes, done: threading.Event) -> None:
    """Publish without a pause, until it is done or cannot be done any more."""
    with suppress(Exception):
        while not done.wait(0.002):
            peer.publish(payload)
