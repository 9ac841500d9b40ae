"""Beacons as data items, and the resources that are always empty."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant


def test_each_field_of_a_beacon_is_a_data_item(heard: Plant) -> None:
    items = {one["id"]: one for one in heard.ok("/apps/camera/data")["items"]}
    beacon = heard.ok("/apps/camera/x-medkit-beacon")
    assert len(items) == 13
    for data_id, item in items.items():
        assert item["value"] == beacon[data_id]
        assert item.keys() == {"id", "name", "category", "value", "x-medkit"}
    assert items["metadata"]["value"] == {"lens": "wide"}
    assert items["process_id"]["x-medkit"] == {
        "middleware": "beacon",
        "access": "read",
        "direction": "output",
        "type": "integer",
        "entity_id": "camera",
        "ros2": {"direction": "publish", "type": "integer"},
    }


def test_one_data_item_has_its_value_where_either_client_looks(heard: Plant) -> None:
    body = heard.ok("/apps/camera/data/hostname")
    assert (body["id"], body["data"], body["value"]) == ("hostname", "h", "h")
    assert body["x-medkit"]["access"] == "read"


def test_a_component_has_data_too_and_areas_and_functions_have_none(mixed: Plant) -> None:
    assert mixed.ok("/components/ecu/data/metadata")["value"] == {"firmware": "1.2"}
    for path in ("/areas/cell", "/functions/drive", "/apps/camera", "/apps/gone"):
        body = mixed.ok(f"{path}/data")
        assert body["items"] == []
        assert body["x-medkit"]["total_count"] == 0


@pytest.mark.parametrize(
    "path", ["/apps/planner/data/nope", "/apps/camera/data/status", "/areas/cell/data/status"]
)
def test_a_data_item_that_is_not_there(mixed: Plant, path: str) -> None:
    status, body = mixed.refused(path)
    _, _, entity_id, _, data_id = path.split("/")
    assert (status, body) == (
        404,
        {
            "error_code": "resource-not-found",
            "message": "Data item not found",
            "parameters": {"entity_id": entity_id, "data_id": data_id},
        },
    )


@pytest.mark.parametrize(
    "path", ["/areas/cell", "/components/ecu", "/apps/planner", "/functions/drive"]
)
def test_what_is_not_known_here_is_empty(mixed: Plant, path: str) -> None:
    for resource in ("operations", "configurations", "logs", "bulk-data"):
        assert mixed.ok(f"{path}/{resource}")["items"] == []
    assert mixed.ok(f"{path}/faults") == {"items": [], "x-medkit": {"count": 0}}


def test_there_are_no_faults_however_they_are_asked_for(heard: Plant) -> None:
    for query in ("", "?status=all", "?status=confirmed&include_muted=true"):
        assert heard.ok(f"/faults{query}") == {"items": [], "x-medkit": {"count": 0}}


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("/faults?status=odd", "status"),
        ("/faults?include_muted=1", "include_muted"),
        ("/apps/camera/faults?status=", "status"),
        ("/apps/camera/logs?severity=loud", "severity"),
    ],
)
def test_a_parameter_that_cannot_be_is_refused(heard: Plant, path: str, name: str) -> None:
    status, body = heard.refused(path)
    assert (status, body["error_code"]) == (400, "invalid-parameter")
    assert body["message"].startswith(f"Invalid {name}. Must be one of: ")
    assert body["parameters"]["parameter"] == name
