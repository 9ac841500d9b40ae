"""One pump for any number of clients.

The pump looks at the live view ten times per second, while there is anybody to tell, and wakes the
clients when there is something new. A client holds nothing but the number of the event it was given
last; it reads from the ring at its own pace. So no client can slow down another one or the pump,
and what it costs is bounded: one that does not read is found out when a piece of 64 kB has not gone
out for ``STUCK_S``, or when what it has not read falls out of the ring.

Clients are woken in portions, with the event loop's other work in between: a thousand at once would
keep everybody else waiting for as long as it takes to write a thousand times.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from beacon_gateway.live.view import LiveView

__all__ = ["KEEPALIVE_S", "STUCK_S", "Client", "Full", "Hub"]

_log = logging.getLogger(__name__)

KEEPALIVE_S = 15.0
"""How often a client hears something, so that it and every proxy in between know the line is up."""

STUCK_S = 20.0
"""A client that takes nothing for so long is not there any more, or might as well not be."""

_LOOK_EVERY_S = 0.1
_PORTION = 8
"""Clients that are woken at once: half a millisecond of writing."""


class Full(Exception):  # noqa: N818 - an answer, not a fault
    """There are as many clients as there may be."""


class Client:
    """Somebody who waits for events."""

    def __init__(self, number: int) -> None:
        self.number = number
        """The event it was given last."""
        self.gone = False
        self.keepalive = False
        self.woken = asyncio.Event()


class Hub:
    """Thread rule: one event loop; ``dropped`` and ``count`` may be read from any thread."""

    def __init__(self, view: LiveView, stopping: threading.Event, *, max_clients: int) -> None:
        """``stopping``: set when every stream is to end."""
        self.view = view
        self.stopping = stopping
        self.max_clients = max_clients
        self.dropped: Counter[str] = Counter()
        """Clients that were given up, by reason."""
        self._clients: set[Client] = set()
        self._pump: asyncio.Task[None] | None = None

    @property
    def count(self) -> int:
        """How many clients there are."""
        return len(self._clients)

    @contextmanager
    def client(self) -> Iterator[Client]:
        """Take part. Raises :class:`Full`."""
        if len(self._clients) >= self.max_clients:
            raise Full
        client = Client(self.view.ring.last)
        self._clients.add(client)
        if self._pump is None or self._pump.done():
            self._pump = asyncio.ensure_future(self._run())
        try:
            yield client
        finally:
            self._clients.discard(client)

    async def wait(self, client: Client, within_s: float) -> None:
        """Until the client is woken, or the time is over."""
        client.woken.clear()
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await client.woken.wait()

    async def _run(self) -> None:
        loop = asyncio.get_running_loop()
        keepalive_at = loop.time() + KEEPALIVE_S
        told = self.view.ring.last
        while self._clients:
            await self._look()
            due, ending = loop.time() >= keepalive_at, self.stopping.is_set()
            if due:
                keepalive_at = loop.time() + KEEPALIVE_S
            if due or ending or self.view.ring.last != told:
                told = self.view.ring.last
                await self.wake(keepalive=due)
            if ending:
                return
            await asyncio.sleep(_LOOK_EVERY_S)

    async def _look(self) -> None:
        try:
            if self.view.behind():
                await asyncio.to_thread(self.view.advance)
        except Exception:  # noqa: BLE001
            # A defect; but those who wait are better told late than never again.
            _log.exception("the live view could not be brought up to date; trying again")
            await asyncio.sleep(1.0)

    async def wake(self, *, keepalive: bool = False) -> None:
        """Let every client look at the ring, in portions."""
        for index, client in enumerate(tuple(self._clients)):
            client.keepalive |= keepalive
            client.woken.set()
            if index % _PORTION == _PORTION - 1:
                await asyncio.sleep(0)
