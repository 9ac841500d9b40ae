"""The OpenAPI document, whole and in part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import attrs
import pytest

from beacon_gateway.http.models.base import Open, key, optional_key
from beacon_gateway.http.schemas import Schemas

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

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
