"""The gateway's HTTP interface as one ASGI application."""

from __future__ import annotations

from itertools import chain

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute

from beacon_gateway import live, metrics, page
from beacon_gateway.access import auth_routes
from beacon_gateway.access.access import Access
from beacon_gateway.access.middleware import AccessControl
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import (
    beacons,
    besides,
    data,
    discovery,
    docs,
    errors,
    faults,
    relations,
    resources,
    server,
    subscriptions,
)
from beacon_gateway.http.answers import answer
from beacon_gateway.http.operations import API_BASE, ApiRoute
from beacon_gateway.http.shortcut import Shortcut
from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.relay.routes import relay_routes

__all__ = ["create_app"]

_FAMILIES = (
    data.routes,
    resources.routes,
    faults.routes,
    subscriptions.routes,
    live.routes,
    page.routes,
    server.routes,
)


def create_app(gateway: Gateway, access: Access | None = None) -> Starlette:
    """The interface of one gateway, which the caller starts and closes.

    Serve it, or mount it in an application of your own, at the root or below any prefix. It needs
    no lifespan events. ``access``: who may ask what, to be changed while it is served; by default
    what the gateway's configuration says, which then stays.
    """
    access = access or Access(gateway.config.http)
    kept = Snapshots(gateway)
    app = Starlette(
        routes=[*_routes(gateway, access, kept), *auth_routes.routes(access)],
        middleware=[Middleware(AccessControl, access), Middleware(Shortcut, kept)],
        exception_handlers={
            errors.ApiError: _refuse,
            HTTPException: _unknown,
            Exception: _fail,
        },
    )
    app.router.redirect_slashes = False
    return app


def _routes(gateway: Gateway, access: Access, kept: Snapshots) -> list[BaseRoute]:
    # Asked most often, so looked at first.
    hot = beacons.routes(gateway, kept)
    families = [*discovery.routes(gateway, kept), *relations.routes(gateway, kept)]
    families += chain.from_iterable(family(gateway) for family in _FAMILIES)
    operations = [one.operation for one in [*families, *hot] if isinstance(one, ApiRoute)]
    endpoints = [f"{one.method} {API_BASE}{one.path}" for one in operations]
    overview = server.overview_route(gateway, [*endpoints, *docs.ENDPOINTS])
    described = [*operations, overview.operation, *besides.operations(access)]
    # The document comes before the entities: /apps/docs is about apps, not one of them.
    documented = [*docs.routes(gateway, described), *families, overview]
    return [*hot, *relay_routes(gateway.relay), *documented, *metrics.routes(gateway)]


def _refuse(_: Request, error: Exception) -> Response:
    assert isinstance(error, errors.ApiError)  # noqa: S101 - Starlette's contract
    return answer(error.body(), error.status)


def _unknown(request: Request, _: Exception) -> Response:
    return _refuse(request, errors.resource_not_found())


def _fail(request: Request, error: Exception) -> Response:
    return _refuse(request, errors.internal_error(error))
