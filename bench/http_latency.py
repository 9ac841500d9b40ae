"""How long an answer takes while a fleet speaks and people watch, beside a bare route.

    python bench/http_latency.py [--quick]

A real ``beacon run``, the router of a real Zenoh network: 10,000 entities are each heard once in 10
seconds, and 100 clients have the live stream open; then the same with one of a hundred hints saying
something else than before. One client asks a thousand times a second for the beacon of one of them
at random, on 16 connections that stay open.

The client asks when it is time to, not when it has been answered, and an answer's time counts from
when it should have been asked for: nobody who had to wait is left out. A bare Starlette route with
an answer as long is asked in the same way, in turns: machine, client and uvicorn are in both.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import random
import select
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

from beacon_core.testing.examples import bench_hint
from beacon_zenoh.harness import free_endpoint
from http_interface import bare, serve_bare
from measure import Report, options

ENTITIES = 10_000
EACH_S = 10.0
STREAMS = 100
RATE = 1_000.0
CONNECTIONS = 16
HEARD_WITHIN_S = 60.0
P99_MS = 5.0
"""What is promised, on a machine that is free for it."""

FLEET = """
import sys, time, zenoh
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json
from beacon_zenoh import ZenohOptions, wire
from beacon_zenoh.config import session_config
endpoint, entities, each_s = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
changing = int(sys.argv[4])
session = zenoh.open(session_config(ZenohOptions(connect=(endpoint,)), "client").make())
keys = [f"beacon/hint/{bench_hint(n).entity_id}" for n in range(entities)]
hints = [json.encode(bench_hint(n)) for n in range(entities)]
start, number = time.monotonic(), 0
while True:
    # As many at once as come within 5 ms: robots do not wait for each other.
    while number < (time.monotonic() - start) * entities / each_s:
        turn, place = divmod(number, entities)
        hint = hints[place]
        if changing and place % 100 == turn % 100:
            hint = hint.replace(b"Engine", b"Motor_")
        number += 1
        session.put(keys[place], hint, attachment=wire.encode("bench-run", number, 0))
    time.sleep(0.005)
