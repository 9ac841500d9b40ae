"""The OpenAPI document, whole and in part."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import TYPE_CHECKING, Any

import attrs
import httpx
import pytest
from starlette.applications import Starlette

from beacon_gateway.access import middleware
from beacon_gateway.http import create_app
from beacon_gateway.http.models.base import Open, key, optional_key
from beacon_gateway.http.schemas import Schemas

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Contract, Plant, PlantMaker

UNKNOWN = {
    "error_code": "resource-not-found",
    "message": "Resource not found",
    "parameters": {"status": 404},
}


def names(operation: dict[str, Any]) -> list[str]:
    return [one["name"] for one in operation["parameters"]]


def test_the_document_says_which_standard_it_follows(heard: Plant) -> None:
    body = heard.ok("/docs")
    assert body["openapi"] == "3.1.0"
    assert body["info"]["x-sovd-version"] == "1.0.0"
    assert body["servers"] == [{"url": "/api/v1"}]
    assert "GenericError" in body["components"]["responses"]
    assert len(
        {one["operationId"] for item in body["paths"].values() for one in item.values()}
    ) == sum(len(item) for item in body["paths"].values())


def test_vendor_endpoints_are_in_it_as_far_as_there_are_any(make_plant: PlantMaker) -> None:
    endpoint = "x-medkit-topic-beacon"
    plant = make_plant(sources={"a": {"adapter": "topic"}}, endpoints={"topic": endpoint})
    paths = plant.ok("/docs")["paths"]
    operation = paths[f"/apps/{{app_id}}/{endpoint}"]["get"]
    assert operation["operationId"] == "getAppTopicBeacon"
    assert paths["/apps/{app_id}/x-medkit-beacon"]["get"]["operationId"] == "getAppBeacon"
    assert f"/apps/{{app_id}}/{endpoint}" not in make_plant().ok("/docs")["paths"]


def test_a_collection_has_a_document_of_its_own(heard: Plant) -> None:
    for path in ("/apps/docs", "/apps/docs/"):
        paths = heard.ok(path)["paths"]
        assert "/apps" in paths
        assert "/apps/{app_id}/data" in paths
        assert all(one.startswith("/apps") for one in paths)


def test_in_an_entitys_document_its_id_is_filled_in(heard: Plant) -> None:
    paths = heard.ok("/apps/camera/docs")["paths"]
    assert "/apps/camera" in paths
    assert names(paths["/apps/camera"]["get"]) == []
    assert names(paths["/apps/camera/data/{data_id}"]["get"]) == ["data_id"]
    assert list(heard.ok("/apps/camera/data/status/docs")["paths"]) == ["/apps/camera/data/status"]


def test_what_is_served_besides_the_contract_is_in_it_and_answers_as_it_says(heard: Plant) -> None:
    document = heard.ok("/docs")
    assert {"/x-medkit-beacon", "/x-medkit-beacon/stream"} < {*document["paths"]}
    assert heard.ok("/x-medkit-beacon")["complete"] is True
    assert heard.ok("/x-medkit-beacon?full=true")["items"] != []
    assert heard.refused("/x-medkit-beacon?wait=long")[0] == 400
    for path in ("/livez", "/readyz", "/metrics"):
        assert path in document["info"]["description"]
        assert heard.get(path).status_code == 200
        assert heard.get(f"/api/v1{path}").status_code == 200


def test_what_monitoring_asks_is_in_it_with_both_its_answers(heard: Plant) -> None:
    document = heard.ok("/docs")
    answers = document["paths"]["/metrics"]["get"]["responses"]
    assert {*answers["200"]["content"]} == {"text/plain", "application/openmetrics-text"}
    for path in ("/livez", "/readyz"):
        answers = document["paths"][path]["get"]["responses"]
        for status in ("200", "503"):
            schema = answers[status]["content"]["application/json"]["schema"]
            assert schema == {"$ref": "#/components/schemas/Probe"}
    assert list(heard.ok("/livez/docs")["paths"]) == ["/livez"]
    # The contract of each answer is held against the document.
    heard.gateway.close()
    for path in ("/livez", "/readyz", "/api/v1/livez", "/api/v1/readyz"):
        response = heard.get(path)
        assert (path, response.status_code) == (path, 503)
        assert response.json()["reasons"] != []


def test_what_is_too_large_or_does_not_come_is_refused_as_the_document_says(
    heard: Plant,
    contract_of: Callable[[Starlette], Contract],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(middleware, "_BODY_WITHIN_S", 0.05)
    path = "/api/v1/apps/lidar/cyclic-subscriptions"

    async def stuck() -> AsyncIterator[bytes]:
        yield b"{"
        await asyncio.sleep(30)

    def ask(method: str, **given: Any) -> httpx.Response:
        async def once() -> httpx.Response:
            transport = httpx.ASGITransport(create_app(heard.gateway))
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                return await client.request(method, path, **given)

        return asyncio.run(once())

    answers = {
        408: ask("POST", content=stuck()),
        413: ask("POST", content=b"x" * 100_000),
        431: ask("GET", headers={"x": "y" * 20_000}),
    }
    contract = contract_of(create_app(heard.gateway))
    for status, answer in answers.items():
        assert answer.status_code == status
        contract.check(answer)


def test_every_operation_may_refuse_a_head_or_a_body(heard: Plant) -> None:
    refusal = {"$ref": "#/components/responses/GenericError"}
    for item in heard.ok("/docs")["paths"].values():
        for operation in item.values():
            for status in ("408", "413", "431"):
                assert operation["responses"][status] == refusal


def test_every_operation_may_want_a_token_and_set_limits(heard: Plant) -> None:
    document = heard.ok("/docs")
    refusal = "#/components/responses/GenericError"
    for item in document["paths"].values():
        for operation in item.values():
            for status in ("403", "429"):
                assert operation["responses"][status]["$ref"] == refusal
            assert "401" in operation["responses"]


@pytest.mark.parametrize(
    "path", ["/apps/nobody/docs", "/nope/docs", "/apps/camera/nope/docs", "/docs/docs"]
)
def test_where_nothing_is_served_there_is_no_document(heard: Plant, path: str) -> None:
    assert heard.refused(path) == (404, UNKNOWN)


# Schemas


@attrs.frozen
class Inner:
    """What is inside.

    And more of it.
    """

    value: float


@attrs.frozen(kw_only=True)
class Outer:
    name: str = key("the-name")
    inner: Inner | None = optional_key("x-inner")  # noqa: RUF009 - it is attrs.field
    open: Open
    itself: Outer | None = None


def test_a_schema_is_made_of_a_class() -> None:
    schemas = Schemas()
    assert schemas.reference(Outer) == {"$ref": "#/components/schemas/Outer"}
    itself = {"$ref": "#/components/schemas/Outer"}
    assert schemas.by_name == {
        "Inner": {
            "description": "What is inside.",
            "type": "object",
            "properties": {"value": {"type": "number"}},
            "required": ["value"],
        },
        "Outer": {
            "type": "object",
            "properties": {
                "the-name": {"type": "string"},
                "x-inner": {"anyOf": [{"$ref": "#/components/schemas/Inner"}, {"type": "null"}]},
                "open": {},
                "itself": {"anyOf": [itself, {"type": "null"}]},
            },
            "required": ["the-name", "open"],
        },
    }
