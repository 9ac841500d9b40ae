"""The HTTP interface beside a bare route: the same bytes, the same server, in one run.

    python bench/http_interface.py            ratios
    python bench/http_interface.py --quick    to see that it runs
    python bench/http_interface.py --profile  where the time of one request goes

Each is served in a process of its own, the gateway as ``beacon run`` does it, the bare route by
plain uvicorn. One client asks over one connection, as fast as it is answered, now here and now
there in short turns. Turns that follow each other make a pair, and the median of the pairs' ratios
counts: whatever else the machine does meets both of a pair alike. So what is compared is the whole
request, socket and HTTP included: how much of a bare server's rate is left. The stores are
refreshed all the while, as a fleet does. Beside it: the processor time of each request (Linux).
"""

from __future__ import annotations

import asyncio
import contextlib
import cProfile
import multiprocessing
import pstats
import socket
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from beacon_core.clock import SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.wire.json import encode
from beacon_fake import FakeNetwork, share_network
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer
from measure import Report, options

ENTITIES = 1_000
REFRESHED_EACH_S = 10.0

ONE = "/api/v1/apps/app_0500/x-medkit-beacon"
ALL = "/api/v1/apps"

AT_LEAST = {ONE: 0.9, ALL: 0.8}


def main() -> None:
    asked = options()
    if asked.profile:
        profile()
        return
    report = Report(f"requests per second as a share of a bare route's, {ENTITIES} entities")
    rounds, seconds = (3, 0.1) if asked.quick else (100, 0.15)
    for path, at_least in AT_LEAST.items():
        found = compared(path, rounds, seconds)
        gateway, bare_, afresh = (found[name] for name in ("gateway", "bare", "afresh"))
        ratios = bare_.over(gateway)
        tenths = statistics.quantiles(ratios, n=10)
        report.line(f"{path}: {gateway.cost_us:.0f} us of processor time, bare {bare_.cost_us:.0f}")
        report.ratio(f"bare / gateway, {path}", statistics.median(ratios), 1 / at_least)
        report.line(f"  of ten pairs eight between {tenths[0]:.3f} and {tenths[-1]:.3f}")
        report.ratio("  the same by processor time", gateway.cost_us / bare_.cost_us)
        report.ratio("  bare / made afresh", statistics.median(bare_.over(afresh)))
    report.finish(check=asked.check)


class Found:
    """What was measured of one server."""

    def __init__(self) -> None:
        self._rates: list[float] = []
        self._spent_ns = self._requests = 0

    def add(self, rate: float, requests: int, spent_ns: int) -> None:
        self._rates.append(rate)
        self._spent_ns += spent_ns
        self._requests += requests

    def over(self, other: Found) -> list[float]:
        """How many times the other's rate, in each of the rounds."""
        return [mine / theirs for mine, theirs in zip(self._rates, other._rates, strict=True)]

    @property
    def cost_us(self) -> float:
        """Processor time of a request."""
        return self._spent_ns / self._requests / 1e3


def compared(path: str, rounds: int, seconds: float) -> dict[str, Found]:
    """One client that asks each in turn."""
    found = {name: Found() for name in ("afresh", "gateway", "bare")}
    with contextlib.ExitStack() as stack:
        servers: dict[str, tuple[int, int]] = {}
        for name in found:
            answer = Client(*servers["gateway"]).get(path) if name == "bare" else b""
            servers[name] = stack.enter_context(served(name, path, answer))
        # Only now: a connection that says nothing while another server starts is closed.
        clients = {name: Client(*server) for name, server in servers.items()}
        sizes = {name: len(client.get(path)) for name, client in clients.items()}
        assert max(sizes.values()) < 1.02 * min(sizes.values()), sizes
        for number in range(rounds):
            # Nobody is always first: what is left by the turn before meets each of them.
            for name in reversed(found) if number % 2 else found:
                found[name].add(*clients[name].turn(path, seconds))
    return found


class Client:
    """One connection, and nothing between: what it costs itself is a few microseconds."""

    def __init__(self, port: int, pid: int) -> None:
        # The kernel's name for the clock of another process (clock_getcpuclockid).
        self._clock = (~pid << 3) | 2
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer = bytearray(4 * 1024 * 1024)

    def get(self, path: str) -> bytes:
        self._socket.sendall(f"GET {path} HTTP/1.1\r\nHost: bench\r\n\r\n".encode())
        view, got, whole = memoryview(self._buffer), 0, 0
        while not whole or got < whole:
            if not (read := self._socket.recv_into(view[got:])):
                raise ConnectionError("the server closed the connection")
            got += read
            if not whole and (head := self._buffer.find(b"\r\n\r\n", 0, got)) >= 0:
                head_text = bytes(self._buffer[:head]).lower()
                assert head_text.startswith(b"http/1.1 200"), head_text
                length = head_text.partition(b"content-length: ")[2].partition(b"\r\n")[0]
                whole, body = head + 4 + int(length), head + 4
        return bytes(view[body:whole])

    def turn(self, path: str, seconds: float) -> tuple[float, int, int]:
        """Requests per second for so long; their number; the processor time they took."""
        start, spent_ns = time.perf_counter(), time.clock_gettime_ns(self._clock)
        count = 0
        while (now := time.perf_counter()) - start < seconds:
            self.get(path)
            count += 1
        return count / (now - start), count, time.clock_gettime_ns(self._clock) - spent_ns


