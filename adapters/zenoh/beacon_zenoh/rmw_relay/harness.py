"""ROS domains over Zenoh as the suite for topic sides wants them, with peers that know no relay.

Peers are plain sessions that speak the dialect of rmw_zenoh by the same parts of Zenoh as its nodes
do: advanced publishers and subscribers. Nothing in them is of the topic side.
"""

from __future__ import annotations

import itertools
import json
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import attrs
import zenoh
import zenoh.ext

from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import PeerPublisher, TopicCapabilities
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import open_router
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw import qos as rmw
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.session import node_member
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw_relay.options import RmwNetworkOptions
from beacon_zenoh.rmw_relay.topic_side import RmwTopicSide

__all__ = [
    "BYTES",
    "TEXT",
    "MortalPublisher",
    "Peers",
    "Publisher",
    "RmwTopicSideHarness",
    "Subscription",
    "message",
    "text",
]

BYTES = TopicType(
    "std_msgs/msg/UInt8MultiArray",
    "RIHS01_5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
)
"""A type that can hold any bytes."""

TEXT = TopicType(
    "std_msgs/msg/String",
    "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
)
"""Another one."""

_CDR = b"\0\1\0\0"
_FRONT = struct.Struct("<4sIII")

_MORTAL = """
import json, sys
from beacon_core.relay.values import Qos, TopicType
from beacon_zenoh.rmw_relay.harness import Peers
endpoint, topic, name, digest, reliable, durable, depth = json.loads(sys.argv[1])
peers = Peers(endpoint)
made = peers.publisher(topic, TopicType(name, digest), Qos(reliable, durable, depth))
print("made", flush=True)
sys.stdin.readline()
"""


def message(body: bytes) -> bytes:
    """A whole :data:`BYTES` with this content, filled up to whole words as DDS does it."""
    fill = bytes(-len(body) % 4)
    return _FRONT.pack(_CDR, 0, 0, len(body)) + body + fill


def text(words: str) -> bytes:
    """A whole :data:`TEXT`, filled up in the same way."""
    body = words.encode() + b"\0"
    return _CDR + struct.pack("<I", len(body)) + body + bytes(-len(body) % 4)


class Peers:
    """Somebody else's program, one session of Zenoh. Thread rule: one thread."""

    def __init__(self, endpoint: str, domain: int = 0, node: str = "peers") -> None:
        options = ZenohOptions(connect=(endpoint,), config={"timestamping": {"enabled": True}})
        self.session = zenoh.open(session_config(options, "client").make())
        self._numbers = itertools.count()
        number = next(self._numbers)
        self.node = node_member(domain, str(self.session.zid()), number, node)
        # Tokens live as long as somebody holds them.
        self._held: list[object] = [self.declare(self.node)]

    def publisher(self, topic: str, of: TopicType, qos: Qos) -> Publisher:
        """One that publishes bytes of any type."""
        made = Publisher(self, self.member(Kind.PUBLISHER, topic, of, qos), qos)
        self._held.append(made)
        return made

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> Subscription:
        """One that hears no other type, and nothing without an attachment."""
        made = Subscription(self, self.member(Kind.SUBSCRIBER, topic, of, qos), qos)
        self._held.append(made)
        return made

    def member(self, kind: Kind, topic: str, of: TopicType, qos: Qos) -> Member:
        """What the node has next."""
        return attrs.evolve(
            self.node,
            kind=kind,
            member_id=next(self._numbers),
            name=topic,
            type_name=of.name,
            type_hash=of.digest,
            qos=rmw.Qos(
                1 if qos.reliable else 2, durability=1 if qos.durable else 2, depth=qos.depth
            ),
        )

    def declare(self, member: Member) -> zenoh.LivelinessToken:
        """Its token."""
        return self.session.liveliness().declare_token(token_key(member))

    def close(self) -> None:
        """End the program."""
        self.session.close()  # type: ignore[no-untyped-call]


class Publisher:
    """As rmw_zenoh makes it, but that it waits where Zenoh has no room: the suite counts."""

    def __init__(self, peers: Peers, member: Member, qos: Qos) -> None:
        self.gid = gid_of(token_key(member))
        self._sequence = 0
        key, block = data_key(member.data_key), zenoh.CongestionControl.BLOCK
        if qos.durable:
            self._made: Any = zenoh.ext.declare_advanced_publisher(
                peers.session,
                key,
                congestion_control=block,
                cache=zenoh.ext.CacheConfig(max_samples=qos.depth),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(
                    heartbeat=None, sporadic_heartbeat=0.5
                ),
                publisher_detection=True,
            )
        else:
            self._made = peers.session.declare_publisher(key, congestion_control=block)
        self._token: zenoh.LivelinessToken | None = peers.declare(member)

    def publish(self, payload: bytes) -> None:
        self._sequence += 1
        beside = attachment.encode(self.gid, self._sequence, time.time_ns())
        self._made.put(payload, attachment=beside)

    def close(self) -> None:
        token, self._token = self._token, None
        if token is not None:
            token.undeclare()  # type: ignore[no-untyped-call]
            self._made.undeclare()


