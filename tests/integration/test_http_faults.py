"""Clients that misbehave: the others do not notice, memory stays bounded, and no hint is lost.

A gateway in a process of its own, real Zenoh into it, real sockets at it. A quiet client asks
before and during each trouble; what it sees during is compared with what it saw before, in the same
run, because a machine that tests run on is busy.
"""

from __future__ import annotations

import json
import logging
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import attrs
import httpx
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.ports.announcer import Announcer
from beacon_gateway.adapters import load_adapter
from beacon_gateway.server import allow_connections

pytestmark = pytest.mark.system

_log = logging.getLogger(__name__)

ROBOTS = 50
_WITHIN_S = 30.0

SLACK, FLOOR_S = 10.0, 0.5
"""During trouble a quiet client may wait ten times as long as before, or half a second: one
that is held up by a slow one waits for seconds."""

GROWTH_BYTES = 150 * 1024 * 1024
"""What all troubles together may add. Two thousand connections take some ten kilobytes each."""


@attrs.frozen
class Shop:
    """A gateway that hears ``ROBOTS`` robots, each twice a second."""

    process: subprocess.Popen[str]
    url: str
    announcer: Announcer

    def chatter(self, seconds: float) -> None:
        """Let the robots say something new all the time: every stream has much to tell."""
        end_s, round_ = time.monotonic() + seconds, 0
        while time.monotonic() < end_s:
            round_ += 1
            for number in range(ROBOTS):
                self.announcer.announce(_hint(number, f"{round_}"))
            # Each robot may say a hundred things a second; this is a tenth of that.
            time.sleep(0.1)

    @property
    def address(self) -> tuple[str, int]:
        host, port = self.url.removeprefix("http://").split(":")
        return host, int(port)

    def connect(self, receive_bytes: int = 0) -> socket.socket:
        client = socket.socket()
        if receive_bytes:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        client.settimeout(5)
        client.connect(self.address)
        return client

    def memory(self) -> int:
        text = Path(f"/proc/{self.process.pid}/statm").read_text()
        return int(text.split()[1]) * os.sysconf("SC_PAGE_SIZE")

    def messages(self) -> dict[str, int]:
        source = httpx.get(f"{self.url}/api/v1/health", timeout=10).json()["x-medkit-beacon"]
        counted: dict[str, int] = source["sources"][0]["messages"]
        return counted

    def active(self) -> int:
        items = httpx.get(f"{self.url}/api/v1/apps", timeout=10).json()["items"]
        states = [item["x-medkit"].get("beacon", {}).get("status") for item in items]
        return states.count("active")

    def p99_s(self, seconds: float) -> float:
        """What one quiet client waits, at the 99th percentile."""
        waits, end_s = [], time.monotonic() + seconds
        with httpx.Client(base_url=self.url, timeout=10) as client:
            while time.monotonic() < end_s:
                began = time.monotonic()
                assert client.get("/api/v1/apps/robot_1/x-medkit-beacon").status_code == 200
                waits.append(time.monotonic() - began)
                time.sleep(0.005)
        assert len(waits) > 20
        return sorted(waits)[int(len(waits) * 0.99)]


def _hint(number: int, news: str = "") -> BeaconHint:
    return BeaconHint(f"robot_{number}", display_name=news, metadata={"text": "x" * 500})


