"""A gateway on simulated carriers: time stands still until it is let pass."""

from __future__ import annotations

import asyncio
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from typing import Any

import attrs
import httpx
import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_fake import ADAPTER, FakeAnnouncer, FakeNetwork, share_network, unshare_network
from beacon_gateway.adapters import load_adapter
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer


@attrs.define
class Plant:
    """A gateway, the networks it listens on (one per source), and its HTTP interface."""

    clock: ManualClock
    gateway: Gateway
    networks: dict[str, FakeNetwork]

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

    def get(self, path: str, method: str = "GET") -> httpx.Response:
        """One request through the whole application."""

        async def ask() -> httpx.Response:
            transport = httpx.ASGITransport(create_app(self.gateway), raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                return await client.request(method, path)

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
