"""Faults of the whole system: none, and a stream on which nothing happens.

Clients keep it open, and complain every few seconds if they cannot.
"""

from __future__ import annotations

from collections.abc import AsyncGenerator

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute

from beacon_gateway.gateway import Gateway
from beacon_gateway.http.models.resources import FaultListResult
from beacon_gateway.http.operations import ApiRoute, Asked, Operation, Parameter, route
from beacon_gateway.http.resources import FAULT_STATUS, no_faults
from beacon_gateway.http.sse import KEEPALIVE, KEEPALIVE_S, EventResponse, Places, pause

__all__ = ["MAX_STREAMS", "routes"]

MAX_STREAMS = 1000
"""Each is a connection and some kilobytes."""

_TRUTH = ("true", "false")


def routes(gateway: Gateway) -> list[BaseRoute]:
    """The list and the stream."""
    listing = Operation(
        id="listAllFaults",
        tag="Faults",
        path="/faults",
        summary="Always empty: no faults are known here",
        body=FaultListResult,
        parameters=(
            FAULT_STATUS,
            Parameter(name="include_muted", choices=_TRUTH),
            Parameter(name="include_clusters", choices=_TRUTH),
        ),
    )
    stream = Operation(
        id="streamFaults",
        tag="Faults",
        path="/faults/stream",
        summary="A stream of events that never come",
        streams=True,
        refusals=(503,),
    )
    places = Places(MAX_STREAMS)

    async def serve(_: Request) -> Response:
        return EventResponse(_nothing(gateway), places)

    return [route(gateway, listing, _no_faults), ApiRoute(stream, serve)]


def _no_faults(_: Asked) -> FaultListResult:
    return no_faults()


async def _nothing(gateway: Gateway) -> AsyncGenerator[bytes, None]:
    while not gateway.stopping.is_set():
        yield KEEPALIVE
        await pause(gateway.stopping, KEEPALIVE_S)
