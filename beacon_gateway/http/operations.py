"""One operation of the interface: what is served, and what the OpenAPI document says of it.

Both come from the same value, so the document cannot promise what is not there. A family of routes
is a list of operations, each with its handler; a handler is a plain function from what was asked to
the body of the answer, and refuses by raising
:class:`~beacon_gateway.http.errors.ApiError`.
"""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Mapping
from functools import cached_property, partial
from typing import TypeAlias

import attrs
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from beacon_gateway.gateway import Gateway
from beacon_gateway.http import errors
from beacon_gateway.http.models.base import as_plain
from beacon_gateway.http.shortcut import key_of
from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.tree.entities import Tree
from beacon_gateway.writing import JSON, to_json

__all__ = [
    "API_BASE",
    "ApiRoute",
    "Asked",
    "Handler",
    "Operation",
    "Parameter",
    "Serve",
    "ask",
    "route",
]


API_BASE = "/api/v1"
"""What every path begins with, as clients of ros2_medkit expect."""

_SLOT = re.compile(r"\{(\w+)\}")


@attrs.frozen(slots=False)
class Asked:
    """What a handler is asked."""

    gateway: Gateway
    base: str
    """What every address in an answer begins with; more than ``API_BASE`` where it is mounted."""
    params: Mapping[str, str]
    query: Mapping[str, str]

    @cached_property
    def tree(self) -> Tree:
        """All entities, at one moment."""
        return self.gateway.directory.tree()

    @property
    def id(self) -> str:
        """Whom it is about: the first thing the path names."""
        return next(iter(self.params.values()))


Handler: TypeAlias = Callable[[Asked], object]
"""From what was asked to the answer's body; refuses by raising ``ApiError``."""

Serve: TypeAlias = Callable[[Request], Awaitable[Response]]
"""From a request to its response, as Starlette calls it."""


@attrs.frozen(kw_only=True)
class Parameter:
    """One parameter of a query."""

    name: str
    choices: tuple[str, ...] = ()
    """Empty: any text."""

    def check(self, query: Mapping[str, str]) -> None:
        """Raises ``ApiError`` for a value that it cannot have."""
        given = query.get(self.name)
        if given is not None and self.choices and given not in self.choices:
            raise errors.invalid_parameter(
                f"Invalid {self.name}. Must be one of: {', '.join(self.choices)}",
                parameter=self.name,
                value=given,
            )


@attrs.frozen(kw_only=True)
class Operation:
    """What the OpenAPI document says of one route."""

    id: str
    tag: str
    path: str
    """Below ``API_BASE``, such as ``/apps/{app_id}``."""
    summary: str
    body: type | None = None
    """What is answered; ``None``: nothing, or no JSON."""
    method: str = "GET"
    status: int = 200
    request: type | None = None
    parameters: tuple[Parameter, ...] = ()
    streams: bool = False
    """The answer is a stream of events."""
    refusals: tuple[int, ...] = ()
    """Statuses of refusals besides those that every operation has."""
    errors: Mapping[int, type] = attrs.field(factory=dict)
    """Refusals in another form than usual, by status."""
    media: tuple[str, ...] = ()
    """The media types of an answer that is no JSON."""

    @property
    def slots(self) -> tuple[str, ...]:
        """What the path leaves open, in order."""
        return tuple(_SLOT.findall(self.path))


class ApiRoute(Route):
    """The route of an operation; a trailing slash is accepted."""

    def __init__(self, operation: Operation, serve: Serve) -> None:
        path = API_BASE + operation.path
        super().__init__(path, serve, methods=[operation.method], name=operation.id)
        self.operation = operation
        pattern = _SLOT.sub(r"(?P<\1>[^/]+)", path.rstrip("/"))
        # \Z: an id may not end in a line break that nobody sees.
        self.path_regex = re.compile(rf"{pattern}/?\Z")


def route(
    gateway: Gateway,
    operation: Operation,
    handler: Handler,
    *,
    kept: Snapshots | None = None,
    in_thread: bool = False,
) -> ApiRoute:
    """The route of an operation that is answered by a handler.

    ``kept``: where answers are kept for a moment, for :mod:`beacon_gateway.http.shortcut` to give
    out. ``in_thread``: it may take long, and is to keep nobody waiting meanwhile.
    """

    async def serve(request: Request) -> Response:
        asked = ask(gateway, operation, request)
        make = partial(_content, handler, asked)
        if kept is not None:
            make = partial(kept.make, key_of(request.scope), make)
        content = await run_in_threadpool(make) if in_thread else make()
        return Response(content, operation.status, media_type=JSON)

    return ApiRoute(operation, serve)


def ask(gateway: Gateway, operation: Operation, request: Request) -> Asked:
    """What a request asks. Raises ``ApiError`` for a parameter that cannot be."""
    query: Mapping[str, str] = request.query_params if operation.parameters else {}
    for parameter in operation.parameters:
        parameter.check(query)
    base = f"{request.scope.get('root_path', '')}{API_BASE}"
    return Asked(gateway, base, request.path_params, query)


def _content(handler: Handler, asked: Asked) -> bytes:
    return to_json(as_plain(handler(asked)))
