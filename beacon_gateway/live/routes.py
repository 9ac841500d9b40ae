"""The live view over HTTP: a stream, and a listing that can wait for news."""

from __future__ import annotations

import asyncio
import math

from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

from beacon_gateway.gateway import Gateway
from beacon_gateway.live.hub import Full, Hub
from beacon_gateway.live.stream import EventStream, full
from beacon_gateway.live.view import LiveView
from beacon_gateway.vendor import BEACON

__all__ = ["MAX_WAIT_S", "routes"]

MAX_WAIT_S = 30.0
"""Proxies give up on a silent answer after 60 s, many after 30."""

_PATH = f"/api/v1/{BEACON}"


def routes(gateway: Gateway) -> list[BaseRoute]:
    """The routes of one gateway."""
    live = _Live(gateway)
    handlers = {_PATH + "/stream": live.stream, _PATH: live.listing}
    return [
        Route(path + slash, handler, methods=["GET"])
        for path, handler in handlers.items()
        for slash in ("", "/")
    ]


class _Live:
    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._made: Hub | None = None

    @property
    def _hub(self) -> Hub:
        # Not before the first is asked for: until then nothing is kept.
        if self._made is None:
            self._made = Hub(
                LiveView(self._gateway),
                self._gateway.stopping,
                max_clients=self._gateway.config.http.max_streams,
            )
        return self._made

    async def stream(self, request: Request) -> Response:
        """``?since=`` is for clients that cannot send the header."""
        since = request.query_params.get("since", "")
        return EventStream(self._hub, request.headers.get("last-event-id", since))

    async def listing(self, request: Request) -> Response:
        """Everything, or what has changed since a revision, waiting for it if asked to."""
        asked = request.query_params
        wait_s = _seconds(asked.get("wait", "0"))
        if wait_s is None:
            return _bad_wait(asked["wait"])
        view, ids = self._hub.view, frozenset(asked.getlist("id"))
        await asyncio.to_thread(view.catch_up)
        number = view.number(asked.get("since", ""))
        if number is not None and number == view.ring.last and wait_s:
            try:
                await self._wait(number, min(wait_s, MAX_WAIT_S))
            except Full:
                return full(self._hub.max_clients)
        whole = asked.get("full", "") == "true"
        body = await asyncio.to_thread(view.listing, number, ids, full=whole)
        return Response(body, media_type="application/json")

    async def _wait(self, number: int, wait_s: float) -> None:
        with self._hub.client() as client:
            if self._hub.view.ring.last == number and not self._hub.stopping.is_set():
                await self._hub.wait(client, wait_s)


def _seconds(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and value >= 0 else None


def _bad_wait(text: str) -> Response:
    return JSONResponse(
        {
            "error_code": "invalid-parameter",
            "message": "Invalid wait",
            "parameters": {"details": "give seconds, 0 or more", "wait": text[:60]},
        },
        400,
    )
