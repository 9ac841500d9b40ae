"""Zenoh as the conduits' suite wants it, over the loopback interface; and an end to stop."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import cattrs
import zenoh

from beacon_core.ports.conduit import Conduit
from beacon_core.testing.relay.conduit_harness import ConduitCapabilities, RealTimeConduitHarness
from beacon_zenoh.harness import free_endpoint, open_router
from beacon_zenoh.relay import CONDUIT
from beacon_zenoh.relay.conduit import LEASE_S, LONGEST_WAIT_S
from beacon_zenoh.relay.options import RelayOptions

__all__ = ["ProcessEnd", "Wire", "ZenohConduitHarness", "ZenohRouterConduitHarness"]

_SEND_BYTES = 8 * 1024 * 1024


class ZenohConduitHarness(RealTimeConduitHarness):
    """The first end listens; there is a wire between it and each of the others, its clients."""

    capabilities = ConduitCapabilities()
    waiting_bytes = _SEND_BYTES
    # Last, what Zenoh gives itself to send the rest: the time between two signs of life.
    hang_told_within_s = LEASE_S + LONGEST_WAIT_S + LEASE_S / 4

    def __init__(self) -> None:
        self._endpoint = free_endpoint()
        self._wire = Wire(self._endpoint)
        self._made: list[Conduit] = []
        self._processes: list[ProcessEnd] = []

    def conduit(self) -> Conduit:
        options = self._client() if self._made else self._first()
        self._made.append(CONDUIT.conduit(options))
        return self._made[-1]

    def cut(self) -> None:
        self._wire.cut()

    def mend(self) -> None:
        self._wire.mend()

    @contextmanager
    def frozen(self) -> Iterator[ProcessEnd]:
        other = ProcessEnd(self._client())
        self._processes.append(other)
        other.linked()
        # Those here may not be yet, and would never be: what is not up refuses a frame.
        self.wait_until(
            lambda: all(one.send(b"linked?", b"") for one in self._made), self.patience_s
        )
        other.process.send_signal(signal.SIGSTOP)
        try:
            yield other
        finally:
            other.process.send_signal(signal.SIGCONT)

    def close(self) -> None:
        for one in self._made:
            one.close()
        for process in self._processes:
            process.end()
        self._wire.close()

    def _first(self) -> RelayOptions:
        return RelayOptions(listen=(self._endpoint,), send_bytes=_SEND_BYTES)

    def _client(self) -> RelayOptions:
        return RelayOptions(connect=(self._wire.endpoint,), send_bytes=_SEND_BYTES)


class ZenohRouterConduitHarness(ZenohConduitHarness):
    """All ends are clients of a router, which can be ended, and started again."""

    def __init__(self) -> None:
        super().__init__()
        self._router, self._at = open_router()

    def cut(self) -> None:
        self._router.close()  # type: ignore[no-untyped-call]

    def mend(self) -> None:
        config = zenoh.Config.from_json5(
            json.dumps(
                {
                    "mode": "router",
                    "listen": {"endpoints": [self._at]},
                    "scouting": {"multicast": {"enabled": False}},
                }
            )
        )
        self._router = zenoh.open(config)

    def close(self) -> None:
        super().close()
        self._router.close()  # type: ignore[no-untyped-call]

    def _first(self) -> RelayOptions:
        return self._client()

    def _client(self) -> RelayOptions:
        return RelayOptions(connect=(self._at,), send_bytes=_SEND_BYTES)


class ProcessEnd:
    """An end in a process of its own, which can be stopped and killed."""

    def __init__(self, options: RelayOptions) -> None:
        self.process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-m", __name__, json.dumps(cattrs.unstructure(options))],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def linked(self) -> None:
        """Wait until it has a link."""
        assert self.process.stdout is not None  # noqa: S101 - for the type checker
        assert self.process.stdout.readline() == b"up\n"  # noqa: S101 - what a test relies on

    def end(self) -> None:
        """Kill it."""
        self.process.kill()
        self.process.communicate()


class Wire:
    """Passes bytes on between whoever connects and an endpoint, until it is cut.

    Then, as on a cable that is pulled, nothing comes and nobody is told. When it is mended, both
    sides find that their connection is broken.
    """

    def __init__(self, to: str) -> None:
        self._to = _address(to)
        self._whole = threading.Event()
        self._whole.set()
        self._sockets: list[socket.socket] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"
        _in_background(self._accept)

    def cut(self) -> None:
        self._whole.clear()

    def mend(self) -> None:
        self._hang_up()
        self._whole.set()

    def close(self) -> None:
        _shut(self._listener)
        self._listener.close()
        self._hang_up()
        self._whole.set()

    def _hang_up(self) -> None:
        while self._sockets:
            _shut(self._sockets.pop())

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                one, _ = self._listener.accept()
                self._whole.wait()
                try:
                    other = socket.create_connection(self._to)
                except OSError:
                    one.close()
                    continue
                self._sockets += [one, other]
                _in_background(self._pump, one, other)
                _in_background(self._pump, other, one)

    def _pump(self, one: socket.socket, other: socket.socket) -> None:
        with one, suppress(OSError):
            while data := one.recv(65536):
                self._whole.wait()
                other.sendall(data)
        # The other direction's thread closes it.
        _shut(other)


def _address(endpoint: str) -> tuple[str, int]:
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    return host, int(port)


def _shut(end: socket.socket) -> None:
    with suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)


def _in_background(what: object, *args: object) -> None:
    threading.Thread(target=what, args=args, daemon=True).start()  # type: ignore[arg-type]


class _Announcing:
    """In the child: says when there is a link."""

    def frame(self, header: bytes, payload: bytes) -> None:
        """Nothing is done with it."""

    def link(self, *, up: bool) -> None:
        if up:
            print("up", flush=True)  # noqa: T201 - whoever made us waits for it


if __name__ == "__main__":
    _conduit = CONDUIT.conduit(cattrs.structure(json.loads(sys.argv[1]), RelayOptions))
    _conduit.start(_Announcing())
    sys.stdin.read()
    _conduit.close()
