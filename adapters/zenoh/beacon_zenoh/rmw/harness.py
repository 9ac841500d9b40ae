"""ROS 2 over Zenoh as the contract suite wants it; and announcers to kill."""

from __future__ import annotations

import hashlib
import signal
from collections.abc import Mapping, Sequence
from typing import Any

import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.testing.harness import Capabilities, RealTimeHarness
from beacon_core.testing.hostile import HOSTILE_CDR
from beacon_core.wire import cdr
from beacon_zenoh.harness import ProcessAnnouncer, Strangers, open_router
from beacon_zenoh.rmw import ADAPTER, attachment
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.options import RmwOptions
from beacon_zenoh.rmw.qos import DEFAULT_QOS
from beacon_zenoh.rmw.session import hint_member, node_member
from beacon_zenoh.rmw.tokens import Kind

__all__ = ["RmwHarness"]


class RmwHarness(RealTimeHarness):
    """A :class:`beacon_core.testing.harness.Harness`: one router, and each ``network`` is a ROS
    domain."""

    adapter: Adapter = ADAPTER
    capabilities = Capabilities(vouches_for_ids=False)
    quiet_s = 0.15  # over loopback what comes comes within a few ms
    hostile_payloads: Mapping[str, bytes] = HOSTILE_CDR
    bad_options: Sequence[Mapping[str, Any]] = (
        {"mode": "server"},
        {"connect": "tcp/127.0.0.1:7447"},
        {"ros_domain_ids": []},
        {"ros_domain_ids": 7},
        {"ros_domain_ids": [-1]},
        {"ros_domain_ids": [2**32]},
        {"ros_domain_ids": [True]},
        {"ros_domain_ids": ["7"]},
        {"ros_domain_ids": [7, 7]},
        {"ros_domain_ids": list(range(257))},
        {"topic": ""},
        {"topic": "ros2_medkit/discovery"},
        {"topic": "/ros2_medkit/"},
        {"topic": 7},
        {"namespaces": "/fleet"},
        {"namespaces": ["fleet"]},
        {"namespaces": [""]},
        {"except_namespaces": [7]},
    )

    def __init__(self) -> None:
        super().__init__()
        self._router: tuple[zenoh.Session, str] | None = None
        self._strangers = Strangers()

    @property
    def endpoint(self) -> str:
        """Where the router listens."""
        if self._router is None:
            self._router = open_router()
        return self._router[1]

    def options(self, network: int = 0) -> RmwOptions:
        return RmwOptions(connect=(self.endpoint,), ros_domain_ids=(network,))

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        if not mortal:
            return super().announcer(period_s, network)
        announcer = ProcessAnnouncer(self.options(network), period_s, "beacon_zenoh.rmw")
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, ProcessAnnouncer)  # noqa: S101 - for the type checker
        announcer.end(signal.SIGKILL)

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return cdr.encode(hint, stamp_ns)

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:  # noqa: ARG002
        """With the number of a publisher, without which nobody of rmw_zenoh is heard, and no more:
        neither a number of the message nor a stamp, and no token."""
        options = self.options()
        gid = hashlib.md5(sender.encode(), usedforsecurity=False).digest()
        node = node_member(options.ros_domain_ids[0], gid.hex(), 0, "stranger")
        member = hint_member(node, Kind.PUBLISHER, 1, options.topic, DEFAULT_QOS)
        beside = attachment.encode(gid, 0, 0)
        self._strangers.put(sender, options, data_key(member.data_key), payload, beside)

    def close(self) -> None:
        super().close()
        self._strangers.close()
        if self._router is not None:
            self._router[0].close()  # type: ignore[no-untyped-call]
