"""An in-memory network of topics: topic sides on it, and peers that know nothing of relays.

Everything that is published is queued for each topic side and told from a thread of its own, in
order; peers have it at once. So a topic side never calls its watcher from inside a method.
"""

from __future__ import annotations

import itertools
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from functools import partial

import attrs

from beacon_core.errors import UsageError
from beacon_core.ports.topic_side import TopicWatcher
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos, TopicType

__all__ = ["FakePublisher", "FakeSubscription", "FakeTopicSide", "FakeTopics"]

_CLOSE_WITHIN_S = 0.9


@attrs.frozen
class _Message:
    payload: bytes
    stamp_ns: int
    first: int = 0
    hop: int = 0


@attrs.define(eq=False)
class FakePublisher:
    """A publisher of ``owner``, or of a peer. Thread rule: any thread."""

    network: FakeTopics
    topic: str
    type: TopicType
    qos: Qos
    owner: object = None
    _kept: deque[_Message] = attrs.field(init=False)

    def __attrs_post_init__(self) -> None:
        self._kept = deque(maxlen=self.qos.depth if self.qos.durable else 0)

    def publish(self, payload: bytes, first: int = 0, hop: int = 0) -> None:
        """To all that match now."""
        message = _Message(payload, time.time_ns(), first, hop)
        with self.network.lock:
            self._kept.append(message)
            for one in self.network.matches(self):
                one.take(message)

    def tell_kept(self, late: FakeSubscription) -> None:
        """What a durable publisher has for who comes late."""
        for message in self._kept:
            late.take(message)

    def close(self) -> None:
        """Idempotent."""
        self.network.remove(self)


@attrs.define(eq=False)
class FakeSubscription:
    """A subscription of ``owner``, or of a peer. Thread rule: any thread."""

    network: FakeTopics
    topic: str
    type: TopicType
    qos: Qos
    owner: object = None
    _tell: Callable[[_Message], object] | None = None
    _received: list[bytes] = attrs.field(factory=list)

    def take(self, message: _Message) -> None:
        """For the network."""
        if self._tell is None:
            self._received.append(message.payload)
        else:
            self._tell(message)

    def received(self) -> list[bytes]:
        """What a peer has got so far."""
        return list(self._received)

    def close(self) -> None:
        """Idempotent."""
        self.network.remove(self)


class FakeTopics:
    """The network. Thread rule: any thread."""

    def __init__(self, refused: Collection[TopicType] = ()) -> None:
        """``refused``: types that no publisher of a topic side can be made of."""
        self.lock = threading.RLock()
        self.refused = frozenset(refused)
        self._publishers: list[FakePublisher] = []
        self._subscriptions: list[FakeSubscription] = []
        self._sides: list[FakeTopicSide] = []

    def side(self) -> FakeTopicSide:
        """A topic side, not started."""
        return FakeTopicSide(self)

    def publisher(self, topic: str, of: TopicType, qos: Qos, owner: object = None) -> FakePublisher:
        """A publisher, of a peer unless it has an owner."""
        made = FakePublisher(self, topic, of, qos, owner)
        with self.lock:
            self._publishers.append(made)
            self._changed()
        return made

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> FakeSubscription:
        """A peer's subscription."""
        return self.add(FakeSubscription(self, topic, of, qos))

    def add(self, made: FakeSubscription) -> FakeSubscription:
        """Put it on the network; durable publishers tell it what they keep."""
        with self.lock:
            self._subscriptions.append(made)
            for one in self._publishers:
                if made.qos.durable and _match(one, made):
                    one.tell_kept(made)
            self._changed()
        return made

    def remove(self, what: FakePublisher | FakeSubscription) -> None:
        """Take it off the network. Idempotent."""
        with self.lock:
            self._publishers = [one for one in self._publishers if one is not what]
            self._subscriptions = [one for one in self._subscriptions if one is not what]
            self._changed()

    def matches(self, publisher: FakePublisher) -> list[FakeSubscription]:
        """The subscriptions that hear it; under the lock."""
        if not any(one is publisher for one in self._publishers):
            return []
        return [one for one in self._subscriptions if _match(publisher, one)]

    def seen_by(self, side: FakeTopicSide) -> dict[str, SeenTopic]:
        """The topics that have publishers of others; under the lock."""
        others = [one for one in self._publishers if one.owner is not side]
        others.sort(key=lambda one: one.topic)
        grouped = itertools.groupby(others, key=lambda one: one.topic)
        return {topic: _merged(list(some)) for topic, some in grouped}

    def join(self, side: FakeTopicSide) -> None:
        """From now on it is told."""
        with self.lock:
            self._sides.append(side)
            side.look()

    def leave(self, side: FakeTopicSide) -> None:
        """It is told nothing any more, and what it has is gone."""
        with self.lock:
            self._sides = [one for one in self._sides if one is not side]
            self._publishers = [one for one in self._publishers if one.owner is not side]
            self._subscriptions = [one for one in self._subscriptions if one.owner is not side]
            self._changed()

    def _changed(self) -> None:
        for side in self._sides:
            side.look()


