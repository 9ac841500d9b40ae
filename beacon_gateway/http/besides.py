"""What the OpenAPI document says of routes that are made elsewhere: the live view, tokens, and what
monitoring asks."""

from __future__ import annotations

from beacon_gateway.access.access import Access
from beacon_gateway.http.models.besides import (
    BeaconChanges,
    OAuthError,
    Probe,
    Revocation,
    TokenRequest,
    Tokens,
)
from beacon_gateway.http.operations import Operation, Parameter
from beacon_gateway.vendor import BEACON

__all__ = ["operations"]

_SINCE = Parameter(name="since")


def operations(access: Access) -> list[Operation]:
    """Those for tokens only if clients are configured: the others are always served."""
    auth = access.rules.auth
    makes = auth is not None and auth.jwt_tokens.makes
    return [*_LIVE, *_MONITORING, *(_tokens() if makes else ())]


_LIVE = (
    Operation(
        id="streamBeacons",
        tag="Live",
        path=f"/{BEACON}/stream",
        summary="Everything, then each change, as server-sent events",
        media=("text/event-stream",),
        parameters=(_SINCE,),
        refusals=(503,),
        streams=True,
    ),
    Operation(
        id="listBeaconChanges",
        tag="Live",
        path=f"/{BEACON}",
        summary="Everything, or what has changed since a revision, waiting for it if asked to",
        body=BeaconChanges,
        parameters=(
            _SINCE,
            *(Parameter(name=name) for name in ("wait", "id", "full")),
        ),
        refusals=(503,),
    ),
)


_MONITORING = (
    Operation(
        id="scrapeMetrics",
        tag="Monitoring",
        path="/metrics",
        summary="All numbers, for Prometheus, in the format that it asks for",
        media=("text/plain", "application/openmetrics-text"),
    ),
    *(
        Operation(
            id=name,
            tag="Monitoring",
            path=path,
            summary=summary,
            body=Probe,
            errors={503: Probe},
        )
        for name, path, summary in (
            ("probeLiveness", "/livez", "Whether it is alive; if not, start it anew"),
            ("probeReadiness", "/readyz", "Whether every source has begun"),
        )
    ),
)


def _tokens() -> list[Operation]:
    return [
        Operation(
            id=name,
            tag="Authentication",
            path=f"/auth/{path}",
            summary=summary,
            method="POST",
            request=TokenRequest,
            body=body,
            errors=dict.fromkeys((400, 401, 503), OAuthError),
        )
        for name, path, summary, body in (
            ("authorize", "authorize", "Tokens for a client's secret; JSON or a form", Tokens),
            ("refreshToken", "token", "Another access token; JSON or a form", Tokens),
            ("revokeToken", "revoke", "Let a token open nothing any more", Revocation),
        )
    ]
