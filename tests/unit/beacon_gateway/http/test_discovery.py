"""What is told of each entity, and how entities lead to each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from beacon_core.hint import BeaconHint

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

RESOURCES = "data operations configurations faults logs"


def ids(body: dict[str, Any]) -> list[str]:
    return [item["id"] for item in body["items"]]


def item(body: dict[str, Any], entity_id: str) -> dict[str, Any]:
    (found,) = [one for one in body["items"] if one["id"] == entity_id]
    assert isinstance(found, dict)
    return found


def test_collections_of_areas_and_components_have_only_those_that_are_part_of_no_other(
    written: Plant,
) -> None:
    assert ids(written.ok("/areas")) == ["cell", "yard"]
    assert ids(written.ok("/components")) == ["ecu", "power"]
    assert ids(written.ok("/apps")) == ["planner", "camera", "floater"]
    assert ids(written.ok("/functions")) == ["drive", "see"]


def test_a_line_has_what_the_manifest_says(written: Plant) -> None:
    assert item(written.ok("/areas"), "cell") == {
        "id": "cell",
        "name": "Cell",
        "href": "/api/v1/areas/cell",
        "type": "area",
        "description": "Where it is built",
        "tags": ["west"],
        "x-medkit": {"ros2": {"namespace": "/cell"}},
    }
    ecu = item(written.ok("/components"), "ecu")["x-medkit"]
    assert ecu["ros2"] == {"node": "/cell/ecu", "namespace": "/cell"}
    assert ecu["identity"] == {"manufacturer": "Acme"}
    assert "external" not in ecu
    board = item(written.ok("/components/ecu/subcomponents"), "board")["x-medkit"]
    assert board["external"] is True
    assert item(written.ok("/functions"), "drive")["x-medkit"] == {"source": "manifest"}


@pytest.mark.parametrize(
    ("path", "capabilities"),
    [
        ("/areas/cell", f"subareas contains {RESOURCES} bulk-data triggers"),
        (
            "/components/ecu",
            (
                f"status {RESOURCES} subcomponents hosts bulk-data cyclic-subscriptions triggers "
                "depends-on x-medkit-beacon"
            ),
        ),
        (
            "/apps/planner",
            (
                f"status {RESOURCES} bulk-data cyclic-subscriptions triggers is-located-on "
                "belongs-to depends-on x-medkit-beacon"
            ),
        ),
        ("/functions/drive", f"hosts {RESOURCES} bulk-data cyclic-subscriptions triggers"),
    ],
)
def test_capabilities_are_in_the_order_clients_show(
    written: Plant, path: str, capabilities: str
) -> None:
    body = written.ok(path)
    assert body["capabilities"] == [
        {"name": name, "href": f"/api/v1{path}/{name}"} for name in capabilities.split()
    ]
    if "components" in path:
        assert body["x-medkit"]["capabilities"] == body["capabilities"]


def test_details_lead_to_their_relatives(written: Plant) -> None:
    api = "/api/v1"
    assert written.ok("/areas/gate")["_links"] == {
        "self": f"{api}/areas/gate",
        "collection": f"{api}/areas",
        "parent": f"{api}/areas/cell",
    }
    assert written.ok("/areas/gate")["x-medkit"]["parent_area_id"] == "cell"
    board = written.ok("/components/board")
    assert board["_links"]["parent"] == f"{api}/components/ecu"
    assert board["_links"]["area"] == board["belongs-to"] == f"{api}/areas/gate"
    assert board["x-medkit"]["parentComponentId"] == "ecu"
    assert "depends-on" not in board
    planner = written.ok("/apps/planner")
    assert planner["_links"] == {
        "self": f"{api}/apps/planner",
        "collection": f"{api}/apps",
        "is-located-on": f"{api}/components/ecu",
        "belongs-to": f"{api}/apps/planner/belongs-to",
        "depends-on": [f"{api}/apps/camera", f"{api}/apps/ghost", f"{api}/components/power"],
    }
    assert planner["depends-on"] == f"{api}/apps/planner/depends-on"
    assert planner["translation_id"] == "t.planner"
    drive = written.ok("/functions/drive")
    assert drive["_links"]["depends-on"] == [f"{api}/functions/see"]
    assert drive["x-medkit-graph"] == f"{api}/functions/drive/x-medkit-graph"
    assert drive["x-medkit"] == {
        "source": "manifest",
        "hosts": ["planner", "ecu"],
        "description": "Moves",
    }


def test_a_component_in_detail_says_more_than_its_line(written: Plant) -> None:
    block = written.ok("/components/ecu")["x-medkit"]
    said = {
        "type": "controller",
        "area": "cell",
        "variant": "B",
        "description": "The front controller",
        "dependsOn": ["power", "ghost_ecu"],
    }
    assert {key: block[key] for key in said} == said
    assert not said.keys() & item(written.ok("/components"), "ecu")["x-medkit"].keys()


@pytest.mark.parametrize(
    ("path", "found", "owner"),
    [
        ("/areas/cell/components", ["ecu"], None),
        ("/areas/cell/subareas", ["gate"], ("parent", "/areas/cell")),
        ("/areas/cell/contains", ["ecu", "board"], ("area", "/areas/cell")),
        ("/areas/yard/contains", [], ("area", "/areas/yard")),
        ("/components/ecu/subcomponents", ["board"], ("parent", "/components/ecu")),
        ("/components/ecu/hosts", ["planner"], ("component", "/components/ecu")),
        ("/components/ecu/depends-on", ["power", "ghost_ecu"], ("component", "/components/ecu")),
        ("/apps/planner/is-located-on", ["ecu"], ("app", "/apps/planner")),
        ("/apps/planner/belongs-to", ["cell"], ("app", "/apps/planner")),
        ("/apps/floater/belongs-to", [], ("app", "/apps/floater")),
        ("/apps/planner/depends-on", ["camera", "ghost", "power"], ("app", "/apps/planner")),
        ("/functions/drive/hosts", ["planner"], ("function", "/functions/drive")),
    ],
)
def test_relations(
    written: Plant, path: str, found: list[str], owner: tuple[str, str] | None
) -> None:
    body = written.ok(path)
    assert ids(body) == found
    assert body["x-medkit"] == {"total_count": len(found)}
    if owner is None:
        assert "_links" not in body
    else:
        key, href = owner
        assert body["_links"] == {"self": f"/api/v1{path}", key: f"/api/v1{href}"}


def test_who_is_referred_to_and_not_there_is_listed_as_missing(mixed: Plant) -> None:
    mixed.announce("stray", component_id="drive")
    for path, entity_id, kind in (
        ("/apps/planner/depends-on", "ghost", "app"),
        ("/components/ecu/depends-on", "ghost_ecu", "component"),
        ("/apps/stray/is-located-on", "drive", "component"),
    ):
        assert item(mixed.ok(path), entity_id) == {
            "id": entity_id,
            "name": entity_id,
            "href": f"/api/v1/{kind}s/{entity_id}",
            "type": kind,
            "x-medkit": {"missing": True},
        }
    assert mixed.ok("/apps/stray/belongs-to")["items"] == [
        {
            "id": "",
            "name": "<unknown area>",
            "href": "",
            "type": "area",
            "x-medkit": {"missing": True, "unresolved_component": "drive"},
        }
    ]


def test_an_app_on_a_component_that_only_its_hint_names_is_found_on_the_way_there(
    mixed: Plant,
) -> None:
    assert "unplaced" in ids(mixed.ok("/areas"))
    assert "mast" in ids(mixed.ok("/areas/unplaced/components"))
    assert item(mixed.ok("/components"), "mast")["x-medkit"] == {"source": "beacon"}
    assert mixed.ok("/components/mast")["name"] == "mast"
    assert ids(mixed.ok("/components/mast/hosts")) == ["lidar"]
    assert ids(mixed.ok("/apps/lidar/is-located-on")) == ["mast"]
    assert ids(mixed.ok("/apps/lidar/belongs-to")) == ["unplaced"]


def test_an_app_that_depends_on_a_component_is_told_so(written: Plant) -> None:
    power = item(written.ok("/apps/planner/depends-on"), "power")
    assert (power["type"], power["href"]) == ("component", "/api/v1/components/power")
    assert "missing" not in power["x-medkit"]


# What is expected, and whether it holds


def test_who_was_never_heard_is_told_apart_from_who_is_silent(mixed: Plant) -> None:
    apps = mixed.ok("/apps")
    assert item(apps, "camera")["x-medkit"]["expected"] is True
    assert item(apps, "camera")["x-medkit"]["never_heard"] is True
    assert "never_heard" not in item(apps, "planner")["x-medkit"]
    mixed.wait(400)
    apps = mixed.ok("/apps")
    assert "never_heard" not in item(apps, "planner")["x-medkit"]
    assert "beacon" not in item(apps, "planner")["x-medkit"]
    assert mixed.ok("/components/power")["x-medkit"]["never_heard"] is True


def test_dependencies_are_active_or_there_is_a_way_to_what_is_not(mixed: Plant) -> None:
    block = mixed.ok("/apps/planner")["x-medkit"]
    assert block["depends_on_active"] is False
    assert block["reason_chain"] == ["planner", "camera"]
    assert block["depends_on_reason"] == "camera was never heard"
    assert mixed.ok("/apps/planner/x-medkit-beacon")["reason_chain"] == ["planner", "camera"]
    assert "depends_on_active" not in mixed.ok("/apps/camera")["x-medkit"]
    mixed.announce("camera")
    lidar = mixed.ok("/apps/lidar")["x-medkit"]
    assert lidar["depends_on_active"] is True
    assert "reason_chain" not in lidar
    assert item(mixed.ok("/apps"), "lidar")["x-medkit"]["depends_on_active"] is True


def test_a_longer_chain_is_told_whole(make_plant: PlantMaker) -> None:
    plant = make_plant()
    plant.announce("a", depends_on=("b",))
    plant.announce("b", depends_on=("c",))
    plant.announce("c", depends_on=("a",))
    assert plant.ok("/apps/a")["x-medkit"]["depends_on_active"] is True
    plant.networks["robots"].crash(plant.announce("c", process_id=2).name)
    plant.wait(1)
    for path in ("/apps/a", "/apps/a/x-medkit-beacon"):
        body = plant.ok(path)
        told = body.get("x-medkit", body)
        assert told["reason_chain"] == ["a", "b", "c"]
        assert told["depends_on_reason"].startswith("c is stale")
    assert item(plant.ok("/apps"), "a")["x-medkit"]["reason_chain"] == ["a", "b", "c"]


def test_functions_are_told_where_somebody_takes_part_in_any(mixed: Plant) -> None:
    assert mixed.ok("/apps/lidar")["x-medkit"]["functions"] == ["see"]
    assert mixed.ok("/apps/lidar/x-medkit-beacon")["functions"] == ["see"]
    assert mixed.ok("/components/ecu")["x-medkit"]["functions"] == ["drive"]
    assert "functions" not in mixed.ok("/components/power")["x-medkit"]
    assert ids(mixed.ok("/functions/see/hosts")) == ["camera", "lidar"]


def test_the_document_of_health_tells_how_the_tree_came_about(mixed: Plant, heard: Plant) -> None:
    discovery = mixed.ok("/health")["discovery"]
    assert (discovery["mode"], discovery["strategy"]) == ("hybrid", "hybrid")
    pipeline = discovery["pipeline"]
    assert pipeline["layers"][0] == "manifest"
    assert pipeline["total_entities"] > 10
    assert pipeline["conflicts"] == []
    assert heard.ok("/health")["discovery"]["mode"] == "runtime_only"


def test_the_overview_says_who_serves_and_what(make_plant: PlantMaker) -> None:
    plant = make_plant(server_name="Line 4", server_version="2.1.0", vendor_name="Acme")
    for path in ("", "/"):
        body = plant.ok(path)
        assert (body["name"], body["version"], body["api_base"]) == ("Line 4", "2.1.0", "/api/v1")
    assert len(body["capabilities"]) == 17
    assert {name for name, there in body["capabilities"].items() if there} == {
        *("discovery", "data_access", "cyclic_subscriptions", "vendor_extensions"),
    }
    assert body["endpoints"][-2:] == ["GET /api/v1/docs", "GET /api/v1/{entity-path}/docs"]
    assert "GET /api/v1/health" in body["endpoints"]
    assert plant.ok("/version-info")["items"][0]["vendor_info"] == {
        "version": "2.1.0",
        "name": "Acme",
    }
    assert plant.ok("/docs")["info"]["title"] == "Line 4"


def test_a_line_that_was_written_before_follows_whatever_it_says(make_plant: PlantMaker) -> None:
    plant = make_plant(
        entities={"apps": [{"id": "silent"}], "functions": [{"id": "see"}]},
        sources={"robots": {"ttl_s": 10.0}, "others": {"ttl_s": 10.0}},
    )

    def told(app_id: str) -> Any:
        return item(plant.ok("/apps"), app_id)["x-medkit"]

    plant.announce("camera", display_name="Camera")
    needing = plant.announce("lidar", depends_on=("camera",), function_ids=("see",))
    first = told("lidar")
    assert (first["depends_on_active"], first["functions"]) == (True, ["see"])
    assert told("silent")["never_heard"] is True
    plant.wait(1)
    assert told("camera")["beacon"]["age_sec"] == pytest.approx(1.0, abs=0.01)
    # Another source is fresher; a goodbye; an end of what it needs; and a first word.
    plant.announce("camera", source="others", display_name="Camera")
    assert told("camera")["beacon"]["source"] == "others"
    needing.announce(BeaconHint("lidar", depends_on=("camera", "nobody"), display_name="Lidar"))
    plant.settle()
    assert told("lidar")["depends_on_reason"] == "nobody is unknown"
    plant.announce("silent")
    assert (told("silent")["beacon"]["status"], "never_heard" in told("silent")) == (
        "active",
        False,
    )
    plant.wait(11)
    assert told("lidar")["depends_on_reason"] == "camera is stale: it is silent"
    assert told("camera")["beacon"]["status"] == "stale"
