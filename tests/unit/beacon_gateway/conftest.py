"""A gateway on simulated carriers: time stands still until it is let pass."""

from __future__ import annotations

import asyncio
import logging
import re
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from typing import Any
from urllib.parse import unquote

import attrs
import httpx
import jsonschema
import pytest
from starlette.applications import Starlette

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_fake import ADAPTER, FakeAnnouncer, FakeNetwork, share_network, unshare_network
from beacon_gateway.adapters import load_adapter
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer

_AT_ROOT_TOO = ("/metrics", "/livez", "/readyz")


@pytest.fixture(autouse=True)
def logs_as_before() -> Iterator[None]:
    """A command logs to what stderr is during its test: nobody else is to."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)


class Contract:
    """What the gateway's own OpenAPI document promises of every answer."""

    def __init__(self, document: dict[str, Any]) -> None:
        self._components = document["components"]
        self._paths = [
            (re.compile(re.sub(r"{[^/]+}", "[^/]+", path.rstrip("/")) + r"/?\Z"), operations)
            for path, operations in document["paths"].items()
        ]

    def check(self, response: httpx.Response) -> None:
        """Fails if this is none of the answers that are promised for its request."""
        path = unquote(response.request.url.raw_path.decode().partition("?")[0])
        if path in _AT_ROOT_TOO:
            path = f"/api/v1{path}"
        if not path.startswith("/api/v1") or path.rstrip("/").endswith("/docs"):
            return
        promised = self._promised(path.removeprefix("/api/v1"), response.request.method)
        if promised is None:
            if response.status_code == httpx.codes.NOT_FOUND:
                self.validate(response.json(), {"$ref": "#/components/schemas/GenericError"})
            return
        answer = promised[str(response.status_code)]
        if "$ref" in answer:
            answer = self._components["responses"][answer["$ref"].rpartition("/")[2]]
        if "content" in answer:
            kind = response.headers["content-type"].partition(";")[0]
            schema = answer["content"][kind]["schema"]
            is_json = kind == "application/json"
            self.validate(response.json() if is_json else response.text, schema)

    def validate(self, body: object, schema: dict[str, Any]) -> None:
        """Fails unless the body is as the schema says, and nothing in it is null."""
        jsonschema.Draft202012Validator({**schema, "components": self._components}).validate(body)
        assert not _has_null(body), body

    def _promised(self, path: str, method: str) -> dict[str, Any] | None:
        for template, operations in self._paths:
            if template.match(path) and method.lower() in operations:
                answers: dict[str, Any] = operations[method.lower()]["responses"]
                return answers
        return None


def _has_null(body: object) -> bool:
    if isinstance(body, dict):
        return any(map(_has_null, body.values()))
    return any(map(_has_null, body)) if isinstance(body, list) else body is None


@attrs.define
class Plant:
    """A gateway, the networks it listens on (one per source), and its HTTP interface."""

    clock: ManualClock
    gateway: Gateway
    networks: dict[str, FakeNetwork]
    _app: Starlette | None = None
    _contract: Contract | None = None

    def announcer(self, name: str = "robot", source: str = "robots") -> FakeAnnouncer:
        return FakeAnnouncer(self.networks[source], name)

    def announce(self, entity_id: str, *, source: str = "robots", **fields: Any) -> FakeAnnouncer:
        """A robot of the entity's name that says one thing, and it has arrived."""
        announcer = self.announcer(f"{entity_id}@{source}-{uuid.uuid4().hex[:4]}", source)
        announcer.announce(BeaconHint(entity_id, **fields))
        self.settle()
        return announcer

    def settle(self) -> None:
        """Let everything under way arrive."""
        for network in self.networks.values():
            network.run_until_idle()

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.advance(int(seconds * 1e9))
        for network in self.networks.values():
            network.deliver_due()

    def get(self, path: str, method: str = "GET", json: object = None) -> httpx.Response:
        """One request through the whole application, whose answer keeps the contract."""

        async def ask() -> httpx.Response:
            self._app = self._app or create_app(self.gateway)
            transport = httpx.ASGITransport(self._app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                response = await client.request(method, path, json=json)
                if self._contract is None:
                    self._contract = Contract((await client.get("/api/v1/docs")).json())
                self._contract.check(response)
                return response

        return asyncio.run(ask())

    def ok(self, path: str) -> dict[str, Any]:
        """The body of an answer that must be a good one."""
        response = self.get(f"/api/v1{path}")
        assert response.status_code == 200, response.text
        assert response.headers["content-type"] == "application/json"
        body: dict[str, Any] = response.json()
        return body

    def refused(self, path: str) -> tuple[int, dict[str, Any]]:
        """Status and body of an error answer."""
        response = self.get(f"/api/v1{path}")
        assert response.headers["content-type"] == "application/json"
        return response.status_code, response.json()


class PlantMaker:
    def __init__(self) -> None:
        self._made: list[Plant] = []
        self._shared: list[str] = []

    def __call__(
        self,
        *,
        sources: dict[str, dict[str, Any]] | None = None,
        endpoints: dict[str, str] | None = None,
        **config: Any,
    ) -> Plant:
        """``endpoints``: adapters that there are besides, all of them simulated, with the endpoint
        that each brings."""
        clock = ManualClock()
        networks: dict[str, FakeNetwork] = {}
        documents: dict[str, dict[str, Any]] = {}
        for name, settings in (sources or {"robots": {}}).items():
            network_name = f"{name}-{uuid.uuid4().hex}"
            networks[name] = FakeNetwork(clock)
            share_network(networks[name], network_name)
            self._shared.append(network_name)
            documents[name] = {"adapter": "fake", "options": {"network": network_name}, **settings}

        def lookup(name: str) -> Adapter:
            if name not in (endpoints or {}):
                return load_adapter(name)
            return attrs.evolve(ADAPTER, name=name, vendor_endpoint=(endpoints or {})[name])

        loaded = parse_config({"sources": documents, **config}, lookup)
        gateway = Gateway(loaded.config, lookup=lookup, clock=clock)
        gateway.start()
        plant = Plant(clock, gateway, networks)
        self._made.append(plant)
        return plant

    def close(self) -> None:
        for plant in self._made:
            plant.gateway.close()
        for name in self._shared:
            unshare_network(name)


@pytest.fixture
def make_plant() -> Iterator[PlantMaker]:
    """Makes gateways from configuration keys; all sources are on simulated networks."""
    maker = PlantMaker()
    yield maker
    maker.close()


@pytest.fixture
def contract_of() -> Callable[[Starlette], Contract]:
    """What an application's document promises, whoever may read it."""

    def read(app: Starlette) -> Contract:
        async def ask() -> httpx.Response:
            # Its routes alone: the rules of access stand before them.
            transport = httpx.ASGITransport(app.router)
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                return await client.get("/api/v1/docs")

        return Contract(asyncio.run(ask()).json())

    return read


@pytest.fixture
def plant(make_plant: PlantMaker) -> Plant:
    """A gateway with one source, ``robots``, and nothing known beforehand."""
    return make_plant()


@pytest.fixture
def serve() -> Iterator[Callable[[Plant], str]]:
    """Serves a plant over real HTTP; returns the address."""
    with ExitStack() as stack:

        def start(plant: Plant) -> str:
            server = stack.enter_context(closing(HttpServer("127.0.0.1", 0)))
            thread = threading.Thread(target=server.serve, args=(create_app(plant.gateway),))
            thread.start()
            stack.callback(thread.join, 10)
            stack.callback(server.stop)
            return server.url

        yield start
