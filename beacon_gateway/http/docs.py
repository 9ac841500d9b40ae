"""The OpenAPI document at ``/docs``, and the part of it that concerns a path at that path."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from beacon_gateway.gateway import Gateway
from beacon_gateway.http import errors
from beacon_gateway.http.answers import answer
from beacon_gateway.http.lookup import COLLECTIONS
from beacon_gateway.http.openapi import document, scoped
from beacon_gateway.http.operations import API_BASE, Operation
from beacon_gateway.http.server import version_of

__all__ = ["ENDPOINTS", "routes"]

ENDPOINTS = [f"GET {API_BASE}/docs", f"GET {API_BASE}/{{entity-path}}/docs"]
"""What the overview says of these routes, which the document does not list."""


def routes(gateway: Gateway, operations: Sequence[Operation]) -> list[BaseRoute]:
    """One route for the document of all these operations and all its parts."""

    @cache
    def whole() -> dict[str, Any]:
        return document(
            operations,
            title=gateway.config.server_name,
            version=version_of(gateway),
            url=API_BASE,
        )

    def serve(request: Request) -> Response:
        path: str = request.path_params["path"]
        part = scoped(whole(), path)
        if part is None or not _is_there(gateway, path):
            raise errors.resource_not_found()
        url = f"{request.scope.get('root_path', '')}{API_BASE}"
        return answer({**part, "servers": [{"url": url}]})

    made = Route(API_BASE + "{path:path}/docs", serve, methods=["GET"], name="getDocs")
    made.path_regex = re.compile(rf"{API_BASE}(?P<path>(?:/.*)?)/docs/?\Z")
    return [made]


def _is_there(gateway: Gateway, path: str) -> bool:
    """A path of nobody in particular is; one of an entity is if the entity is."""
    collection, _, rest = path.strip("/").partition("/")
    entity_id = rest.partition("/")[0]
    if not entity_id or collection not in COLLECTIONS.values():
        return True
    entities: Mapping[str, Any] = getattr(gateway.directory.tree(), collection)
    return entity_id in entities
