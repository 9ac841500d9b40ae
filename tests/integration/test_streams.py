"""A thousand streams on one real gateway, of which some are never read."""

from __future__ import annotations

import asyncio
import json
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlsplit

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.options import ZenohOptions

pytestmark = pytest.mark.system

CLIENTS = 1_000
NEVER_READ = 50
WITHIN_S = 60.0
"""For anything, on a busy machine."""


@attrs.frozen
class Shop:
    process: subprocess.Popen[str]
    port: int
    endpoint: str

    def memory_mb(self) -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024


@pytest.fixture
def shop(tmp_path: Path) -> Iterator[Shop]:
    with socket.create_server(("127.0.0.1", 0)) as bound:
        endpoint = f"tcp/127.0.0.1:{bound.getsockname()[1]}"
    config = tmp_path / "gateway.yaml"
    config.write_text(
        "sources:\n  robots:\n    adapter: zenoh\n    source_rate: 10000\n"
        f"    options: {{mode: router, listen: [{endpoint}]}}\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "beacon_gateway", "run", "--port", "0", "--json", "-c", str(config)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        assert process.stdout is not None
        yield Shop(
            process, urlsplit(json.loads(process.stdout.readline())["url"]).port or 0, endpoint
        )
    finally:
        process.kill()
        process.communicate()


async def stream(port: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection("127.0.0.1", port, limit=1 << 20)
    writer.write(b"GET /api/v1/x-medkit-beacon/stream HTTP/1.1\r\nHost: gateway\r\n\r\n")
    await writer.drain()
    return reader, writer


async def told(reader: asyncio.StreamReader, text: bytes) -> float:
    """When the stream said this."""
    while text not in await reader.readline():
        assert not reader.at_eof(), f"the stream ended before {text!r}"
    return time.monotonic()


async def ask_s(port: int) -> float:
    """How long an ordinary answer takes."""
    start = time.monotonic()
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(b"GET /livez HTTP/1.1\r\nHost: gateway\r\nConnection: close\r\n\r\n")
    assert b"200 OK" in await reader.readline()
    await reader.read()
    writer.close()
    return time.monotonic() - start


async def asked(port: int, times: int) -> list[float]:
    return sorted([await ask_s(port) for _ in range(times)])


async def scene(shop: Shop, announcer: ZenohAnnouncer) -> tuple[list[float], list[float], float]:
    readers, lines = [], list[asyncio.StreamWriter]()
    for number in range(CLIENTS):
        pair = await stream(shop.port)
        lines.append(pair[1])
        if number >= NEVER_READ:
            readers.append(pair)
            await told(pair[0], b"event: snapshot")
    before_mb = shop.memory_mb()
    alone = await asked(shop.port, 50)
    asking = asyncio.ensure_future(asked(shop.port, 200))
    # Enough that what is not read would fill every buffer on the way.
    for number in range(40):
        announcer.announce(BeaconHint("talker", display_name=f"{number} " * 250))
        await asyncio.sleep(0.05)
    announcer.announce(BeaconHint("newcomer"))
    said = time.monotonic()
    heard = await asyncio.gather(
        *(told(reader, b'"entity_id":"newcomer"') for reader, _ in readers)
    )
    crowded = await asking
    print(  # noqa: T201
        f"\nall told within {max(heard) - said:.2f} s; an answer takes {alone[25] * 1e3:.1f} ms, "
        f"with streams {crowded[100] * 1e3:.1f} ms, the slowest of 200 {crowded[-1] * 1e3:.0f} ms; "
        f"{shop.memory_mb():.0f} MB, before {before_mb:.0f} MB"
    )
    grown_mb = shop.memory_mb() - before_mb
    # Now it stops: every stream that is read ends as it should.
    shop.process.terminate()
    ends = await asyncio.gather(
        *(told(reader, b"the gateway is stopping") for reader, _ in readers)
    )
    assert len(ends) == CLIENTS - NEVER_READ
    for line in lines:
        line.transport.abort()
    return [at - said for at in heard], crowded, grown_mb


async def played(shop: Shop, announcer: ZenohAnnouncer) -> tuple[list[float], list[float], float]:
    return await asyncio.wait_for(scene(shop, announcer), 2 * WITHIN_S)


def test_a_thousand_clients_are_told_and_those_who_do_not_read_harm_nobody(shop: Shop) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < 2 * CLIENTS:
        resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, 4 * CLIENTS), hard))
    announcer = ZenohAnnouncer(ZenohOptions(mode="client", connect=(shop.endpoint,)), period_s=60.0)
    try:
        announcer.announce(BeaconHint("first"))
        # In a thread of its own: in this one a browser's tests may have left an event loop.
        with ThreadPoolExecutor(1) as thread:
            playing = thread.submit(asyncio.run, played(shop, announcer))
            delays, crowded, grown_mb = playing.result()
    finally:
        announcer.close()
    assert len(delays) == CLIENTS - NEVER_READ
    assert max(delays) < 10
    assert crowded[100] < 0.25
    assert crowded[-1] < 3
    assert grown_mb < 150
    assert shop.process.wait(WITHIN_S) == 0
