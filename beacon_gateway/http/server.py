"""The server about itself."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
from starlette.routing import BaseRoute

from beacon_gateway import __version__
from beacon_gateway.gateway import Gateway
from beacon_gateway.http.health import health_of
from beacon_gateway.http.models.server import (
    HealthStatus,
    RootAuth,
    RootCapabilities,
    RootOverview,
    RootTls,
    VersionInfo,
    VersionInfoEntry,
    VersionInfoVendor,
)
from beacon_gateway.http.operations import API_BASE, ApiRoute, Asked, Operation, route

__all__ = ["overview_route", "routes", "version_of"]

_CAPABILITIES = RootCapabilities(
    discovery=True,
    data_access=True,
    operations=False,
    async_actions=False,
    configurations=False,
    faults=False,
    logs=False,
    bulk_data=False,
    cyclic_subscriptions=True,
    locking=False,
    triggers=False,
    updates=False,
    authentication=False,
    tls=False,
    scripts=False,
    aggregation=False,
    vendor_extensions=True,
)


def routes(gateway: Gateway) -> list[BaseRoute]:
    """Never kept: whoever asks these wants to know how it is now."""
    health = Operation(
        id="getHealth",
        tag="Server",
        path="/health",
        summary="How the gateway and each of its sources are doing",
        body=HealthStatus,
    )
    version = Operation(
        id="getVersionInfo",
        tag="Server",
        path="/version-info",
        summary="Which version of the interface is spoken here, and by whom",
        body=VersionInfo,
    )
    return [route(gateway, health, _health), route(gateway, version, _version_info)]


def overview_route(gateway: Gateway, endpoints: Sequence[str]) -> ApiRoute:
    """The route of the overview, which names the given endpoints."""
    operation = Operation(
        id="getRoot",
        tag="Server",
        path="/",
        summary="Who serves, what there is, and what it can do",
        body=RootOverview,
    )

    def overview(asked: Asked) -> RootOverview:
        return RootOverview(
            name=gateway.config.server_name,
            version=version_of(gateway),
            api_base=asked.base,
            endpoints=[one.replace(API_BASE, asked.base, 1) for one in endpoints],
            capabilities=_capabilities(gateway),
            auth=_auth(gateway),
            tls=_tls(gateway),
        )

    return route(gateway, operation, overview)


def version_of(gateway: Gateway) -> str:
    """The configured version, or the gateway's own."""
    return gateway.config.server_version or __version__


def _capabilities(gateway: Gateway) -> RootCapabilities:
    http = gateway.config.http
    on = {"authentication": http.auth is not None, "tls": http.tls is not None}
    return attrs.evolve(_CAPABILITIES, **on)


def _auth(gateway: Gateway) -> RootAuth | None:
    auth = gateway.config.http.auth
    if auth is None:
        return None
    return RootAuth(enabled=True, algorithm=auth.algorithm, require_auth_for=auth.require_auth_for)


def _tls(gateway: Gateway) -> RootTls | None:
    tls = gateway.config.http.tls
    return None if tls is None else RootTls(enabled=True, min_version=tls.min_version)


def _health(asked: Asked) -> HealthStatus:
    return health_of(asked.gateway)


def _version_info(asked: Asked) -> VersionInfo:
    vendor = VersionInfoVendor(
        version=version_of(asked.gateway), name=asked.gateway.config.vendor_name
    )
    entry = VersionInfoEntry(version="1.0.0", base_uri=asked.base, vendor_info=vendor)
    return VersionInfo(items=[entry])
