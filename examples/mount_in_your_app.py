"""Mount the gateway's HTTP interface in a web application of your own.

    python examples/mount_in_your_app.py          # http://127.0.0.1:8000/robots/api/v1/apps
    python examples/mount_in_your_app.py --once   # ask it a few things and stop

``create_app`` gives a plain ASGI application: Starlette, FastAPI, Quart and Litestar mount it below
any prefix, and every address in its answers begins with that prefix. Your application starts and
closes the gateway; here that is done in its lifespan.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

import httpx
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_fake import FakeAnnouncer, FakeNetwork, share_network
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app

# A simulated network, so that the example runs by itself (and a clock that stands still); yours is
# {"adapter": "zenoh"} or so.
clock = ManualClock()
network = FakeNetwork(clock)
share_network(network, "example")
config = parse_config(
    {
        "sources": {"robots": {"adapter": "fake", "options": {"network": "example"}}},
        "entities": {"components": [{"id": "ecu_front"}]},
    }
).config
gateway = Gateway(config, clock=clock)


async def hello(_: Request) -> Response:
    return PlainTextResponse("your own page")


@asynccontextmanager
async def lifespan(_: Starlette) -> AsyncGenerator[None, None]:
    gateway.start()
    announcer = FakeAnnouncer(network, "robot")
    announcer.announce(BeaconHint("engine_temp", component_id="ecu_front"))
    network.run_until_idle()
    yield
    announcer.close()
    gateway.close()


app = Starlette(
    routes=[Route("/", hello), Mount("/robots", app=create_app(gateway))],
    lifespan=lifespan,
)


async def ask_once() -> None:
    async with (
        lifespan(app),
        httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://here") as client,
    ):
        print((await client.get("/")).text)
        for item in (await client.get("/robots/api/v1/apps")).json()["items"]:
            beacon = (await client.get(f"{item['href']}/x-medkit-beacon")).json()
            print(f"{item['href']} is {beacon['status']}")


if __name__ == "__main__":
    if "--once" in sys.argv:
        asyncio.run(ask_once())
    else:
        uvicorn.run(app, port=8000)
