"""A ROS topic as the contract suite wants it, in ROS domains of its own; and announcers to kill."""

from __future__ import annotations

import signal
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from rclpy.publisher import Publisher

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.testing.harness import Capabilities, RealTimeHarness
from beacon_core.testing.hostile import HOSTILE_CDR
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.domains import DomainLease
from beacon_ros.mortal import MortalAnnouncer
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros_topic import ADAPTER
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import profile

__all__ = ["RosTopicHarness"]


class RosTopicHarness(RealTimeHarness):
    """A :class:`beacon_core.testing.harness.Harness`; each ``network`` is a ROS domain."""

    adapter: Adapter = ADAPTER
    capabilities = Capabilities(
        vouches_for_ids=False,
        empty_payloads=False,  # DDS has no sample without data; test_topic_traps.py has the rest
    )
    quiet_s = 0.15  # within one machine what comes comes within a few ms
    hostile_payloads: Mapping[str, bytes] = HOSTILE_CDR
    bad_options: Sequence[Mapping[str, Any]] = (
        {"topic": ""},
        {"topic": "ros2_medkit/discovery"},
        {"topic": "/ros2_medkit/"},
        {"topic": "/2fast"},
        {"topic": 7},
        {"domain_id": -1},
        {"domain_id": 233},
        {"domain_id": True},
        {"domain_id": "7"},
        {"reliability": "mostly"},
        {"reliability": None},
        {"durability": "persistent"},
        {"depth": 0},
        {"depth": 1.5},
        {"depth": 10**7},
    )

    def __init__(self) -> None:
        super().__init__()
        self._domains: dict[int, DomainLease] = {}
        self._strangers: dict[str, tuple[OwnNode, Publisher]] = {}

    def options(self, network: int = 0) -> RosTopicOptions:
        if network not in self._domains:
            self._domains[network] = DomainLease()
        return RosTopicOptions(domain_id=self._domains[network].domain_id)

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        if not mortal:
            return super().announcer(period_s, network)
        announcer = MortalAnnouncer("beacon_ros_topic", self.options(network), period_s)
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, MortalAnnouncer)  # noqa: S101 - for the type checker
        announcer.end(signal.SIGKILL)

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        # For some seconds it tells a listener once more whom it has just met.
        if isinstance(announcer, MortalAnnouncer):
            return announcer.stopped()
        return super().silenced(announcer)

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return cdr.encode(hint, stamp_ns)

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:  # noqa: ARG002
        if sender not in self._strangers:
            self._strangers[sender] = self._stranger()
        self._strangers[sender][1].publish(payload)

    def close(self) -> None:
        super().close()
        for node, _ in self._strangers.values():
            node.close()
        for lease in self._domains.values():
            lease.close()

    def _stranger(self) -> tuple[OwnNode, Publisher]:
        """A publisher that the sources there are have found."""
        options = self.options()
        own = OwnNode("stranger", options.domain_id)
        publisher = own.node.create_publisher(
            message_type(TYPE_NAME, TYPE_HASH), options.topic, profile(options)
        )
        self.wait_until(lambda: publisher.get_subscription_count() > 0, self.patience_s)
        return own, publisher
