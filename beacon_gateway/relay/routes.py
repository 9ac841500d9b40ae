"""What a relay tells over HTTP: by itself, or as a part of a gateway."""

from __future__ import annotations

from prometheus_client.core import CollectorRegistry
from prometheus_client.exposition import choose_encoder
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from beacon_gateway.relay.metrics import RelayCollector
from beacon_gateway.relay.relay import Relay
from beacon_gateway.relay.report import explained, report
from beacon_gateway.writing import JSON, to_json

__all__ = ["RELAY_PATH", "create_relay_app", "relay_routes"]

RELAY_PATH = "/api/v1/x-beacon-relay"
"""Below it: how it is, and ``/explain?topic=/a``."""


def create_relay_app(relay: Relay) -> Starlette:
    """For a relay without a gateway; the caller starts and closes it."""
    registry = CollectorRegistry()
    registry.register(RelayCollector(relay))

    def metrics(request: Request) -> Response:
        encode, content_type = choose_encoder(request.headers.get("accept", ""))
        return Response(encode(registry), headers={"content-type": content_type})

    return Starlette(routes=[*relay_routes(relay), Route("/metrics", metrics)])


def relay_routes(relay: Relay | None) -> list[Route]:
    """The two routes; each answers in a thread, since an end may be busy for a moment.

    Without a relay they tell of no ends: so who asks now and then, is not answered with errors.
    """

    def told(_: Request) -> Response:
        body = {"ends": []} if relay is None else report(relay)
        return Response(to_json(body), media_type=JSON)

    def explain(request: Request) -> Response:
        topic = request.query_params.get("topic", "")
        if not topic.startswith("/"):
            reason = "topic: give the full name of a topic, such as ?topic=/camera/image"
            body = {"error_code": "invalid-parameter", "message": reason}
            return Response(to_json(body), 400, media_type=JSON)
        found = {"topic": topic, "ends": []} if relay is None else explained(relay, topic)
        return Response(to_json(found), media_type=JSON)

    return [Route(RELAY_PATH, told), Route(f"{RELAY_PATH}/explain", explain)]