"""


def main() -> None:
    asked = options()
    # uvicorn closes a connection that is silent for 5 s.
    turns, seconds = (2, 1.0) if asked.quick else (5, 2.5)
    conditions = f"{ENTITIES} hints each {EACH_S:g} s, {STREAMS} streams"
    report = Report(f"{RATE:g} requests a second, {conditions}")
    for changing in (0, 1):
        load = os.getloadavg()[0]
        report.line(f"{changing} of 100 hints with another word (load before: {load:.1f})")
        clients = measured(changing, turns, seconds)
        for share in (50, 99):
            ours_ms, bare_ms = (one.percentile_ms(share) for one in clients)
            report.line(f"  p{share}: {ours_ms:.2f} ms, bare {bare_ms:.2f} ms")
            report.ratio(f"  p{share}, gateway / bare", ours_ms / bare_ms)
        report.ratio(f"  p99 / {P99_MS:g} ms", clients[0].percentile_ms(99) / P99_MS, 1.0)
        for name, one in zip(("gateway", "bare"), clients, strict=True):
            late = sum(took > P99_MS for took in one.took_ms) / len(one.took_ms)
            report.line(f"  answers that took more than {P99_MS:g} ms, {name}: {late:.2%}")
    report.finish(check=asked.check)


def measured(changing: int, turns: int, seconds: float) -> tuple[Client, Client]:
    """Clients of a gateway and of a bare route, who have asked in turn."""
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        endpoint = free_endpoint()
        port = stack.enter_context(gateway(endpoint, Path(folder)))
        numbers = map(str, (ENTITIES, EACH_S, changing))
        stack.enter_context(running([sys.executable, "-c", FLEET, endpoint, *numbers]))
        wait_for_all(port)
        stack.enter_context(watching(port))
        paths = [f"/api/v1/apps/{bench_hint(n).entity_id}/x-medkit-beacon" for n in range(ENTITIES)]
        bare_port = stack.enter_context(bare_route(answer(port, paths[0])))
        ours, theirs = Client(port, paths), Client(bare_port, ["/"])
        for _ in range(turns):
            ours.ask_for(seconds)
            theirs.ask_for(seconds)
    return ours, theirs


class Client:
    """Asks at its times on connections that stay open for as long as it asks.

    ``select`` because it can wait for less than a millisecond, which event loops do not.
    """

    def __init__(self, port: int, paths: list[str]) -> None:
        self._port, self._paths = port, paths
        self.took_ms: list[float] = []

    def ask_for(self, seconds: float) -> None:
        """For so long, and until all is answered."""
        with contextlib.ExitStack() as stack:
            # Anew each time: one that says nothing during the other's turn may be closed.
            self._ask([stack.enter_context(self._connect()) for _ in range(CONNECTIONS)], seconds)

    def percentile_ms(self, share: int) -> float:
        return statistics.quantiles(self.took_ms, n=100)[share - 1]

    def _connect(self) -> socket.socket:
        line = socket.create_connection(("127.0.0.1", self._port))
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return line

    def _ask(self, lines: list[socket.socket], seconds: float) -> None:
        free, waiting = deque(lines), dict[socket.socket, tuple[float, bytearray]]()
        start, count, asked = time.monotonic(), int(seconds * RATE), 0
        while asked < count or waiting:
            due = start + asked / RATE
            while asked < count and free and due <= time.monotonic():
                line = free.popleft()
                waiting[line] = due, bytearray()
                line.sendall(b"GET %b HTTP/1.1\r\nHost: bench\r\n\r\n" % self._path())
                asked += 1
                due = start + asked / RATE
            can_ask = asked < count and free
            patience_s = max(0.0, due - time.monotonic()) if can_ask else 10.0
            for line in select.select([*waiting], [], [], patience_s)[0]:
                due_then, got = waiting[line]
                piece = line.recv(65536)
                assert piece, "a connection was closed"
                got += piece
                if is_whole(got):
                    self.took_ms.append((time.monotonic() - due_then) * 1e3)
                    del waiting[line]
                    free.append(line)

    def _path(self) -> bytes:
        return random.choice(self._paths).encode()  # noqa: S311 - no secret


def is_whole(got: bytearray) -> bool:
    head = got.find(b"\r\n\r\n")
    if head < 0:
        return False
    assert got.startswith(b"HTTP/1.1 200"), got
    length = got[:head].lower().partition(b"content-length: ")[2].partition(b"\r\n")[0]
    return len(got) >= head + 4 + int(length)


@contextlib.contextmanager
def gateway(endpoint: str, folder: Path) -> Iterator[int]:
    """``beacon run``; its port."""
    config = folder / "gateway.yaml"
    config.write_text(
        f"sources:\n  robots:\n    adapter: zenoh\n    ttl_s: {3 * EACH_S}\n"
        f"    source_rate: 10000\n    max_hints: {2 * ENTITIES}\n"
        f"    options: {{mode: router, listen: [{endpoint}]}}\n"
    )
    command = [sys.executable, "-m", "beacon_gateway", "run", "--port", "0", "--json"]
    with running([*command, "-c", str(config)]) as process:
        assert process.stdout is not None
        yield int(json.loads(process.stdout.readline())["url"].rpartition(":")[2])


@contextlib.contextmanager
def running(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)  # noqa: S603
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for_all(port: int) -> None:
    deadline, count = time.monotonic() + HEARD_WITHIN_S, 0
    while count < ENTITIES:
        assert time.monotonic() < deadline, f"{count} of {ENTITIES} were heard"
        time.sleep(0.5)
        count = json.loads(answer(port, "/api/v1/apps"))["x-medkit"]["total_count"]


def answer(port: int, path: str) -> bytes:
    with socket.create_connection(("127.0.0.1", port)) as line:
        line.sendall(b"GET %b HTTP/1.1\r\nHost: bench\r\nConnection: close\r\n\r\n" % path.encode())
        return b"".join(iter(lambda: line.recv(1 << 20), b"")).partition(b"\r\n\r\n")[2]


@contextlib.contextmanager
def watching(port: int) -> Iterator[None]:
    """Streams that are read, in a process of their own."""
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(
        target=watch, args=(port, theirs), daemon=True
    )
    process.start()
    ours.recv()
    yield
    process.terminate()


def watch(port: int, pipe: Connection) -> None:
    lines = [socket.create_connection(("127.0.0.1", port)) for _ in range(STREAMS)]
    for line in lines:
        line.sendall(b"GET /api/v1/x-medkit-beacon/stream HTTP/1.1\r\nHost: bench\r\n\r\n")
    silent = set(lines)
    while True:
        for line in select.select(lines, [], [])[0]:
            got = line.recv(1 << 20)
            assert got, "a stream has ended"
            # Within an event there is no empty line: that is the snapshot's end, and its chunk's.
            if line in silent and got.endswith(b"\n\n\r\n"):
                silent.discard(line)
                if not silent:
                    pipe.send("all have begun")


@contextlib.contextmanager
def bare_route(content: bytes) -> Iterator[int]:
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(
        target=serve, args=(content, theirs), daemon=True
    )
    process.start()
    yield ours.recv()
    process.terminate()


def serve(content: bytes, pipe: Connection) -> None:
    serve_bare(bare("/", content), pipe)


if __name__ == "__main__":
    main()
