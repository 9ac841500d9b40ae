"""Where clients get their tokens: ``/auth/authorize``, ``/auth/token`` and ``/auth/revoke``.

OAuth 2.0's client credentials (RFC 6749, 4.4), its refresh (6) and revocation (RFC 7009), with
errors in its form, which is not that of the other routes. Bodies are JSON or a form.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any
from urllib.parse import parse_qsl

import anyio
import anyio.to_thread
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from beacon_gateway.access.access import Access
from beacon_gateway.access.api_tokens import Identity
from beacon_gateway.access.auth import AUTH_PATH, Auth
from beacon_gateway.access.jwt_tokens import TokenPair
from beacon_gateway.access.secrets import NOBODYS_HASH, secret_matches

__all__ = ["routes"]


def routes(access: Access) -> list[BaseRoute]:
    """They answer ``service-unavailable`` unless clients are configured."""
    service = _Service(access)
    handlers = {
        "authorize": service.authorize,
        "token": service.refresh,
        "revoke": service.revoke,
    }
    return [
        Route(AUTH_PATH + name + slash, handler, methods=["POST"])
        for name, handler in handlers.items()
        for slash in ("", "/")
    ]


class _Refused(Exception):  # noqa: N818 - an answer, not a fault
    def __init__(self, error: str, description: str, status: int = 400) -> None:
        super().__init__(description)
        self.status = status
        self.body = {"error": error, "error_description": description}


class _Service:
    def __init__(self, access: Access) -> None:
        self._access = access
        # A slow hash takes 16 MiB: one at a time, whoever asks.
        self._slow: anyio.CapacityLimiter | None = None

    async def authorize(self, request: Request) -> Response:
        return await self._answered(request, self._authorized)

    async def refresh(self, request: Request) -> Response:
        return await self._answered(request, self._refreshed)

    async def revoke(self, request: Request) -> Response:
        return await self._answered(request, self._revoked)

    async def _answered(self, request: Request, handler: Any) -> Response:
        try:
            return _json(await handler(self._auth(), await _given(request)))
        except _Refused as refused:
            return _json(refused.body, refused.status)

    def _auth(self) -> Auth:
        auth = self._access.rules.auth
        if auth is None or not auth.jwt_tokens.makes:
            raise _Refused("temporarily_unavailable", "No clients are configured", 503)
        return auth

    async def _authorized(self, auth: Auth, given: Mapping[str, str]) -> object:
        _require_grant(given, "client_credentials")
        client_id, secret = _required(given, "client_id"), _required(given, "client_secret")
        client = next((one for one in auth.config.clients if one.id == client_id), None)
        if self._slow is None:
            self._slow = anyio.CapacityLimiter(1)
        matches = await anyio.to_thread.run_sync(
            secret_matches,
            secret,
            client.secret_hash if client else NOBODYS_HASH,
            limiter=self._slow,
        )
        if client is None or not matches:
            raise _Refused("invalid_client", "Invalid client credentials", 401)
        return _told(auth.jwt_tokens.pair(Identity(client.id, client.role)))

    async def _refreshed(self, auth: Auth, given: Mapping[str, str]) -> object:
        _require_grant(given, "refresh_token")
        pair = auth.jwt_tokens.refreshed(_required(given, "refresh_token"))
        if pair is None:
            raise _Refused("invalid_grant", "Invalid or expired refresh token", 401)
        return _told(pair)

    async def _revoked(self, auth: Auth, given: Mapping[str, str]) -> object:
        auth.jwt_tokens.revoke(_required(given, "token"))
        # RFC 7009: also for a token that never was one.
        return {"status": "revoked"}


async def _given(request: Request) -> Mapping[str, str]:
    body = await request.body()
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    try:
        text = body.decode()
        if kind == "application/x-www-form-urlencoded":
            return dict(parse_qsl(text, max_num_fields=20))
        given = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _Refused("invalid_request", "The body is neither JSON nor a form") from error
    if not isinstance(given, dict):
        raise _Refused("invalid_request", "The body is no JSON object")
    return {key: value for key, value in given.items() if isinstance(value, str)}


def _require_grant(given: Mapping[str, str], right: str) -> None:
    if given.get("grant_type") != right:
        raise _Refused("unsupported_grant_type", f"Only {right} is supported here")


def _required(given: Mapping[str, str], name: str) -> str:
    value = given.get(name)
    if not value:
        raise _Refused("invalid_request", f"{name} is required")
    return value


def _told(pair: TokenPair) -> dict[str, object]:
    return {
        "access_token": pair.access,
        "token_type": "Bearer",
        "expires_in": pair.expires_in_s,
        "scope": pair.role.value,
        "refresh_token": pair.refresh,
    }


def _json(body: object, status: int = 200) -> Response:
    # RFC 6749, 5.1: nobody may keep it.
    headers = {"cache-control": "no-store"}
    return Response(json.dumps(body), status, headers, media_type="application/json")
