"""Zenoh as the contract suite wants it, over the loopback interface; and announcers to kill."""

from __future__ import annotations

import importlib
import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import attrs
import cattrs
import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter, Malformed
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.source import HintSource
from beacon_core.testing.harness import RealTimeHarness
from beacon_core.testing.waiting import wait_until
from beacon_core.wire import json as wire
from beacon_zenoh import ADAPTER
from beacon_zenoh.config import session_config
from beacon_zenoh.keys import Keys
from beacon_zenoh.options import SessionOptions, ZenohOptions
from beacon_zenoh.probe import place, why_unreachable

__all__ = [
    "OwnRouterHarness",
    "ProcessAnnouncer",
    "Strangers",
    "ZenohHarness",
    "free_endpoint",
    "open_router",
]


class ZenohHarness(RealTimeHarness):
    """A :class:`beacon_core.testing.harness.Harness`; each ``network`` is a router of its own.

    The router belongs to none of the sources, which are its clients, so that any number of them
    can come and go.
    """

    adapter: Adapter = ADAPTER
    quiet_s = 0.15  # over loopback what comes comes within a few ms
    bad_options: Sequence[Mapping[str, Any]] = (
        {"mode": "server"},
        {"mode": ["client"]},
        {"connect": "tcp/127.0.0.1:7447"},
        {"connect": ["127.0.0.1:7447"]},
        {"connect": [7447]},
        {"listen": ["carrier-pigeon/127.0.0.1:7447"]},
        {"prefix": ""},
        {"prefix": "/beacon"},
        {"prefix": "beacon/**"},
        {"prefix": "b" * 129},
        {"user": "robot-1"},
        {"user": 1},
        {"password": "secret"},
        {"users_file": None},
        {"tls": "ca.pem"},
        {"config_file": 7},
        {"config": ["mode", "client"]},
    )

    def __init__(self) -> None:
        super().__init__()
        self._routers: dict[int, tuple[zenoh.Session, str]] = {}
        self._strangers = Strangers()

    def options(self, network: int = 0) -> ZenohOptions:
        if network not in self._routers:
            self._routers[network] = open_router()
        return ZenohOptions(mode="client", connect=(self._routers[network][1],))

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        if not mortal:
            return super().announcer(period_s, network)
        announcer = ProcessAnnouncer(self.options(network), period_s)
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, ProcessAnnouncer)  # noqa: S101 - for the type checker
        announcer.end(signal.SIGKILL)

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return wire.encode(hint, stamp_ns)

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:
        options = self.options()
        self._strangers.put(sender, options, Keys(options.prefix).hint(entity_id), payload)

    def close(self) -> None:
        super().close()
        self._strangers.close()
        for session, _ in self._routers.values():
            session.close()  # type: ignore[no-untyped-call]


class OwnRouterHarness(ZenohHarness):
    """The default in place of a router: on each ``network`` the first source is the router.

    The others are its clients and hear nothing without it. When it is closed, the next source that
    is made takes its place, at the same endpoint.
    """

    def __init__(self) -> None:
        super().__init__()
        self._endpoints: dict[int, str] = {}
        self._first: dict[int, HintSource] = {}

    def options(self, network: int = 0) -> ZenohOptions:
        endpoint = self._endpoints.setdefault(network, free_endpoint())
        return ZenohOptions(mode="client", connect=(endpoint,))

    def source(self, network: int = 0) -> HintSource:
        first = self._first.get(network)
        if first is not None and first.health().condition is not Condition.CLOSED:
            return super().source(network)
        (endpoint,) = self.options(network).connect
        # Closing does not wait for Zenoh for ever: the port may still be taken.
        self.wait_until(lambda: _is_free(endpoint), self.patience_s)
        source = self.adapter.source(ZenohOptions(listen=(endpoint,)))
        self._first[network] = source
        self._made.append(source)
        return source


