"""Every route of the contract, on every sort of tree, held against the contract's own schemas."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import jsonschema
import pytest

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant

CONTRACT: dict[str, Any] = json.loads(
    (Path(__file__).parents[3] / "data" / "openapi-discovery.json").read_text()
)
OPERATIONS: list[tuple[str, str, dict[str, Any]]] = [
    (path, method, operation)
    for path, item in CONTRACT["paths"].items()
    for method, operation in item.items()
]
READ = sorted(
    path
    for path, method, operation in OPERATIONS
    if method == "get" and "content" in operation["responses"]["200"]
)
OF_AN_ENTITY = [path for path in READ if "{" in path]

KINDS = {"areas": "Area", "components": "Component", "apps": "App", "functions": "Function"}

# Lists of what belongs to an entity refuse in words of their own.
OWNERS = {
    *("/areas/{area_id}/components", "/areas/{area_id}/subareas", "/areas/{area_id}/contains"),
    "/components/{component_id}/subcomponents",
    "/components/{component_id}/hosts",
    "/components/{component_id}/depends-on",
    "/functions/{function_id}/hosts",
}

TREES = ["written", "heard", "mixed"]


@pytest.fixture(params=TREES)
def plant(request: pytest.FixtureRequest) -> Plant:
    made: Plant = request.getfixturevalue(request.param)
    return made


def kind_of(template: str) -> str:
    return KINDS[template.split("/")[1]]


def filled(template: str, entity_id: str, last: str = "status") -> str:
    """The path with an entity's id, and ``last`` in a second place if there is one."""
    first = re.sub(r"\{\w+\}", lambda _: quote(entity_id, safe=""), template, count=1)
    return re.sub(r"\{\w+\}", last, first)


def ids_of(plant: Plant, template: str) -> list[str]:
    """Everybody of the kind that a path is about, also those who are part of another."""
    tree = plant.gateway.directory.tree()
    return list(getattr(tree, template.split("/")[1]))


def check(template: str, body: object, status: str = "200", method: str = "get") -> None:
    answer = CONTRACT["paths"][template][method]["responses"][status]
    if "$ref" in answer:
        answer = CONTRACT["components"]["responses"]["GenericError"]
    schema = answer["content"]["application/json"]["schema"]
    whole = {**schema, "components": CONTRACT["components"]}
    jsonschema.Draft202012Validator(whole).validate(body)


def test_the_document_has_every_operation_with_its_id_its_tags_and_its_schemas(
    heard: Plant,
) -> None:
    document = heard.ok("/docs")
    for path, method, theirs in OPERATIONS:
        ours = document["paths"][path][method]
        assert ours["operationId"] == theirs["operationId"]
        assert ours["tags"] == theirs["tags"]
        assert parameters(ours) == parameters(theirs)
        assert ours.get("requestBody", {}).get("content") == theirs.get("requestBody", {}).get(
            "content"
        )
        for status, answer in ours["responses"].items():
            if status in theirs["responses"]:
                assert answer.get("content") == theirs["responses"][status].get("content")


def parameters(operation: dict[str, Any]) -> list[tuple[str, str, bool, str]]:
    return sorted(
        (one["name"], one["in"], one["required"], json.dumps(one["schema"], sort_keys=True))
        for one in operation.get("parameters", [])
    )


def test_each_schema_of_the_document_is_the_contracts_or_has_more_that_may_be_left_out(
    heard: Plant,
) -> None:
    ours = heard.ok("/docs")["components"]["schemas"]
    for name, theirs in CONTRACT["components"]["schemas"].items():
        assert set(ours[name].get("required", [])) == set(theirs.get("required", [])), name
        for key, schema in theirs.get("properties", {}).items():
            assert ours[name]["properties"][key] == schema, (name, key)


def test_every_answer_is_as_its_schema_says(plant: Plant) -> None:
    for template in READ:
        for path in answered(plant, template) if template in OF_AN_ENTITY else [template]:
            body = plant.ok(path)
            check(template, body)
            if "total_count" in body.get("x-medkit", {}):
                assert (path, body["x-medkit"]["total_count"]) == (path, len(body["items"]))


def answered(plant: Plant, template: str) -> Iterator[str]:
    """The paths below an entity at which there is something."""
    for entity_id in ids_of(plant, template):
        beacon = plant.gateway.directory.beacon(entity_id)
        if template.endswith("{data_id}") and (beacon is None or beacon.status == "left"):
            continue
        if template.endswith("{subscription_id}"):
            if beacon is None or beacon.status == "left" or "/functions" in template:
                continue
            yield filled(template, entity_id, subscribed(plant, template, entity_id))
        else:
            yield filled(template, entity_id)


def subscribed(plant: Plant, template: str, entity_id: str) -> str:
    collection = template.rpartition("/")[0]
    resource = f"/api/v1{filled(collection.rpartition('/')[0], entity_id)}/x-medkit-beacon"
    wanted = {"resource": resource, "interval": "slow", "duration": 60}
    response = plant.get(f"/api/v1{filled(collection, entity_id)}", "POST", wanted)
    assert response.status_code == 201
    check(collection, response.json(), "201", "post")
    subscription_id: str = response.json()["id"]
    return subscription_id


