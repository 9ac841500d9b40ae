"""Streams of server-sent events that one client reads at its own pace."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Iterator
from contextlib import contextmanager, suppress

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from beacon_gateway.http import errors
from beacon_gateway.writing import to_json

__all__ = ["KEEPALIVE", "KEEPALIVE_S", "STUCK_S", "EventResponse", "Places", "event", "pause"]

KEEPALIVE = b":keepalive\n\n"
"""A comment: clients that read events pass over it."""

KEEPALIVE_S = 15.0
"""How often a client hears something, so that it and all between know that the line is up."""

STUCK_S = 20.0
"""A client that takes nothing for so long is given up."""

_LOOK_S = 1.0
"""How soon an idle stream notices that the gateway stops."""

_HEADERS = [
    (b"content-type", b"text/event-stream"),
    (b"cache-control", b"no-cache"),
    (b"x-accel-buffering", b"no"),
]


def event(data: object) -> bytes:
    """One event without a name."""
    return b"data: " + to_json(data) + b"\n\n"


async def pause(stopping: threading.Event, seconds: float) -> None:
    """Wait, but not much longer than the gateway runs."""
    loop = asyncio.get_running_loop()
    end_s = loop.time() + seconds
    # The event is of threads: nothing here can wait for it.
    while not stopping.is_set() and (left_s := end_s - loop.time()) > 0:  # noqa: ASYNC110
        await asyncio.sleep(min(left_s, _LOOK_S))


class Places:
    """How many may be served at the same time."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._taken = 0

    @contextmanager
    def one(self) -> Iterator[None]:
        """Have one. Raises ``ApiError`` if none is left."""
        if self._taken >= self._limit:
            raise errors.unavailable(
                f"There are {self._limit} streams already; try again later",
                max_streams=self._limit,
            )
        self._taken += 1
        try:
            yield
        finally:
            self._taken -= 1


class EventResponse(Response):
    """Sends pieces until there are no more, or the client is gone or takes nothing.

    Thread rule: the event loop of the request.
    """

    def __init__(self, pieces: AsyncGenerator[bytes, None], places: Places) -> None:
        super().__init__()
        self._pieces = pieces
        self._places = places

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve it to its end."""
        with self._places.one():
            await send({"type": "http.response.start", "status": 200, "headers": _HEADERS})
            if scope["method"] == "HEAD":
                await send({"type": "http.response.body"})
                return
            serving = asyncio.ensure_future(self._serve(send))
            leaving = asyncio.ensure_future(_until_gone(receive))
            try:
                await asyncio.wait({serving, leaving}, return_when=asyncio.FIRST_COMPLETED)
            finally:
                serving.cancel()
                leaving.cancel()
                await asyncio.gather(serving, leaving, return_exceptions=True)
                await self._pieces.aclose()

    async def _serve(self, send: Send) -> None:
        with suppress(OSError):  # the client is gone, or takes nothing
            async for piece in self._pieces:
                await _put(send, piece, more=True)
            await _put(send, b"", more=False)


async def _put(send: Send, piece: bytes, *, more: bool) -> None:
    async with asyncio.timeout(STUCK_S):
        await send({"type": "http.response.body", "body": piece, "more_body": more})


async def _until_gone(receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
