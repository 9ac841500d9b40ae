"""The gateway's HTTP interface.

Handlers are plain functions, run by Starlette in threads: a listing of ten thousand apps keeps
nobody else waiting. They hold no state; every answer is made from the stores as they are now.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from beacon_core.lifecycle import Status
from beacon_gateway import metrics
from beacon_gateway.directory import Found, Kind
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import bodies, errors
from beacon_gateway.http.bodies import API_BASE
from beacon_gateway.vendor import BEACON

__all__ = ["create_app"]

_Handler = Callable[[Request], Response]


def create_app(gateway: Gateway) -> Starlette:
    """The interface of one gateway, which the caller starts and closes."""
    api = _Api(gateway)
    routes: dict[str, _Handler] = {
        "/health": api.health,
        "/version-info": api.version_info,
        "/apps": api.apps,
        "/apps/{id}": api.app,
        f"/apps/{{id}}/{BEACON}": api.app_beacon,
        "/components": api.components,
        "/components/{id}": api.component,
        f"/components/{{id}}/{BEACON}": api.component_beacon,
    }
    for endpoint, adapters in gateway.vendor_endpoints.items():
        routes |= {
            f"/apps/{{id}}/{endpoint}": partial(api.carrier_beacon, Kind.APP, adapters),
            f"/components/{{id}}/{endpoint}": partial(api.carrier_beacon, Kind.COMPONENT, adapters),
        }
    app = Starlette(
        routes=[
            Route(API_BASE + path + slash, handler)
            for path, handler in routes.items()
            for slash in ("", "/")
        ]
        + metrics.routes(gateway),
        exception_handlers={
            errors.ApiError: _refuse,
            HTTPException: _unknown,
            Exception: _fail,
        },
    )
    app.router.redirect_slashes = False
    return app


class _JsonResponse(Response):
    """JSON that can always be sent: half a surrogate pair becomes a question mark."""

    media_type = "application/json"

    def render(self, content: Any) -> bytes:
        text = json.dumps(content, ensure_ascii=False, separators=(",", ":"))
        return text.encode("utf-8", errors="replace")


class _Api:
    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._directory = gateway.directory
        self._clock = gateway.clock

    def health(self, _: Request) -> Response:
        return _JsonResponse(bodies.health(self._gateway))

    def version_info(self, _: Request) -> Response:
        return _JsonResponse(bodies.version_info(self._gateway.config.vendor_name))

    def apps(self, _: Request) -> Response:
        return _JsonResponse(bodies.items(self._directory.apps(), self._clock))

    def components(self, _: Request) -> Response:
        return _JsonResponse(bodies.items(self._directory.components(), self._clock))

    def app(self, request: Request) -> Response:
        return self._detail(request, Kind.APP)

    def component(self, request: Request) -> Response:
        return self._detail(request, Kind.COMPONENT)

    def app_beacon(self, request: Request) -> Response:
        return self._beacon(request, Kind.APP)

    def component_beacon(self, request: Request) -> Response:
        return self._beacon(request, Kind.COMPONENT)

    def _detail(self, request: Request, kind: Kind) -> Response:
        entity_id: str = request.path_params["id"]
        errors.check_id(entity_id)
        found = self._find(entity_id, kind)
        if found is not None:
            endpoints = self._gateway.vendor_endpoints
            return _JsonResponse(bodies.detail(found, self._clock, endpoints))
        actual = self._directory.kind(entity_id)
        if actual is None:
            raise errors.entity_not_found(entity_id)
        raise errors.wrong_type(entity_id, kind, actual)

    def carrier_beacon(self, kind: Kind, adapters: frozenset[str], request: Request) -> Response:
        beacon = self._found(request, kind).beacon
        heard = None if beacon is None else beacon.heard_by(adapters)
        if heard is None or heard.status is Status.LEFT:
            raise errors.beacon_not_found()
        return _JsonResponse(bodies.carrier_beacon(heard, self._clock))

    def _beacon(self, request: Request, kind: Kind) -> Response:
        beacon = self._found(request, kind).beacon
        if beacon is None:
            raise errors.beacon_not_found({"entity_id": request.path_params["id"]})
        if beacon.status is Status.LEFT:
            raise errors.beacon_not_found(bodies.left_parameters(beacon, self._clock))
        return _JsonResponse(bodies.vendor_beacon(beacon, self._clock))

    def _found(self, request: Request, kind: Kind) -> Found:
        """Whom a vendor endpoint is asked for."""
        entity_id: str = request.path_params["id"]
        errors.check_vendor_id(entity_id)
        found = self._find(entity_id, kind)
        if found is None:
            actual = self._directory.kind(entity_id)
            raise errors.vendor_entity_missing(entity_id, kind, actual)
        return found

    def _find(self, entity_id: str, kind: Kind) -> Found | None:
        directory = self._directory
        return directory.app(entity_id) if kind is Kind.APP else directory.component(entity_id)


def _refuse(_: Request, error: Exception) -> Response:
    assert isinstance(error, errors.ApiError)  # noqa: S101 - Starlette's contract
    return _JsonResponse(error.body(), error.status)


def _unknown(request: Request, _: Exception) -> Response:
    return _refuse(request, errors.resource_not_found())


def _fail(request: Request, error: Exception) -> Response:
    return _refuse(request, errors.internal_error(error))
