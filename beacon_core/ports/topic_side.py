"""The network beside a relay: its topics, as opaque bytes."""

from __future__ import annotations

from typing import Protocol

from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic

__all__ = ["TopicSide", "TopicWatcher"]


class TopicWatcher(Protocol):
    """What a topic side tells. It neither raises nor blocks."""

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        """A topic has publishers other than our own; also when its type or QoS has changed."""

    def topic_gone(self, topic: str) -> None:
        """It has none any more."""

    def message(
        self, handle: int, payload: bytes, *, stamp_ns: int = 0, first: int = 0, hop: int = 0
    ) -> None:
        """A message of the subscription ``handle``, as it was on the wire.

        ``first`` and ``hop`` are those of the :class:`Publish` that made it, if a relay did and the
        network can tell; else 0.
        """

    def matched(self, handle: int, matched: int, expected: int) -> None:
        """A publisher has so many subscriptions; the network shows so many that it could have."""

    def publisher_failed(self, handle: int, reason: str) -> None:
        """It could not be made, or is broken; its handle is gone."""


class TopicSide(Protocol):
    """Carries out what a relay's core asks of its network.

    Thread rule: all methods from one thread at a time. The watcher is called from threads of the
    side's choosing, or at once by a method's caller. What it does not promise: that types are
    installed; then ``publisher_failed`` says so.
    """

    def start(self, watcher: TopicWatcher) -> None:
        """Begin to watch the topics."""

    def subscribe(self, what: Subscribe) -> None:
        """Take raw messages of a topic, not those that this side publishes, if it can tell."""

    def unsubscribe(self, handle: int) -> None:
        """No more."""

    def create_publisher(self, what: CreatePublisher) -> None:
        """Offer a topic; the watcher is told whom it has matched, or that it failed."""

    def publish(self, what: Publish) -> None:
        """Publish the bytes as they are."""

    def destroy_publisher(self, handle: int) -> None:
        """Let what was published go out, then end it."""

    def close(self) -> None:
        """Stop. Idempotent, within 1 s; afterwards the watcher is not called any more."""