@contextlib.contextmanager
def served(name: str, path: str, answer: bytes) -> Iterator[tuple[int, int]]:
    """A server in a process of its own; its port, and its process."""
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(
        target=serve, args=(name, path, answer, theirs), daemon=True
    )
    process.start()
    try:
        assert process.pid is not None
        yield ours.recv(), process.pid
    finally:
        process.terminate()
        process.join()


def serve(name: str, path: str, answer: bytes, pipe: Connection) -> None:
    if name == "bare":
        serve_bare(bare(path, answer), pipe)
        return
    app = gateway_app(afresh=name == "afresh")
    with contextlib.closing(HttpServer("127.0.0.1", 0)) as server:
        pipe.send(int(server.url.rpartition(":")[2]))
        server.serve(app)


def serve_bare(app: Starlette, pipe: Connection) -> None:
    # Without TCP named, as by create_server, asyncio leaves the delay of sending on.
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP) as bound:
        bound.bind(("127.0.0.1", 0))
        bound.listen()
        pipe.send(bound.getsockname()[1])
        config = uvicorn.Config(app, log_config=None, access_log=False, lifespan="off", ws="none")
        uvicorn.Server(config).run(sockets=[bound])


def bare(path: str, answer: bytes) -> Starlette:
    """One route that gives these bytes."""

    async def give(_: Request) -> Response:
        return Response(answer, media_type="application/json")

    return Starlette(routes=[Route(path, give)])


def gateway_app(*, afresh: bool = False) -> Starlette:
    """A gateway with so many entities, which are all refreshed again and again."""
    if afresh:
        from beacon_gateway.http import snapshots  # noqa: PLC0415 - in this process only

        snapshots.LONGEST_NS = -1
    clock = SystemClock()
    network = f"bench, kept: {not afresh}"
    share_network(FakeNetwork(clock), network)
    source = {"adapter": "fake", "ttl_s": 3 * REFRESHED_EACH_S}
    document = {"sources": {"robots": {**source, "options": {"network": network}}}}
    gateway = Gateway(parse_config(document).config, clock=clock)
    intake = gateway.listeners[0].intake
    payloads = [encode(hint(number)) for number in range(ENTITIES)]

    def refresh() -> None:
        while True:
            for number, payload in enumerate(payloads):
                intake.offer(payload, f"sender {number // 50}")
                time.sleep(REFRESHED_EACH_S / ENTITIES)

    for number, payload in enumerate(payloads):
        assert intake.offer(payload, f"sender {number // 50}").entity_id
    gateway.start()
    threading.Thread(target=refresh, daemon=True).start()
    return create_app(gateway)


def hint(number: int) -> BeaconHint:
    return BeaconHint(
        f"app_{number:04}",
        display_name=f"Application {number}",
        component_id=f"ecu_{number % 20}",
        hostname=f"robot-{number % 20}",
        process_id=1000 + number,
        process_name="app",
        transport_type="zenoh",
        metadata={"firmware": "1.2.3", "vendor": "acme"},
    )


def profile() -> None:
    """Where the time of one request goes, without sockets; kept answers, then made afresh."""
    for afresh in (False, True):
        app = gateway_app(afresh=afresh)
        for path in AT_LEAST:
            print(f"\n{path}, {'made afresh' if afresh else 'kept'}")
            profiled(app, path, 20 if afresh else 2_000)


def profiled(app: Starlette, path: str, times: int) -> None:
    scope: dict[str, Any] = {
        "type": "http",
        "method": "GET",
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "query_string": b"",
        "headers": [(b"host", b"bench")],
        "scheme": "http",
        "server": ("127.0.0.1", 80),
        "client": ("127.0.0.1", 1),
        "http_version": "1.1",
    }

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        del message

    async def ask() -> None:
        for _ in range(times):
            await app(dict(scope), receive, send)

    asyncio.run(ask())
    profiler = cProfile.Profile()
    start = time.perf_counter()
    profiler.runcall(asyncio.run, ask())
    print(f"{(time.perf_counter() - start) / times * 1e6:.0f} us each, being profiled")
    pstats.Stats(profiler, stream=sys.stdout).sort_stats("tottime").print_stats(14)


if __name__ == "__main__":
    main()
