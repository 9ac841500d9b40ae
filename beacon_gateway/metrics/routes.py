"""``/metrics``, ``/livez`` and ``/readyz``: where monitoring and supervisors look for them, and
below the path of the interface, where clients look that are made from its document.

Alive is a gateway whose sweeper turns; that it answers at all shows that its loop does. Ready is
one whose sources have all begun. A source whose carrier is down later does not make it unready:
then people need the gateway most.
"""

from __future__ import annotations

import json

from prometheus_client.exposition import choose_encoder
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from beacon_core.ports.health import Condition
from beacon_gateway.gateway import Gateway
from beacon_gateway.http.operations import API_BASE
from beacon_gateway.metrics.collector import registry_of
from beacon_gateway.relay.metrics import RelayCollector

__all__ = ["routes"]

_NOT_BEGUN = frozenset({Condition.STARTING, Condition.CLOSED})


def routes(gateway: Gateway) -> list[Route]:
    """The three routes, at the root and below the interface's path."""
    registry = registry_of(gateway, per_entity=gateway.config.http.metrics_per_entity)
    if gateway.relay is not None:
        registry.register(RelayCollector(gateway.relay))

    def metrics(request: Request) -> Response:
        encode, content_type = choose_encoder(request.headers.get("accept", ""))
        return Response(encode(registry), headers={"content-type": content_type})

    async def live(_: Request) -> Response:
        return _verdict([] if gateway.sweeping else ["the sweeper does not turn"])

    def ready(_: Request) -> Response:
        return _verdict(_waits_for(gateway))

    handlers = {"/metrics": metrics, "/livez": live, "/readyz": ready}
    return [
        Route(base + path, handler) for base in ("", API_BASE) for path, handler in handlers.items()
    ]


def _waits_for(gateway: Gateway) -> list[str]:
    if not gateway.running:
        return ["the gateway is not started, or is closed"]
    conditions = {one.name: one.source.health().condition for one in gateway.listeners}
    return [
        f"the source {name} is {condition}"
        for name, condition in conditions.items()
        if condition in _NOT_BEGUN
    ]


def _verdict(faults: list[str]) -> Response:
    body = {"status": "unavailable", "reasons": faults} if faults else {"status": "ok"}
    status = 503 if faults else 200
    return Response(json.dumps(body), status, media_type="application/json")
