"""ROS parameters as the contract suite wants them, in ROS domains of their own."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.testing.harness import Capabilities, RealTimeHarness
from beacon_core.wire import json
from beacon_ros.domains import DomainLease
from beacon_ros.mortal import MortalAnnouncer
from beacon_ros_param import ADAPTER
from beacon_ros_param.announcer import RosParamAnnouncer
from beacon_ros_param.options import RosParamOptions
from beacon_ros_param.source import RosParamSource

__all__ = ["RosParamHarness"]


class RosParamHarness(RealTimeHarness):
    """A :class:`beacon_core.testing.harness.Harness`; each ``network`` is a ROS domain."""

    adapter: Adapter = ADAPTER
    capabilities = Capabilities(
        every_word=False,  # between two polls a hint may change more than once
        pushes=False,
        vouches_for_ids=False,
        raw_payloads=False,  # parameters have types
        nul_in_text=False,
    )
    patience_s = 60.0  # 400 nodes are created, and found, in one process
    bad_options: Sequence[Mapping[str, Any]] = (
        {"domain_id": -1},
        {"domain_id": 233},
        {"domain_id": True},
        {"targets": "/driver"},
        {"targets": ["driver"]},
        {"targets": ["/arm/"]},
        {"targets": [7]},
        {"interval_s": 0.0},
        {"interval_s": 0.09},
        {"interval_s": "5"},
        {"interval_s": float("nan")},
        {"budget_s": float("inf")},
        {"timeout_s": -1},
        {"max_in_flight": 0},
        {"max_in_flight": 1.5},
        {"forget_after_s": -1.0},
        {"forget_after_s": None},
        {"parameter_events": "on"},
    )

    def __init__(self, *, parameter_events: bool = True) -> None:
        super().__init__()
        self._parameter_events = parameter_events
        self._domains: dict[int, DomainLease] = {}

    def options(self, network: int = 0) -> RosParamOptions:
        if network not in self._domains:
            self._domains[network] = DomainLease()
        return RosParamOptions(
            domain_id=self._domains[network].domain_id,
            interval_s=0.1,
            parameter_events=self._parameter_events,
        )

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        if not mortal:
            return super().announcer(period_s, network)
        announcer = MortalAnnouncer("beacon_ros_param", self.options(network), period_s)
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, MortalAnnouncer)  # noqa: S101 - for the type checker
        announcer.end(signal.SIGKILL)

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        if isinstance(announcer, MortalAnnouncer):
            return announcer.stopped()
        assert isinstance(announcer, RosParamAnnouncer)  # noqa: S101 - for the type checker
        return _busy(announcer)

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return json.encode(hint, stamp_ns)

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:
        raise NotImplementedError

    def close(self) -> None:
        # First the sources: an announcer waits for those who ask to notice its goodbye.
        self._made.sort(key=lambda one: isinstance(one, RosParamSource))
        super().close()
        for lease in self._domains.values():
            lease.close()


@contextmanager
def _busy(announcer: RosParamAnnouncer) -> Iterator[None]:
    begun, over = threading.Event(), threading.Event()

    def be_busy() -> None:
        begun.set()
        over.wait()

    announcer.spinner.run(be_busy, within_s=0.0)
    begun.wait()
    yield
    over.set()