class FakeTopicSide:
    """Implements :class:`beacon_core.ports.topic_side.TopicSide`; the thread rule is the port's."""

    def __init__(self, network: FakeTopics) -> None:
        self._network = network
        self._tellings: queue.SimpleQueue[Callable[[], object] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._tell, name="beacon-fake-topics", daemon=True)
        self._closed = False
        self._topics: dict[str, SeenTopic] = {}
        self._subscriptions: dict[int, FakeSubscription] = {}
        self._publishers: dict[int, FakePublisher] = {}
        self._told: dict[int, int] = {}
        # How many have matched a publisher, as told last.

    def start(self, watcher: TopicWatcher) -> None:
        if self._closed or self._thread.is_alive():
            raise UsageError("start: it was started or closed already; make a new one")
        self._watcher = watcher
        self._thread.start()
        self._network.join(self)

    def subscribe(self, what: Subscribe) -> None:
        if self._closed:
            return

        def tell(message: _Message) -> None:
            self._tellings.put(partial(self._deliver, what.handle, message))

        made = FakeSubscription(self._network, what.topic, what.type, what.qos, self, tell)
        self._subscriptions[what.handle] = made
        self._network.add(made)

    def unsubscribe(self, handle: int) -> None:
        made = self._subscriptions.pop(handle, None)
        if made is not None:
            made.close()

    def create_publisher(self, what: CreatePublisher) -> None:
        if self._closed:
            return
        if what.type in self._network.refused:
            reason = f"{what.type.name} is not known on this network"
            self._tellings.put(partial(self._watcher.publisher_failed, what.handle, reason))
            return
        with self._network.lock:
            self._publishers[what.handle] = self._network.publisher(
                what.topic, what.type, what.qos, self
            )
            self.look()

    def publish(self, what: Publish) -> None:
        made = self._publishers.get(what.handle)
        if made is not None:
            made.publish(what.payload, what.first, what.hop)

    def destroy_publisher(self, handle: int) -> None:
        with self._network.lock:
            made = self._publishers.pop(handle, None)
            self._told.pop(handle, None)
        if made is not None:
            made.close()

    def close(self) -> None:
        self._closed = True
        self._network.leave(self)
        self._tellings.put(None)
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_CLOSE_WITHIN_S)

    def look(self) -> None:
        """For the network, under its lock: something has come or gone."""
        seen = self._network.seen_by(self)
        for topic in self._topics.keys() - seen.keys():
            self._tellings.put(partial(self._watcher.topic_gone, topic))
        for topic, one in seen.items():
            if self._topics.get(topic) != one:
                self._tellings.put(partial(self._watcher.topic_seen, topic, one))
        self._topics = seen
        for handle, publisher in self._publishers.items():
            count = len(self._network.matches(publisher))
            if self._told.get(handle) != count:
                self._told[handle] = count
                self._tellings.put(partial(self._watcher.matched, handle, count, count))

    def _deliver(self, handle: int, message: _Message) -> None:
        if handle in self._subscriptions:
            self._watcher.message(
                handle,
                message.payload,
                stamp_ns=message.stamp_ns,
                first=message.first,
                hop=message.hop,
            )

    def _tell(self) -> None:
        while (telling := self._tellings.get()) is not None and not self._closed:
            telling()


def _match(publisher: FakePublisher, subscription: FakeSubscription) -> bool:
    offered, wanted = publisher.qos, subscription.qos
    return (
        (publisher.topic, publisher.type) == (subscription.topic, subscription.type)
        and (publisher.owner is None or publisher.owner is not subscription.owner)
        and offered.reliable >= wanted.reliable
        and offered.durable >= wanted.durable
    )


def _merged(publishers: list[FakePublisher]) -> SeenTopic:
    """The type of the first; what all offer."""
    depth = max(one.qos.depth for one in publishers)
    return SeenTopic(
        publishers[0].type,
        Qos(
            all(one.qos.reliable for one in publishers),
            all(one.qos.durable for one in publishers),
            depth,
        ),
    )