class Subscription:
    """As rmw_zenoh makes it: takes nothing without attachment."""

    def __init__(self, peers: Peers, member: Member, qos: Qos) -> None:
        self.stamps: list[int] = []
        """Those of the publishers, of each message."""
        self.numbers: list[int] = []
        """And those that it had there."""
        self._got: list[bytes] = []
        key = data_key(member.data_key)
        if qos.durable:
            self._made: Any = zenoh.ext.declare_advanced_subscriber(
                peers.session,
                key,
                self._take,
                history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth),
                recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
                subscriber_detection=True,
            )
        else:
            self._made = peers.session.declare_subscriber(key, self._take)
        self._token: zenoh.LivelinessToken | None = peers.declare(member)

    def received(self) -> list[bytes]:
        return list(self._got)

    def close(self) -> None:
        token, self._token = self._token, None
        if token is not None:
            token.undeclare()  # type: ignore[no-untyped-call]
            self._made.undeclare()

    def _take(self, sample: zenoh.Sample) -> None:
        beside = sample.attachment
        envelope = None if beside is None else attachment.decode(beside.to_bytes())
        if envelope is not None:
            _, number, stamp_ns = envelope
            self.numbers.append(number)
            self.stamps.append(stamp_ns)
            self._got.append(_intact(sample.payload.to_bytes()))


class MortalPublisher:
    """A publisher in a process of its own."""

    def __init__(self, endpoint: str, topic: str, of: TopicType, qos: Qos) -> None:
        plain = json.dumps(
            [endpoint, topic, of.name, of.digest, qos.reliable, qos.durable, qos.depth]
        )
        self.process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-c", _MORTAL, plain],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
        )

    def publish(self, payload: bytes) -> None:
        """It only dies."""
        raise NotImplementedError

    def close(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        self.process.stdin.close()


class RmwTopicSideHarness:
    """Implements :class:`beacon_core.testing.relay.topic_harness.TopicHarness`."""

    capabilities = TopicCapabilities()
    patience_s = 30.0  # a busy machine may take long to start a process
    quiet_s = 0.1  # over loopback what comes comes within a few ms
    types = (BYTES, TEXT)
    bad_types = (
        TopicType("no type", BYTES.digest),
        TopicType("std_msgs/msg/String", "md5:992ce8a1687cec8c8bd883ec73ca41d1"),
    )

    def __init__(self) -> None:
        self.router, self.endpoint = open_router()
        self._made: list[Callable[[], object]] = []
        self._peers: Peers | None = None

    @property
    def peers(self) -> Peers:
        """Somebody else's program."""
        if self._peers is None:
            self._peers = Peers(self.endpoint)
        return self._peers

    def side(self) -> RmwTopicSide:
        made = RmwTopicSide(RmwNetworkOptions(connect=(self.endpoint,)))
        self._made.append(made.close)
        return made

    def publisher(
        self, topic: str, of: TopicType, qos: Qos, *, mortal: bool = False
    ) -> PeerPublisher:
        if not mortal:
            return self.peers.publisher(topic, of, qos)
        made = MortalPublisher(self.endpoint, topic, of, qos)
        self._made.append(made.close)
        return made

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> Subscription:
        return self.peers.subscription(topic, of, qos)

    def crash(self, publisher: PeerPublisher) -> None:
        publisher.close()

    def message(self, body: bytes) -> bytes:
        return message(body)

    def close(self) -> None:
        for close in self._made:
            close()
        if self._peers is not None:
            self._peers.close()
        self.router.close()  # type: ignore[no-untyped-call]


def _intact(payload: bytes) -> bytes:
    """The message, written anew from what it says if it is a :data:`BYTES`."""
    if len(payload) < _FRONT.size:
        return payload
    cdr, dimensions, offset, size = _FRONT.unpack_from(payload)
    if (cdr, dimensions, offset) != (_CDR, 0, 0):
        return payload
    body = payload[_FRONT.size : _FRONT.size + size]
    return message(body) if len(body) == size else b"broken"
