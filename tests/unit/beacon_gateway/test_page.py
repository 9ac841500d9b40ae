"""The page's files: that they are all there, and how they are handed out."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from importlib.resources import files
from typing import Protocol

import httpx
import pytest

from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app

STATIC = {
    path.name: path.read_text()
    for path in files("beacon_gateway.page").joinpath("static").iterdir()
}


class Plant(Protocol):
    gateway: Gateway

    def get(self, path: str, method: str = ...) -> httpx.Response: ...


def test_the_page_and_everything_it_names_is_served(plant: Plant) -> None:
    page = plant.get("/")
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    named = set(re.findall(r'(?:href|src)="(page/[a-z.]+)"', page.text))
    imported = {
        f"page/{name}" for text in STATIC.values() for name in re.findall(r"from './(.+)'", text)
    }
    assert named | imported == {f"page/{name}" for name in STATIC if name != "index.html"}
    for path in named | imported:
        answer = plant.get(f"/{path}")
        assert (answer.status_code, answer.text) == (200, STATIC[path.removeprefix("page/")])


@pytest.mark.parametrize("path", ["/", "/page/app.js", "/page/style.css", "/page/icon.svg"])
def test_nothing_but_its_own_files_may_run_in_it(plant: Plant, path: str) -> None:
    headers = plant.get(path).headers
    policy = headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["x-content-type-options"] == "nosniff"


def test_no_script_of_it_can_make_markup_of_a_text() -> None:
    for name, text in STATIC.items():
        for way in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
            assert way not in text, name
    assert not re.search(r"<[^>]+ (?:style|on[a-z]+)=", STATIC["index.html"])


def test_it_names_nobody_elses_address() -> None:
    for name, text in STATIC.items():
        addresses = re.findall(r"https?://[^\s'\"]+", text)
        assert set(addresses) <= {"http://www.w3.org/2000/svg"}, name


def test_what_a_browser_has_is_not_sent_again(plant: Plant) -> None:
    first = plant.get("/page/app.js")

    async def again() -> httpx.Response:
        transport = httpx.ASGITransport(create_app(plant.gateway))
        async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
            return await client.get(
                "/page/app.js", headers={"if-none-match": first.headers["etag"]}
            )

    answer = asyncio.run(again())
    assert (answer.status_code, answer.content) == (304, b"")


def test_a_file_that_is_not_there_is_unknown(
    plant: Plant, make_plant: Callable[..., Plant]
) -> None:
    assert plant.get("/page/../gateway.py").status_code == 404
    assert plant.get("/page/index.html").status_code == 404
