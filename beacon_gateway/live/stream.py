"""One client's stream of server-sent events, as an ASGI response.

First a ``snapshot`` of everything (unless the client says where it stopped and the ring still
reaches there), then each event, and a comment now and then. The end is told too: ``dropped`` with a
reason to one that is too slow, ``end`` to everybody when the gateway stops.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

from starlette.responses import JSONResponse, Response
from starlette.types import Receive, Scope, Send

from beacon_gateway.live.hub import STUCK_S, Client, Full, Hub
from beacon_gateway.live.rows import sse
from beacon_gateway.writing import to_json

__all__ = ["EventStream", "full"]

_log = logging.getLogger(__name__)

_PIECE = 64 * 1024
"""Bytes handed over at once: what an ASGI server takes before it lets a client wait."""

_RETRY_AFTER_S = 10

_HEADERS = [
    (b"content-type", b"text/event-stream; charset=utf-8"),
    (b"cache-control", b"no-cache"),
    (b"x-accel-buffering", b"no"),
]


class EventStream(Response):
    """Thread rule: the hub's event loop."""

    def __init__(self, hub: Hub, revision: str) -> None:
        """``revision``: where the client stopped, ``""`` if it is new."""
        super().__init__()
        self._hub = hub
        self._revision = revision

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve it to its end."""
        try:
            with self._hub.client() as client:
                await send({"type": "http.response.start", "status": 200, "headers": _HEADERS})
                if scope["method"] == "HEAD":
                    await send({"type": "http.response.body"})
                else:
                    await self._serve(client, receive, send)
        except Full:
            await full(self._hub.max_clients)(scope, receive, send)

    async def _serve(self, client: Client, receive: Receive, send: Send) -> None:
        leaving = asyncio.ensure_future(_until_gone(client, receive))
        try:
            await self._begin(client, send)
            await self._follow(client, send)
        except TimeoutError:
            self._drop(f"it took nothing for {STUCK_S:g} s")
            # The kernel is about to end it; before that no server gets rid of what it has sent.
            await asyncio.wait({leaving}, timeout=STUCK_S)
        except asyncio.CancelledError:
            # A server that has no patience left; a client should still be told.
            with suppress(Exception):
                await _end(send, "end", "the gateway is stopping")
        except OSError:
            pass  # the client is gone
        finally:
            leaving.cancel()

    async def _begin(self, client: Client, send: Send) -> None:
        view = self._hub.view
        number = view.number(self._revision)
        if number is not None:
            client.number = number
            return
        snapshot = await asyncio.to_thread(view.snapshot)
        client.number = snapshot.number
        for start in range(0, len(snapshot.data), _PIECE):
            await _put(send, snapshot.data[start : start + _PIECE])

    async def _follow(self, client: Client, send: Send) -> None:
        ring = self._hub.view.ring
        while not client.gone:
            piece = ring.after(client.number, _PIECE)
            if piece is None:
                self._drop("it fell behind by more than is kept")
                await _end(send, "dropped", "too slow: more has happened than is kept")
                return
            data, client.number = piece
            if data:
                await _put(send, data)
            elif self._hub.stopping.is_set():
                await _end(send, "end", "the gateway is stopping")
                return
            elif client.keepalive:
                client.keepalive = False
                await _put(send, b":keepalive\n\n")
            else:
                client.woken.clear()
                await client.woken.wait()

    def _drop(self, reason: str) -> None:
        self._hub.dropped[reason] += 1
        _log.info("a client of the stream was dropped: %s", reason)


async def _put(send: Send, data: bytes) -> None:
    async with asyncio.timeout(STUCK_S):
        await send({"type": "http.response.body", "body": data, "more_body": True})


async def _end(send: Send, kind: str, reason: str) -> None:
    async with asyncio.timeout(STUCK_S):
        data = sse(kind, to_json({"reason": reason}))
        await send({"type": "http.response.body", "body": data})


async def _until_gone(client: Client, receive: Receive) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
    client.gone = True
    client.woken.set()


def full(at_most: int) -> Response:
    """The answer to one client too many."""
    return JSONResponse(
        {
            "error_code": "service-unavailable",
            "message": f"There are {at_most} streams already; try again later",
            "parameters": {"max_streams": at_most, "retry_after": _RETRY_AFTER_S},
        },
        503,
        headers={"Retry-After": str(_RETRY_AFTER_S)},
    )
