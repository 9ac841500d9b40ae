"""ROS domains as the suite for topic sides wants them, with peers that know nothing of relays.

Peers have a ROS context of their own, so they are found as other programs are.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import attrs
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import UInt8MultiArray

from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import PeerPublisher, TopicCapabilities
from beacon_ros.domains import DomainLease
from beacon_ros.ending import deafen
from beacon_ros.mortal import short_lease
from beacon_ros.spinner import Spinner
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.qos import profile
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.topic_side import RosTopicSide

__all__ = ["BYTES", "TEXT", "MortalPublisher", "Peers", "RosTopicSideHarness", "message"]

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

_PATIENCE_S = 10.0

_MORTAL = """
import json, sys
from beacon_core.relay.values import Qos, TopicType
from beacon_ros_topic.relay.harness import Peers
domain, topic, name, digest, reliable, durable, depth = json.loads(sys.argv[1])
peers = Peers(domain)
made = peers.publisher(topic, TopicType(name, digest), Qos(reliable, durable, depth))
print("made", flush=True)
sys.stdin.readline()
"""


def message(body: bytes) -> bytes:
    """A whole :data:`BYTES` with this content: no dimensions, no offset, then the bytes.

    Filled up to whole words: DDS does that itself with what goes through a socket, and not with
    what stays in the process.
    """
    fill = bytes(-len(body) % 4)
    return b"\0\1\0\0" + struct.pack("<III", 0, 0, len(body)) + body + fill


class Peers:
    """Somebody else's program. Thread rule: one thread."""

    def __init__(self, domain_id: int) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False, domain_id=domain_id)
        self.node = Node(
            "peers", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._spinner = Spinner(self._context, self.node)

    def run(self, action: Callable[[], object]) -> None:
        """Do this in the thread that serves its node."""
        assert self._spinner.run(action, _PATIENCE_S)  # noqa: S101 - a check would fail anyway

    def publisher(self, topic: str, of: TopicType, qos: Qos) -> _Publisher:
        """One that publishes bytes of any type."""
        deadline = time.monotonic() + _PATIENCE_S
        while True:
            try:
                made = self.node.create_publisher(type_for(of), topic, profile(qos, 1))
                return _Publisher(self, made)
            except Exception:  # RCLError, which is not a public name
                # One of another type, which was closed, may go only when its executor lets go.
                if time.monotonic() >= deadline:
                    raise
                time.sleep(0.005)

    def subscription(self, topic: str, qos: Qos) -> _Subscription:
        """One of :data:`BYTES`, typed: what it cannot parse it does not get."""
        made = _Subscription(self)
        self.run(lambda: made.open(topic, qos))
        return made

    def close(self) -> None:
        """End the program."""
        self._spinner.close(_PATIENCE_S)
        deafen(self.node)
        self.node.destroy_node()
        self._context.try_shutdown()
        self._context.destroy()


@attrs.define(eq=False)
class _Publisher:
    peers: Peers
    made: Any
    closed: bool = False

    def publish(self, payload: bytes) -> None:
        self.made.publish(payload)

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            self.peers.run(lambda: self.peers.node.destroy_publisher(self.made))


@attrs.define(eq=False)
class _Subscription:
    peers: Peers
    made: Any = None
    got: list[bytes] = attrs.field(factory=list)

    def open(self, topic: str, qos: Qos) -> None:
        self.made = self.peers.node.create_subscription(
            UInt8MultiArray, topic, self._take, profile(qos, 1)
        )

    def received(self) -> list[bytes]:
        return list(self.got)

    def close(self) -> None:
        made, self.made = self.made, None
        if made is not None:
            self.peers.run(lambda: self.peers.node.destroy_subscription(made))

    def _take(self, got: UInt8MultiArray) -> None:
        self.got.append(message(bytes(got.data)))


class MortalPublisher:
    """A publisher in a process of its own, which is missed a second after it was killed."""

    def __init__(self, domain_id: int, topic: str, of: TopicType, qos: Qos) -> None:
        plain = json.dumps(
            [domain_id, topic, of.name, of.digest, qos.reliable, qos.durable, qos.depth]
        )
        self.process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-c", _MORTAL, plain],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            env={**os.environ, **short_lease()},
        )

    def publish(self, payload: bytes) -> None:
        """It only dies."""
        raise NotImplementedError

    def close(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        self.process.stdin.close()


class RosTopicSideHarness:
    """Implements :class:`beacon_core.testing.relay.topic_harness.TopicHarness`."""

    capabilities = TopicCapabilities()
    patience_s = 20.0
    quiet_s = 0.15  # within one machine what comes comes within a few ms
    types = (BYTES, TEXT)
    bad_types = (
        TopicType("no type", BYTES.digest),
        TopicType("std_msgs/msg/String", "md5:992ce8a1687cec8c8bd883ec73ca41d1"),
    )

    def __init__(self) -> None:
        self._lease = DomainLease()
        self.domain_id = self._lease.domain_id
        self._peers = Peers(self.domain_id)
        self._sides: list[RosTopicSide] = []
        self._mortals: list[MortalPublisher] = []

    def side(self) -> RosTopicSide:
        made = RosTopicSide(RosNetworkOptions(domain_id=self.domain_id))
        self._sides.append(made)
        return made

    def publisher(
        self, topic: str, of: TopicType, qos: Qos, *, mortal: bool = False
    ) -> PeerPublisher:
        if not mortal:
            return self._peers.publisher(topic, of, qos)
        made = MortalPublisher(self.domain_id, topic, of, qos)
        self._mortals.append(made)
        return made

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> _Subscription:
        assert of == BYTES, of  # noqa: S101 - peers know no other
        return self._peers.subscription(topic, qos)

    def crash(self, publisher: PeerPublisher) -> None:
        publisher.close()

    def message(self, body: bytes) -> bytes:
        return message(body)

    def close(self) -> None:
        for side in self._sides:
            side.close()
        for mortal in self._mortals:
            mortal.close()
        self._peers.close()
        self._lease.close()
