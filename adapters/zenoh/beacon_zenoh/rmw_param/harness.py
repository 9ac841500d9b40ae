"""Parameters over rmw_zenoh as the contract suite wants them; announcers to stop and to kill."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.testing.harness import Capabilities, RealTimeHarness
from beacon_core.wire import json
from beacon_zenoh.harness import ProcessAnnouncer, open_router
from beacon_zenoh.rmw_param import ADAPTER
from beacon_zenoh.rmw_param.announcer import RmwParamAnnouncer
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.source import RmwParamSource

__all__ = ["RmwParamHarness"]


class RmwParamHarness(RealTimeHarness):
    """A :class:`beacon_core.testing.harness.Harness`: one router, and each ``network`` is a ROS
    domain."""

    adapter: Adapter = ADAPTER
    capabilities = Capabilities(
        every_word=False,  # between two polls a hint may change more than once
        pushes=False,
        vouches_for_ids=False,
        raw_payloads=False,  # parameters have types
        nul_in_text=False,
    )
    patience_s = 60.0  # 400 nodes are found, and asked, in one process
    bad_options: Sequence[Mapping[str, Any]] = (
        {"mode": "server"},
        {"connect": "tcp/127.0.0.1:7447"},
        {"ros_domain_ids": []},
        {"ros_domain_ids": [-1]},
        {"ros_domain_ids": [7, 7]},
        {"namespaces": "/fleet"},
        {"except_namespaces": ["fleet"]},
        {"targets": "/driver"},
        {"targets": ["driver"]},
        {"targets": ["/arm/"]},
        {"interval_s": 0.0},
        {"interval_s": "5"},
        {"interval_s": float("nan")},
        {"budget_s": float("inf")},
        {"timeout_s": -1},
        {"max_in_flight": 0},
        {"max_in_flight": 1.5},
        {"parameter_events": "on"},
    )

    def __init__(self, *, parameter_events: bool = True) -> None:
        super().__init__()
        self._parameter_events = parameter_events
        self._router: tuple[zenoh.Session, str] | None = None

    @property
    def endpoint(self) -> str:
        """Where the router listens."""
        if self._router is None:
            self._router = open_router()
        return self._router[1]

    def options(self, network: int = 0) -> RmwParamOptions:
        return RmwParamOptions(
            connect=(self.endpoint,),
            ros_domain_ids=(network,),
            interval_s=0.1,
            parameter_events=self._parameter_events,
        )

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        if not mortal:
            return super().announcer(period_s, network)
        announcer = ProcessAnnouncer(self.options(network), period_s, "beacon_zenoh.rmw_param")
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, ProcessAnnouncer)  # noqa: S101 - for the type checker
        announcer.end(signal.SIGKILL)

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        if isinstance(announcer, ProcessAnnouncer):
            return _stopped(announcer)
        assert isinstance(announcer, RmwParamAnnouncer)  # noqa: S101 - for the type checker
        return announcer.answering

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return json.encode(hint, stamp_ns)

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:
        raise NotImplementedError

    def close(self) -> None:
        # First the sources: an announcer waits for those who ask to notice its goodbye.
        self._made.sort(key=lambda one: isinstance(one, RmwParamSource))
        super().close()
        if self._router is not None:
            self._router[0].close()  # type: ignore[no-untyped-call]


@contextmanager
def _stopped(announcer: ProcessAnnouncer) -> Iterator[None]:
    announcer.process.send_signal(signal.SIGSTOP)
    yield
    announcer.process.send_signal(signal.SIGCONT)
