"""What the topic sides' suite needs of a network: a :class:`TopicHarness`, written once for each.

Nothing here imports pytest, so a harness may also be used outside the suite.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol

import attrs

from beacon_core.ports.topic_side import TopicSide
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos, TopicType

__all__ = [
    "Heard",
    "PeerPublisher",
    "PeerSubscription",
    "TopicCapabilities",
    "TopicHarness",
    "Watching",
]


@attrs.frozen
class TopicCapabilities:
    """What a network can do. Each ``True`` is a promise that the suite tests; the checks of what it
    cannot do are shown as skipped."""

    tells_relays: bool = True
    """A message that another relay has published comes with its ``first`` and ``hop``."""
    detects_crash: bool = True
    """A publisher that vanishes without a word is missed within the harness's patience."""
    refuses_types: bool = True
    """There are types that no publisher can be made of: ``bad_types`` of the harness."""
    latches: bool = True
    """A durable publisher serves who comes later."""
    acknowledges: bool = True
    """A reliable publisher that is destroyed right after its last message still delivers it."""


class PeerPublisher(Protocol):
    """A publisher that is none of the topic side's: a program of somebody else."""

    def publish(self, payload: bytes) -> None:
        """Publish these bytes, which are a message of its type."""

    def close(self) -> None:
        """End in order. Idempotent."""


class PeerSubscription(Protocol):
    """A subscription of somebody else, which knows the type: so a broken message is noticed."""

    def received(self) -> list[bytes]:
        """The messages so far, as bytes of the type that was asked for."""

    def close(self) -> None:
        """End in order. Idempotent."""


class TopicHarness(Protocol):
    """One network with nothing on it, made anew for each check.

    Thread rule: the suite calls from one thread.
    """

    @property
    def capabilities(self) -> TopicCapabilities: ...

    @property
    def patience_s(self) -> float:
        """How long to wait for what must come. Only a failing check waits that long."""

    @property
    def quiet_s(self) -> float:
        """How long to listen before believing that nothing comes."""

    @property
    def types(self) -> tuple[TopicType, TopicType]:
        """Two types that differ in their names. Peers know the first."""

    @property
    def bad_types(self) -> tuple[TopicType, ...]:
        """Types that no publisher can be made of."""

    def side(self) -> TopicSide:
        """A new topic side on this network, not started. Each is another relay's."""

    def publisher(
        self, topic: str, of: TopicType, qos: Qos, *, mortal: bool = False
    ) -> PeerPublisher:
        """A peer's publisher; ``mortal`` if ``crash`` will be called on it."""

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> PeerSubscription:
        """A peer's subscription."""

    def crash(self, publisher: PeerPublisher) -> None:
        """Let it vanish as if by ``kill -9``."""

    def message(self, body: bytes) -> bytes:
        """A whole message of the first type, around any bytes."""

    def close(self) -> None:
        """Close everything that was made here."""


@attrs.frozen
class Heard:
    """One message that a topic side has told."""

    handle: int
    payload: bytes
    stamp_ns: int
    first: int
    hop: int


class Watching:
    """A watcher that writes down what it is told. Thread rule: any thread.

    ``hook``, if set, is run inside each call.
    """

    def __init__(self) -> None:
        self.hook: Callable[[], object] | None = None
        self.calls = 0
        self.topics: dict[str, SeenTopic] = {}
        self.tellings: list[tuple[str, SeenTopic | None]] = []
        """Each ``topic_seen``, and each ``topic_gone`` as ``None``."""
        self.heard: list[Heard] = []
        self.matches: dict[int, list[tuple[int, int]]] = {}
        self.failures: list[tuple[int, str]] = []
        self._lock = threading.Lock()

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        self._called()
        self.topics[topic] = seen
        self.tellings.append((topic, seen))

    def topic_gone(self, topic: str) -> None:
        self._called()
        self.topics.pop(topic, None)
        self.tellings.append((topic, None))

    def message(
        self, handle: int, payload: bytes, *, stamp_ns: int = 0, first: int = 0, hop: int = 0
    ) -> None:
        self._called()
        self.heard.append(Heard(handle, payload, stamp_ns, first, hop))

    def matched(self, handle: int, matched: int, expected: int) -> None:
        self._called()
        self.matches.setdefault(handle, []).append((matched, expected))

    def publisher_failed(self, handle: int, reason: str) -> None:
        self._called()
        self.failures.append((handle, reason))

    def payloads(self, handle: int) -> list[bytes]:
        """What came by this subscription."""
        return [one.payload for one in list(self.heard) if one.handle == handle]

    def last_match(self, handle: int) -> tuple[int, int] | None:
        """What was told last of this publisher."""
        return self.matches[handle][-1] if handle in self.matches else None

    def _called(self) -> None:
        with self._lock:
            self.calls += 1
        if self.hook is not None:
            self.hook()