def test_an_unknown_entity_is_refused(plant: Plant) -> None:
    for template in OF_AN_ENTITY:
        kind = kind_of(template)
        message, key = "Entity not found", "entity_id"
        if template in OWNERS:
            message, key = f"{kind} not found", f"{kind.lower()}_id"
        expected = {
            "error_code": "entity-not-found",
            "message": message,
            "parameters": {key: "nobody"},
        }
        status, body = plant.refused(filled(template, "nobody"))
        check(template, body, "404")
        assert (template, status, body) == (template, 404, expected)


@pytest.mark.parametrize(
    ("actual", "entity_id"),
    [("Area", "cell"), ("Component", "ecu"), ("App", "planner"), ("Function", "drive")],
)
def test_an_entity_of_another_type_is_refused(mixed: Plant, actual: str, entity_id: str) -> None:
    for template in OF_AN_ENTITY:
        kind = kind_of(template)
        if actual == kind:
            continue
        status, body = mixed.refused(filled(template, entity_id))
        if template in OWNERS:
            check(template, body, "404")
            assert (template, status, body["message"]) == (template, 404, f"{kind} not found")
            continue
        check(template, body, "400")
        expected = {
            "error_code": "invalid-parameter",
            "message": f"Invalid entity type for route: expected {kind}, got {actual}",
            "parameters": {
                "entity_id": entity_id,
                "expected_type": kind,
                "actual_type": actual,
            },
        }
        assert (template, status, body) == (template, 400, expected)


ALLOWED = "Only alphanumeric, underscore and hyphen are allowed"
FORBIDDEN = [chr(code) for code in range(256) if not re.match(r"[A-Za-z0-9_/-]", chr(code))]


def refusal(template: str, entity_id: str, details: str) -> dict[str, Any]:
    """What an impossible id is answered with."""
    kind = kind_of(template)
    owner = template in OWNERS
    return {
        "error_code": "invalid-parameter",
        "message": f"Invalid {kind.lower() if owner else 'entity'} ID",
        "parameters": {
            "details": details,
            f"{kind.lower()}_id" if owner else "entity_id": entity_id,
        },
    }


@pytest.mark.parametrize("char", [" ", ".", "~", "\n", "\x00", "\x7f", "é", "\u2028", "%", "?"])
def test_a_forbidden_character_is_refused_on_every_route(heard: Plant, char: str) -> None:
    for template in OF_AN_ENTITY:
        for entity_id in (f"a{char}b", f"a{char}"):
            status, body = heard.refused(filled(template, entity_id))
            check(template, body, "400")
            expected = refusal(template, entity_id, fault_of(char))
            assert (template, status, body) == (template, 400, expected)


@pytest.mark.parametrize(
    "template", ["/apps/{app_id}", "/components/{component_id}/hosts", "/areas/{area_id}/data"]
)
def test_each_forbidden_character_is_named(heard: Plant, template: str) -> None:
    for char in FORBIDDEN:
        status, body = heard.refused(filled(template, f"a{char}b"))
        assert (status, body) == (400, refusal(template, f"a{char}b", fault_of(char)))


def fault_of(char: str) -> str:
    first = char.encode()[0]
    shown = chr(first) if 0x20 <= first < 0x7F else f"0x{first:02x}"
    return f"Entity ID contains invalid character: '{shown}'. {ALLOWED}"


def test_an_id_that_is_too_long_is_refused(heard: Plant) -> None:
    for template in OF_AN_ENTITY:
        status, body = heard.refused(filled(template, "a" * 257))
        expected = refusal(template, "a" * 257, "Entity ID too long (max 256 characters)")
        assert (template, status, body) == (template, 400, expected)


def test_an_empty_id_is_no_id(heard: Plant) -> None:
    for template in OF_AN_ENTITY:
        path = filled(template, "")
        if "//" in path:
            status, body = heard.refused(path)
            unknown = (path, 404, "resource-not-found")
            assert (path, status, body["error_code"]) == unknown


def test_an_id_with_a_slash_is_another_path(heard: Plant) -> None:
    for template in OF_AN_ENTITY:
        status, body = heard.refused(filled(template, "lidar/b"))
        assert (template, status) == (template, 404)
        assert body["error_code"] == "resource-not-found"


@pytest.mark.parametrize("method", ["PATCH", "OPTIONS", "TRACE"])
def test_another_method_is_an_unknown_resource(heard: Plant, method: str) -> None:
    for template in READ:
        response = heard.get(f"/api/v1{filled(template, 'lidar')}", method)
        assert (template, response.status_code) == (template, 404)
        assert response.json()["error_code"] == "resource-not-found"


def test_a_trailing_slash_changes_nothing(heard: Plant) -> None:
    for template in READ:
        path = f"/api/v1{filled(template, 'lidar').rstrip('/')}"
        assert heard.get(f"{path}/").status_code == heard.get(path).status_code