class Strangers:
    """People who put what they like, each on a session of their own."""

    def __init__(self) -> None:
        self._sessions: dict[str, zenoh.Session] = {}
        self._publishers: dict[tuple[str, str], zenoh.Publisher] = {}

    def put(
        self,
        sender: str,
        options: SessionOptions,
        key: str,
        payload: bytes,
        attachment: bytes | None = None,
    ) -> None:
        """Once somebody who listens is known at this end: until the router has told of it, what is
        put is lost."""
        if (sender, key) not in self._publishers:
            # To wait, as a reliable publisher that keeps all: the suite counts what arrives.
            self._publishers[sender, key] = self._session(sender, options).declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK
            )
        publisher = self._publishers[sender, key]
        known = wait_until(lambda: _matching(publisher), 30.0, pause_s=0.001)
        assert known, f"nobody listens to {key}"  # noqa: S101 - what a test relies on
        publisher.put(payload, attachment=attachment)

    def close(self) -> None:
        for session in self._sessions.values():
            session.close()  # type: ignore[no-untyped-call]

    def _session(self, sender: str, options: SessionOptions) -> zenoh.Session:
        if sender not in self._sessions:
            self._sessions[sender] = zenoh.open(session_config(options, "client").make())
        return self._sessions[sender]


class ProcessAnnouncer:
    """An announcer in a process of its own, which can be killed, stopped and interrupted."""

    def __init__(
        self,
        options: SessionOptions,
        period_s: float | None = None,
        package: str = "beacon_zenoh",
    ) -> None:
        """``options`` are those of the adapter of that package."""
        plain = json.dumps([package, cattrs.unstructure(options), period_s])
        self.process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-m", __name__, plain], stdin=subprocess.PIPE
        )

    def announce(self, hint: BeaconHint) -> None:
        self._tell("announce", wire.encode(hint).decode())

    def withdraw(self, entity_id: str) -> None:
        self._tell("withdraw", entity_id)

    def close(self) -> None:
        self.end(signal.SIGINT)

    def health(self) -> Health:
        """Of the process alone: how its connection is doing is not told here."""
        return Health(Condition.UP if self.process.poll() is None else Condition.CLOSED)

    def end(self, number: signal.Signals | None) -> int:
        """Send the signal (``None``: let it run off its end, without ``close``), and wait.

        Returns the exit code.
        """
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        if number is None:
            self.process.stdin.close()
        else:
            self.process.send_signal(number)
        code = self.process.wait(10)
        self.process.stdin.close()
        return code

    def _tell(self, *words: str) -> None:
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        self.process.stdin.write(json.dumps(words).encode() + b"\n")
        self.process.stdin.flush()


def free_endpoint() -> str:
    """A TCP endpoint of this machine at which nobody listens yet."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def open_router(options: ZenohOptions | None = None) -> tuple[zenoh.Session, str]:
    """A router that is nothing else, and its endpoint."""
    while True:
        endpoint = free_endpoint()
        listening = attrs.evolve(options or ZenohOptions(), listen=(endpoint,))
        try:
            return zenoh.open(session_config(listening, "router").make()), endpoint
        except zenoh.ZError:  # somebody else took the port meanwhile
            continue


def _is_free(endpoint: str) -> bool:
    """Does nobody listen there?"""
    at = place(endpoint)
    return at is None or bool(why_unreachable(at, 1.0))


def _matching(publisher: Any) -> bool:
    """Does anybody listen to it? (The stub of ``matching_status`` has another type.)"""
    return bool(publisher.matching_status.matching)


def _obey(announcer: Announcer, orders: Iterable[bytes | str]) -> None:
    """In the child: obey. Interrupted it says goodbye; at the end of its orders it vanishes."""
    try:
        for order in orders:
            verb, text = json.loads(order)
            if verb == "withdraw":
                announcer.withdraw(text)
                continue
            announcement = wire.decode(text.encode())
            assert not isinstance(announcement, Malformed), announcement  # noqa: S101
            announcer.announce(announcement.hint)
    except KeyboardInterrupt:
        announcer.close()


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    _package, _plain, _period_s = json.loads(sys.argv[1])
    _adapter: Adapter = importlib.import_module(_package).ADAPTER
    _options = cattrs.structure(_plain, _adapter.options)
    # A signal that comes to another thread does not end this one's waiting for orders: so those
    # that Zenoh makes take none.
    _stops = {signal.SIGINT, signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, _stops)
    _announcer = _adapter.announcer(_options, _period_s)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _stops)
    _obey(_announcer, sys.stdin.buffer)
