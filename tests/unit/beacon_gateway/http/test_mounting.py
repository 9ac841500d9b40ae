"""The interface inside somebody else's application."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route

from beacon_gateway.http import create_app

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant


def theirs(_: Request) -> Response:
    return PlainTextResponse("theirs")


def asked(app: Starlette, *paths: str) -> list[httpx.Response]:
    async def ask() -> list[httpx.Response]:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://their") as client:
            return [await client.get(path) for path in paths]

    return asyncio.run(ask())


def hrefs(body: Any) -> list[str]:
    """Every address in an answer."""
    if isinstance(body, dict):
        return [one for value in body.values() for one in hrefs(value)]
    if isinstance(body, list):
        return [one for value in body for one in hrefs(value)]
    return [body] if isinstance(body, str) and "/api/v1" in body else []


@pytest.mark.parametrize("prefix", ["", "/robots", "/a/b"])
def test_it_is_served_below_any_prefix_and_its_addresses_say_so(mixed: Plant, prefix: str) -> None:
    mount = Mount(prefix, app=create_app(mixed.gateway))
    app = Starlette(routes=[Route("/theirs", theirs), mount])
    paths = ["/apps", "/apps/planner", "/apps/planner/depends-on", "/components/ecu", "/", "/docs"]
    for response in asked(app, *(f"{prefix}/api/v1{path}" for path in paths)):
        assert response.status_code == 200
        found = hrefs(response.json())
        assert found
        assert all(
            one.removeprefix("GET ")
            .removeprefix("POST ")
            .removeprefix("PUT ")
            .removeprefix("DELETE ")
            .startswith(f"{prefix}/api/v1")
            for one in found
        )
        followed = [one for one in hrefs(response.json().get("_links")) if "{" not in one]
        assert all(
            one.status_code == 200 for one in asked(app, *followed) if "ghost" not in str(one.url)
        )
    assert asked(app, "/theirs")[0].text == "theirs"


def test_their_own_errors_stay_theirs(mixed: Plant) -> None:
    app = Starlette(routes=[Mount("/robots", app=create_app(mixed.gateway))])
    theirs_, ours = asked(app, "/nope", "/robots/api/v1/nope")
    assert theirs_.text == "Not Found"
    assert ours.json()["error_code"] == "resource-not-found"


def test_two_gateways_are_mounted_side_by_side(mixed: Plant, heard: Plant) -> None:
    routes = [
        Mount("/one", app=create_app(mixed.gateway)),
        Mount("/two", app=create_app(heard.gateway)),
    ]
    one, two = asked(Starlette(routes=routes), "/one/api/v1/apps", "/two/api/v1/apps")
    assert {item["id"] for item in two.json()["items"]} == {"lidar", "camera"}
    assert len(one.json()["items"]) == 5
