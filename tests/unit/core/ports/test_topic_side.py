"""The topic side's port: small enough to write one down, and checked to be one by mypy."""

from __future__ import annotations

import inspect

from beacon_core.ports import topic_side
from beacon_core.ports.topic_side import TopicSide, TopicWatcher
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos, TopicType

KIND = TopicType("a/msg/B", "RIHS01_1")


class Room:
    """A network of one: who publishes hears it, if subscribed."""

    def __init__(self) -> None:
        self.watcher: TopicWatcher | None = None
        self.subscribed: dict[int, str] = {}
        self.published: dict[int, str] = {}

    def start(self, watcher: TopicWatcher) -> None:
        self.watcher = watcher

    def subscribe(self, what: Subscribe) -> None:
        self.subscribed[what.handle] = what.topic

    def unsubscribe(self, handle: int) -> None:
        del self.subscribed[handle]

    def create_publisher(self, what: CreatePublisher) -> None:
        self.published[what.handle] = what.topic
        if self.watcher is not None:
            self.watcher.topic_seen(what.topic, SeenTopic(what.type, what.qos))
            self.watcher.matched(what.handle, 1, 1)

    def publish(self, what: Publish) -> None:
        topic = self.published[what.handle]
        for handle, subscribed in self.subscribed.items():
            if self.watcher is not None and topic == subscribed:
                self.watcher.message(handle, what.payload, first=what.first, hop=what.hop)

    def destroy_publisher(self, handle: int) -> None:
        del self.published[handle]

    def close(self) -> None:
        self.watcher = None


class Watcher:
    def __init__(self) -> None:
        self.told: list[object] = []

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        self.told.append((topic, seen.type))

    def topic_gone(self, topic: str) -> None:
        self.told.append(topic)

    def message(
        self, handle: int, payload: bytes, *, stamp_ns: int = 0, first: int = 0, hop: int = 0
    ) -> None:
        self.told.append((handle, payload, first, hop))

    def matched(self, handle: int, matched: int, expected: int) -> None:
        self.told.append((handle, matched, expected))

    def publisher_failed(self, handle: int, reason: str) -> None:
        self.told.append((handle, reason))


def test_seven_methods_make_a_topic_side() -> None:
    watcher = Watcher()
    port: TopicSide = Room()
    port.start(watcher)
    port.subscribe(Subscribe(1, "/a", KIND, Qos()))
    port.create_publisher(CreatePublisher(1, "/a", KIND, Qos(), 7))
    port.publish(Publish(1, b"x", 0, 7, 1))
    port.unsubscribe(1)
    port.publish(Publish(1, b"y", 0, 7, 1))
    port.destroy_publisher(1)
    port.close()
    assert watcher.told == [("/a", KIND), (1, 1, 1), (1, b"x", 7, 1)]


def test_the_port_says_its_thread_rule() -> None:
    assert "Thread rule" in (inspect.getdoc(topic_side.TopicSide) or "")
