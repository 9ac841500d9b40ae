"""For tests: a publisher and a subscriber of hints as rmw_zenoh makes them.

Of the same parts of Zenoh, with its settings; nothing in them is ours but keys and attachments.
"""

from __future__ import annotations

import time
from typing import Any

import attrs
import zenoh
import zenoh.ext

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.config import session_config
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import DataKey, data_key
from beacon_zenoh.rmw.options import DEFAULT_TOPIC
from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key

__all__ = ["KEEPS", "Ear", "Robot", "open_session"]

KEEPS = Qos(durability=1, depth=5)
"""Reliable and transient local."""


class Robot:
    """A node, ``/fleet/r1/talker``, with a publisher of hints."""

    def __init__(
        self,
        endpoint: str,
        qos: Qos = KEEPS,
        *,
        domain: int = 0,
        type_name: str = TYPE_NAME,
        type_hash: str = TYPE_HASH,
    ) -> None:
        self.session = open_session(endpoint)
        zid = str(self.session.zid())
        self.node = Member(Kind.NODE, domain, zid, 0, 0, "talker", "/fleet/r1")
        self.member = attrs.evolve(
            self.node,
            kind=Kind.PUBLISHER,
            member_id=10,
            name=DEFAULT_TOPIC,
            type_name=type_name,
            type_hash=type_hash,
            qos=qos,
        )
        self.key = data_key(self.member.data_key)
        self.gid = gid_of(token_key(self.member))
        self.sequence = 0
        self.publisher: Any = self._publisher(qos)
        declare = self.session.liveliness().declare_token
        self.tokens = [declare(token_key(one)) for one in (self.node, self.member)]

    def _publisher(self, qos: Qos) -> Any:
        if not qos.keeps:
            return self.session.declare_publisher(self.key)
        return zenoh.ext.declare_advanced_publisher(
            self.session,
            self.key,
            cache=zenoh.ext.CacheConfig(max_samples=qos.depth),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=0.5
            ),
            publisher_detection=True,
        )

    def say(self, entity_id: str, display_name: str = "") -> None:
        """Publish a hint."""
        self.put(cdr.encode(BeaconHint(entity_id, display_name=display_name)))

    def put(self, payload: bytes) -> None:
        """Publish any bytes."""
        self.sequence += 1
        beside = attachment.encode(self.gid, self.sequence, time.time_ns())
        self.publisher.put(payload, attachment=beside)

    def close(self) -> None:
        """End its session, and with it its tokens."""
        self.session.close()  # type: ignore[no-untyped-call]


class Ear:
    """A transient-local subscriber, as rmw_zenoh makes it: takes nothing without attachment."""

    def __init__(self, endpoint: str, depth: int = 10) -> None:
        self.session = zenoh.open(
            session_config(ZenohOptions(connect=(endpoint,)), "client").make()
        )
        self.heard: list[tuple[bytes, int, BeaconHint]] = []
        """GID, number and hint of each message."""
        key = data_key(DataKey(0, DEFAULT_TOPIC, TYPE_NAME, TYPE_HASH))
        self.subscriber = zenoh.ext.declare_advanced_subscriber(
            self.session,
            key,
            self._take,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=depth),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            subscriber_detection=True,
        )

    def _take(self, sample: zenoh.Sample) -> None:
        beside = sample.attachment
        envelope = None if beside is None else attachment.decode(beside.to_bytes())
        read = cdr.decode(sample.payload.to_bytes())
        if envelope is not None and isinstance(read, Announcement):
            gid, number, _ = envelope
            self.heard.append((gid, number, read.hint))

    def names(self) -> list[str]:
        """Whom it has heard of, in order."""
        return [hint.entity_id for _, _, hint in self.heard]

    def close(self) -> None:
        """End its session, and with it its tokens."""
        self.session.close()  # type: ignore[no-untyped-call]


def open_session(endpoint: str, *, user: str = "", password: str = "") -> zenoh.Session:
    """A session with rmw_zenoh's settings: a peer that has a router, and finds others by gossip.

    It waits 500 ms for its router, before which what it says is lost.
    """
    scouting = {"gossip": {"enabled": True}, "delay": 500}
    settings = {"timestamping": {"enabled": True}, "scouting": scouting}
    options = ZenohOptions(
        mode="peer",
        connect=(endpoint,),
        listen=("tcp/127.0.0.1:0",),
        config=settings,
        user=user,
        password=password,
    )
    return zenoh.open(session_config(options, "peer").make())