def eventually(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _WITHIN_S
    while not true():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    with closing(socket.create_server(("127.0.0.1", 0))) as bound:
        endpoint = f"tcp/127.0.0.1:{bound.getsockname()[1]}"
    path = tmp_path_factory.mktemp("faults") / "gateway.yaml"
    options = f"{{mode: router, listen: [{endpoint}]}}"
    path.write_text(
        f"http: {{port: 0}}\nsources: {{robots: {{adapter: zenoh, options: {options}}}}}\n"
    )
    command = [sys.executable, "-m", "beacon_gateway", "run", "-c", str(path), "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        try:
            assert process.stdout is not None
            url = json.loads(process.stdout.readline())["url"]
            adapter = load_adapter("zenoh")
            with closing(adapter.announcer(adapter.options(connect=(endpoint,)), 0.5)) as announcer:
                shop = Shop(process, url, announcer)
                for number in range(ROBOTS):
                    announcer.announce(_hint(number))
                eventually(lambda: shop.active() == ROBOTS)
                yield shop
        finally:
            process.terminate()
            process.wait(10)


@contextmanager
def unharmed(shop: Shop) -> Iterator[None]:
    """What happens within harms nobody but whoever does it."""
    before_s, memory, heard = shop.p99_s(1.5), shop.memory(), shop.messages()
    began = time.monotonic()
    seen: list[float] = []

    def look() -> None:
        with suppress(AssertionError, httpx.HTTPError):
            seen.append(shop.p99_s(3.0))

    looking = threading.Thread(target=look)
    looking.start()
    yield
    looking.join()
    assert seen, "somebody was refused, or waited for too long"
    _log.info("p99: %.1f ms before, %.1f ms during", before_s * 1e3, seen[0] * 1e3)
    _log.info("memory: %+.1f MB", (shop.memory() - memory) / 1e6)
    assert seen[0] < max(SLACK * before_s, FLOOR_S), f"{seen[0]:.3f} s, before {before_s:.3f} s"
    assert shop.memory() - memory < GROWTH_BYTES
    after = shop.messages()
    spoken = sum(after[one] - heard[one] for one in ("refreshed", "changed"))
    # Each robot speaks twice a second; the last beats may be under way.
    assert spoken >= 0.8 * ROBOTS * 2 * (time.monotonic() - began) - ROBOTS
    for verdict in ("source-rate", "global-rate", "store-full", "malformed", "invalid", "fault"):
        assert after[verdict] == heard[verdict] == 0
    # A machine that stood still longer than a lease has lost them for a moment.
    eventually(lambda: shop.active() == ROBOTS)


LISTING = b"GET /api/v1/apps HTTP/1.1\r\nHost: x\r\n\r\n"
STREAM = b"GET /api/v1/x-medkit-beacon/stream HTTP/1.1\r\nHost: x\r\n\r\n"


def test_clients_that_read_slowly(shop: Shop) -> None:
    with ExitStack() as stack, unharmed(shop):
        clients = [stack.enter_context(shop.connect(4096)) for _ in range(100)]
        for client in clients:
            # More than fits into what is between, so that the gateway must wait for them.
            client.sendall(LISTING * 4)
            time.sleep(0.005)
        for _ in range(20):
            for client in clients:
                client.recv(64)
            time.sleep(0.1)


def test_clients_that_never_read_their_stream(shop: Shop) -> None:
    with ExitStack() as stack, unharmed(shop):
        for _ in range(200):
            stack.enter_context(shop.connect(2048)).sendall(STREAM)
        shop.chatter(2.5)


def test_connections_that_are_opened_and_left(shop: Shop) -> None:
    with ExitStack() as stack, unharmed(shop):
        for number in range(500):
            client = stack.enter_context(shop.connect())
            client.sendall(LISTING[: number % len(LISTING)])


def test_two_thousand_connections(shop: Shop) -> None:
    allow_connections(2000)
    with ExitStack() as stack, unharmed(shop):
        clients = [stack.enter_context(shop.connect()) for _ in range(2000)]
        one = b"GET /api/v1/apps/robot_1 HTTP/1.1\r\nHost: x\r\n\r\n"
        for client in clients[::20]:
            client.sendall(one)
        for client in clients[::20]:
            assert client.recv(65536).startswith(b"HTTP/1.1 200 ")


MALFORMED = [
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\x00" * 200,
    b"\r\n" * 1000,
    b"GET\r\n\r\n",
    b"GET / HTTP/1.1\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello",
    b"POST /api/v1/apps HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nFFFFFFFFFF\r\n",
    b"GET /" + b"%00" * 100 + b" HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET /api/v1/apps/" + b"%" * 100 + b" HTTP/1.1\r\nHost: x\r\n\r\n",
    b"\xff" * 5000,
]


def test_bytes_that_are_no_http(shop: Shop) -> None:
    with unharmed(shop):
        for nonsense in MALFORMED * 25:
            with shop.connect() as client, suppress(ConnectionError):
                client.sendall(nonsense)
                client.shutdown(socket.SHUT_WR)
                said = client.recv(65536)
                assert not said or said.startswith((b"HTTP/1.1 4", b"HTTP/1.0 4"))


def test_heads_without_end(shop: Shop) -> None:
    def pour(client: socket.socket) -> int:
        sent = 0
        with suppress(OSError):
            client.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
            for _ in range(1000):
                client.sendall(b"X-More: " + b"y" * 4000 + b"\r\n")
                sent += 4010
        return sent

    with unharmed(shop):
        for _ in range(50):
            with shop.connect() as client:
                assert pour(client) < 4_000_000


def test_clients_that_come_and_break_off(shop: Shop) -> None:
    reset = attrs.astuple(_Linger())
    with unharmed(shop):
        for number in range(500):
            with shop.connect() as client:
                client.sendall(STREAM if number % 2 else LISTING)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _struct(*reset))
        eventually(lambda: _open_files(shop) < 200)


@attrs.frozen
class _Linger:
    on: int = 1
    seconds: int = 0


def _struct(*numbers: int) -> bytes:
    return b"".join(number.to_bytes(4, sys.byteorder) for number in numbers)


def _open_files(shop: Shop) -> int:
    return len(list(Path(f"/proc/{shop.process.pid}/fd").iterdir()))


def test_afterwards_everything_is_given_back(shop: Shop) -> None:
    eventually(lambda: _open_files(shop) < 200)
    metrics: Any = httpx.get(f"{shop.url}/metrics", timeout=10).text
    assert "process_open_fds" in metrics
