"""What it costs to tell a thousand clients of one change.

Beside it, in the same loop: a thousand tasks that do nothing but wait to be woken and write the
same bytes. Nothing that tells a thousand clients can do with less.

    python bench/streams.py [--quick] [--check]
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from operator import eq
from typing import Any

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_fake import ADAPTER, FakeNetwork, share_network
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.live.hub import Hub
from beacon_gateway.live.stream import EventStream
from beacon_gateway.live.view import LiveView
from measure import Report, options

CLIENTS = 1_000
AT_MOST = 5.0
"""To find out who does not read takes a timer for each write: that is most of it."""


class Line:
    """The server's side of a client: takes everything at once."""

    def __init__(self) -> None:
        self.taken = 0
        self.woken = asyncio.Event()

    async def send(self, message: Any) -> None:
        self.taken += len(message.get("body", b""))

    async def receive(self) -> Any:
        await asyncio.Event().wait()

    async def bare(self, piece: Callable[[], bytes]) -> None:
        while True:
            await self.woken.wait()
            self.woken.clear()
            await self.send({"type": "http.response.body", "body": piece(), "more_body": True})


def gateway() -> Gateway:
    clock = ManualClock()
    share_network(FakeNetwork(clock), "bench")
    document = {"sources": {"robots": {"adapter": "fake", "options": {"network": "bench"}}}}
    config = parse_config(document, lambda _: ADAPTER).config
    return Gateway(config, lookup=lambda _: ADAPTER, clock=clock)


async def measured(rounds: int) -> tuple[float, float, int]:
    """The best round of both, in seconds of processor time, and the bytes of one event."""
    made = gateway()
    view = LiveView(made)
    hub = Hub(view, made.stopping, max_clients=CLIENTS)
    store = made.listeners[0].store
    store.update(BeaconHint("a", display_name="0"), source="s")
    view.catch_up()
    frame = b""
    lines = [Line() for _ in range(CLIENTS)]
    bare = [Line() for _ in range(CLIENTS)]
    scope: dict[str, Any] = {"type": "http", "method": "GET"}
    tasks = [
        asyncio.ensure_future(EventStream(hub, "")(scope, one.receive, one.send)) for one in lines
    ]
    tasks += [asyncio.ensure_future(one.bare(lambda: frame)) for one in bare]
    while not all(one.taken for one in lines):  # noqa: ASYNC110
        await asyncio.sleep(0.05)
    best = [float("inf"), float("inf")]
    for number in range(rounds):
        store.update(BeaconHint("a", display_name=str(number + 1)), source="s")
        before = [one.taken for one in lines]
        start = time.process_time()
        view.advance()
        await hub.wake()
        while any(map(eq, before, (one.taken for one in lines))):  # noqa: ASYNC110
            await asyncio.sleep(0)
        best[0] = min(best[0], time.process_time() - start)
        piece = view.ring.after(view.ring.last - 1, 10**6)
        frame = piece[0] if piece else b""
        before = [one.taken for one in bare]
        start = time.process_time()
        for one in bare:
            one.woken.set()
        while any(map(eq, before, (one.taken for one in bare))):  # noqa: ASYNC110
            await asyncio.sleep(0)
        best[1] = min(best[1], time.process_time() - start)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    return best[0], best[1], len(frame)


def main() -> None:
    chosen = options()
    ours, bare, size = asyncio.run(measured(5 if chosen.quick else 200))
    report = Report(f"One change told to {CLIENTS} clients")
    report.line(f"an event of {size} bytes: {ours * 1e6 / CLIENTS:.1f} us a client")
    report.ratio("a stream / a task that only waits and writes", ours / bare, AT_MOST)
    report.finish(check=chosen.check)


if __name__ == "__main__":
    main()
