"""The HTTP interface: envelopes, the vendor endpoint, and every error body to the letter."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_gateway import __version__

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

KNOWN: dict[str, Any] = {
    "areas": [{"id": "hall"}],
    "components": [{"id": "ecu", "name": "ECU"}, {"id": "bare"}],
    "apps": [{"id": "planner", "name": "Planner", "component_id": "ecu"}, {"id": "quiet"}],
    "functions": [{"id": "drive"}],
}

NEVER_HEARD = {"expected": True, "never_heard": True}

THE_14 = [
    "entity_id",
    "status",
    "age_sec",
    "stable_id",
    "display_name",
    "transport_type",
    "negotiated_format",
    "process_id",
    "process_name",
    "hostname",
    "component_id",
    "function_ids",
    "depends_on",
    "metadata",
]


def item(plant: Plant, entity_id: str) -> dict[str, Any]:
    (found,) = [one for one in plant.ok("/apps")["items"] if one["id"] == entity_id]
    assert isinstance(found, dict)
    return found


# Server routes


def test_health_has_the_keys_clients_require_and_ours_apart(plant: Plant) -> None:
    plant.announce("a")
    body = plant.ok("/health")
    assert body["status"] == "healthy"
    assert body["timestamp"] == plant.clock.wall_ns()
    assert body["warning_schema_version"] == 2
    assert body["warnings"] == []
    ours = body["x-medkit-beacon"]
    assert ours["uptime_sec"] >= 0
    (source,) = ours["sources"]
    assert (source["name"], source["adapter"], source["condition"]) == ("robots", "fake", "up")
    assert source["messages"]["new"] == 1
    assert source["hints"]["active"] == 1
    assert "detail" not in source


def test_health_tells_in_words_what_ails_a_source(plant: Plant) -> None:
    plant.announcer().announce(BeaconHint("late"))
    plant.clock.advance(5 * 10**9)
    (source,) = plant.ok("/health")["x-medkit-beacon"]["sources"]
    assert source["condition"] == "degraded"
    assert "deliver_due" in source["detail"]


def test_version_info_names_the_interface_and_the_vendor(make_plant: PlantMaker) -> None:
    assert make_plant(vendor_name="Acme").ok("/version-info") == {
        "items": [
            {
                "version": "1.0.0",
                "base_uri": "/api/v1",
                "vendor_info": {"version": __version__, "name": "Acme"},
            }
        ]
    }


@pytest.mark.parametrize(
    "path",
    [
        "/health",
        "/version-info",
        "/apps",
        "/apps/planner",
        "/apps/planner/x-medkit-beacon",
        "/components",
        "/components/ecu",
        "/components/ecu/x-medkit-beacon",
    ],
)
def test_a_trailing_slash_is_accepted(make_plant: PlantMaker, path: str) -> None:
    plant = make_plant(entities=KNOWN)
    plant.announce("planner")
    plant.announce("ecu")
    assert plant.ok(path).keys() == plant.ok(f"{path}/").keys()


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/nope"),
        ("GET", "/api/v1/nope"),
        ("GET", "/api/v2/apps"),
        ("GET", "/api/v1/apps/a/b"),
        ("GET", "/api/v1/apps/a%2Fb"),
        ("POST", "/api/v1/apps"),
        ("DELETE", "/api/v1/apps/planner"),
    ],
)
def test_an_unknown_path_or_method_is_a_404_with_a_body(
    plant: Plant, method: str, path: str
) -> None:
    response = plant.get(path, method)
    assert response.status_code == 404
    assert response.json() == {
        "error_code": "resource-not-found",
        "message": "Resource not found",
        "parameters": {"status": 404},
    }


def test_a_defect_is_a_500_with_a_body(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise LookupError("what went wrong")

    monkeypatch.setattr(plant.gateway.directory, "tree", broken)
    assert plant.refused("/apps") == (
        500,
        {
            "error_code": "internal-error",
            "message": "Internal server error",
            "parameters": {"details": "LookupError: what went wrong"},
        },
    )


# Collections and details


def test_a_collection_counts_its_items_and_falls_back_to_the_id_for_a_name(
    make_plant: PlantMaker,
) -> None:
    plant = make_plant(entities=KNOWN, default_component={"id": "here", "name": "Here"})
    assert plant.ok("/components") == {
        "items": [
            {
                "id": "ecu",
                "name": "ECU",
                "href": "/api/v1/components/ecu",
                "type": "component",
                "x-medkit": {"source": "manifest", **NEVER_HEARD},
            },
            {
                "id": "bare",
                "name": "bare",
                "href": "/api/v1/components/bare",
                "type": "component",
                "x-medkit": {"source": "manifest", **NEVER_HEARD},
            },
            {
                "id": "here",
                "name": "Here",
                "href": "/api/v1/components/here",
                "type": "component",
                "x-medkit": {"source": "host"},
            },
        ],
        "x-medkit": {"total_count": 3},
    }
    apps = plant.ok("/apps")
    assert [app["x-medkit"] for app in apps["items"]] == [
        {"source": "manifest", "is_online": False, "component_id": "ecu", **NEVER_HEARD},
        {"source": "manifest", "is_online": False, "component_id": "here", **NEVER_HEARD},
    ]


def test_an_entity_known_only_by_its_beacon_is_an_app_of_source_beacon(plant: Plant) -> None:
    plant.announce("lidar", display_name="Lidar", component_id="ecu", process_id=7, hostname="h")
    plant.wait(2)
    assert plant.ok("/apps") == {
        "items": [
            {
                "id": "lidar",
                "name": "Lidar",
                "href": "/api/v1/apps/lidar",
                "type": "app",
                "x-medkit": {
                    "source": "beacon",
                    "is_online": True,
                    "component_id": "ecu",
                    "beacon": {
                        "source": "robots",
                        "status": "active",
                        "age_sec": pytest.approx(2, abs=0.1),
                        "cause": "heard",
                        "restarts": 0,
                        "process_id": 7,
                        "hostname": "h",
                        "conflict": False,
                    },
                },
            }
        ],
        "x-medkit": {"total_count": 1},
    }


def test_without_new_entities_only_the_known_ones_are_there(make_plant: PlantMaker) -> None:
    plant = make_plant(entities=KNOWN, allow_new_entities=False)
    plant.announce("stranger").close()
    plant.settle()
    assert [one["id"] for one in plant.ok("/apps")["items"]] == ["planner", "quiet"]
    assert plant.refused("/apps/stranger")[0] == 404


def test_what_the_tree_says_stands_and_the_beacon_fills_what_it_does_not_say(
    make_plant: PlantMaker,
) -> None:
    plant = make_plant(entities=KNOWN)
    plant.announce("planner", display_name="Other", component_id="other")
    plant.announce("quiet", display_name="Not so quiet", component_id="ecu")
    plant.announce("bare", display_name="Dressed", component_id="ignored")
    assert item(plant, "planner")["name"] == "Planner"
    assert item(plant, "planner")["x-medkit"]["component_id"] == "ecu"
    assert item(plant, "quiet")["name"] == "Not so quiet"
    assert item(plant, "quiet")["x-medkit"]["component_id"] == "ecu"
    assert plant.ok("/components/bare")["name"] == "Dressed"
    assert [one["id"] for one in plant.ok("/apps")["items"]] == ["planner", "quiet"]


def test_a_detail_has_every_address_clients_require(make_plant: PlantMaker) -> None:
    plant = make_plant(entities=KNOWN)
    for path, required in (
        ("/apps/planner", ()),
        ("/components/ecu", ("subcomponents", "hosts")),
    ):
        body = plant.ok(path)
        common = "status data operations configurations faults logs bulk-data triggers"
        for key in (*common.split(), "cyclic-subscriptions", *required):
            assert body[key] == f"/api/v1{path}/{key}"
        assert body["capabilities"][-1] == {
            "name": "x-medkit-beacon",
            "href": f"/api/v1{path}/x-medkit-beacon",
        }
        for capability in body["capabilities"]:
            assert capability["href"] == f"/api/v1{path}/{capability['name']}"
        assert body["_links"]["self"] == f"/api/v1{path}"
        assert body["_links"]["collection"] == f"/api/v1{path.rpartition('/')[0]}"


def test_an_app_on_a_component_links_to_it(make_plant: PlantMaker) -> None:
    plant = make_plant(entities=KNOWN, default_component={"id": "here"})
    planner, quiet = plant.ok("/apps/planner"), plant.ok("/apps/quiet")
    assert planner["is-located-on"] == "/api/v1/components/ecu"
    assert planner["_links"]["is-located-on"] == "/api/v1/components/ecu"
    assert planner["belongs-to"] == "/api/v1/apps/planner/belongs-to"
    # Nobody places it, so it is where all such are: an app without a component is invisible.
    assert quiet["is-located-on"] == "/api/v1/components/here"
    assert quiet["belongs-to"] == "/api/v1/apps/quiet/belongs-to"
    assert quiet["name"] == "quiet"


# Errors on the detail routes name the id in their parameters


def test_an_unknown_entity(plant: Plant) -> None:
    assert plant.refused("/apps/nobody") == (
        404,
        {
            "error_code": "entity-not-found",
            "message": "Entity not found",
            "parameters": {"entity_id": "nobody"},
        },
    )


@pytest.mark.parametrize(
    ("path", "expected", "actual"),
    [
        ("/components/planner", "Component", "App"),
        ("/components/heard", "Component", "App"),
        ("/components/hall", "Component", "Area"),
        ("/apps/ecu", "App", "Component"),
        ("/apps/hall", "App", "Area"),
        ("/apps/drive", "App", "Function"),
    ],
)
def test_an_entity_of_another_type(
    make_plant: PlantMaker, path: str, expected: str, actual: str
) -> None:
    plant = make_plant(entities=KNOWN)
    plant.announce("heard")
    plant.announce("ecu")
    entity_id = path.rpartition("/")[2]
    assert plant.refused(path) == (
        400,
        {
            "error_code": "invalid-parameter",
            "message": f"Invalid entity type for route: expected {expected}, got {actual}",
            "parameters": {
                "entity_id": entity_id,
                "expected_type": expected,
                "actual_type": actual,
            },
        },
    )
    assert plant.refused(f"{path}/x-medkit-beacon") == (
        400,
        {
            "error_code": "invalid-parameter",
            "message": f"Entity '{entity_id}' is a {actual}, not a {expected}",
        },
    )


ALLOWED = "Only alphanumeric, underscore and hyphen are allowed"


@pytest.mark.parametrize(
    ("path", "entity_id", "details"),
    [
        ("a%20b", "a b", f"Entity ID contains invalid character: ' '. {ALLOWED}"),
        ("a.b", "a.b", f"Entity ID contains invalid character: '.'. {ALLOWED}"),
        ("a%0Ab", "a\nb", f"Entity ID contains invalid character: '0x0a'. {ALLOWED}"),
        ("%C3%BC", "ü", f"Entity ID contains invalid character: '0xc3'. {ALLOWED}"),
        ("%D9%A3", "٣", f"Entity ID contains invalid character: '0xd9'. {ALLOWED}"),
        ("a" * 257, "a" * 257, "Entity ID too long (max 256 characters)"),
    ],
)
@pytest.mark.parametrize("collection", ["apps", "components"])
def test_what_can_be_no_id(
    plant: Plant, collection: str, path: str, entity_id: str, details: str
) -> None:
    assert plant.refused(f"/{collection}/{path}") == (
        400,
        {
            "error_code": "invalid-parameter",
            "message": "Invalid entity ID",
            "parameters": {"details": details, "entity_id": entity_id},
        },
    )
    assert plant.refused(f"/{collection}/{path}/x-medkit-beacon") == (
        400,
        {"error_code": "invalid-parameter", "message": details},
    )


# The vendor endpoint


def test_the_vendor_endpoint_always_has_the_14_keys_and_then_ours(plant: Plant) -> None:
    plant.announce("bare")
    body = plant.ok("/apps/bare/x-medkit-beacon")
    assert list(body)[:14] == THE_14
    assert list(body)[14:] == ["cause", "restarts", "conflict", "sources", "history"]
    assert body["process_id"] == 0
    assert body["function_ids"] == []
    assert body["metadata"] == {}
    assert isinstance(body["age_sec"], float)


def test_every_given_field_is_answered(plant: Plant) -> None:
    fields: dict[str, Any] = {
        "stable_id": "s",
        "display_name": "D",
        "function_ids": ("f",),
        "depends_on": ("d",),
        "component_id": "c",
        "transport_type": "t",
        "negotiated_format": "n",
        "process_id": 5,
        "process_name": "p",
        "hostname": "h",
        "metadata": {"k": "v"},
    }
    plant.announce("full", **fields)
    body = plant.ok("/apps/full/x-medkit-beacon")
    for key, value in fields.items():
        assert body[key] == (list(value) if isinstance(value, tuple) else value)


def test_a_component_has_the_endpoint_too(make_plant: PlantMaker) -> None:
    plant = make_plant(entities=KNOWN)
    plant.announce("ecu", hostname="h")
    assert plant.ok("/components/ecu/x-medkit-beacon")["hostname"] == "h"
    assert plant.ok("/components")["items"][0]["x-medkit"]["beacon"]["status"] == "active"


def test_a_silent_entity_is_stale_and_then_gone(plant: Plant) -> None:
    plant.announce("robot")
    plant.wait(11)
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert (body["status"], body["cause"]) == ("stale", "silent")
    assert item(plant, "robot")["x-medkit"]["is_online"] is False
    plant.wait(300)
    assert plant.refused("/apps/robot/x-medkit-beacon") == (
        404,
        {"error_code": "entity-not-found", "message": "App not found: robot"},
    )
    assert plant.ok("/apps")["items"] == []


def test_a_crashed_entity_is_stale_at_once_with_the_reason(plant: Plant) -> None:
    announcer = plant.announce("robot")
    plant.networks["robots"].crash(announcer.name)
    plant.wait(1)
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert (body["status"], body["cause"]) == ("stale", "lost")
    assert body["reason"] == "connection lost"
    assert [(step["status"], step["cause"]) for step in body["history"]] == [("stale", "lost")]
    assert body["history"][0]["reason"] == "connection lost"
    assert body["history"][0]["at"].startswith("2023-11-14T22:13:2")


def test_an_entity_that_said_goodbye_is_shown_as_left_while_its_tombstone_lasts(
    plant: Plant,
) -> None:
    plant.announce("robot", display_name="R2", hostname="h").close()
    plant.settle()
    plant.wait(2)
    status, body = plant.refused("/apps/robot/x-medkit-beacon")
    assert status == 404
    assert body == {
        "error_code": "vendor-error",
        "vendor_code": "x-medkit-beacon-not-found",
        "message": "No beacon data for entity",
        "parameters": {
            "entity_id": "robot",
            "status": "left",
            "left_at": "2023-11-14T22:13:20.000Z",
            "left_sec": pytest.approx(2, abs=0.1),
            "cause": "goodbye",
            "source": "robots",
            "display_name": "R2",
            "hostname": "h",
        },
    }
    listed = item(plant, "robot")["x-medkit"]
    assert listed["is_online"] is False
    assert listed["beacon"]["status"] == "left"
    assert plant.ok("/apps/robot")["x-medkit"]["is_online"] is False


def test_once_the_tombstone_has_lapsed_the_entity_is_gone(plant: Plant) -> None:
    plant.announce("robot").close()
    plant.settle()
    plant.wait(11)
    assert plant.ok("/apps") == {"items": [], "x-medkit": {"total_count": 0}}
    assert plant.refused("/apps/robot/x-medkit-beacon")[1]["error_code"] == "entity-not-found"


def test_one_that_left_and_came_back_is_active_again(plant: Plant) -> None:
    plant.announce("robot").close()
    plant.settle()
    assert item(plant, "robot")["x-medkit"]["beacon"]["status"] == "left"
    plant.announce("robot", process_id=2)
    assert item(plant, "robot")["x-medkit"]["beacon"]["status"] == "active"
    assert plant.ok("/apps/robot/x-medkit-beacon")["status"] == "active"


def test_a_known_entity_nothing_was_heard_of_has_no_beacon(make_plant: PlantMaker) -> None:
    plant = make_plant(entities=KNOWN)
    for path in ("/apps/quiet", "/components/bare"):
        assert plant.refused(f"{path}/x-medkit-beacon") == (
            404,
            {
                "error_code": "vendor-error",
                "vendor_code": "x-medkit-beacon-not-found",
                "message": "No beacon data for entity",
                "parameters": {"entity_id": path.rpartition("/")[2]},
            },
        )


@pytest.mark.parametrize(("kind", "collection"), [("App", "apps"), ("Component", "components")])
def test_an_unknown_entity_at_the_vendor_endpoint(plant: Plant, kind: str, collection: str) -> None:
    assert plant.refused(f"/{collection}/nobody/x-medkit-beacon") == (
        404,
        {"error_code": "entity-not-found", "message": f"{kind} not found: nobody"},
    )


def test_an_unknown_entity_is_not_found_even_if_a_hint_is_stored(make_plant: PlantMaker) -> None:
    plant = make_plant(allow_new_entities=False)
    plant.announce("heard")
    assert plant.gateway.listeners[0].store.get("heard") is not None
    assert plant.refused("/apps/heard/x-medkit-beacon")[1]["message"] == "App not found: heard"


def test_restarts_are_counted(plant: Plant) -> None:
    for process_id in (1, 2, 3):
        announcer = plant.announce("robot", process_id=process_id, hostname="h")
        plant.networks["robots"].crash(announcer.name)
        plant.wait(1)
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert body["restarts"] == 2
    assert item(plant, "robot")["x-medkit"]["beacon"]["restarts"] == 2


def test_a_conflict_shows_both_claims(plant: Plant) -> None:
    plant.announce("robot", hostname="one", process_id=1)
    plant.announce("robot", hostname="two", process_id=2, display_name="Impostor")
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert body["conflict"] is True
    assert [(claim["hostname"], claim["process_id"]) for claim in body["claims"]] == [
        ("one", 1),
        ("two", 2),
    ]
    assert body["claims"][1]["display_name"] == "Impostor"
    assert item(plant, "robot")["x-medkit"]["beacon"]["conflict"] is True


def test_several_sources_are_merged_and_all_their_views_are_listed(
    make_plant: PlantMaker,
) -> None:
    plant = make_plant(sources={"radio": {"ttl_s": 5}, "wire": {"ttl_s": 60}})
    plant.announce("robot", source="wire", display_name="Wired", process_id=1)
    plant.wait(2)
    plant.announce("robot", source="radio", display_name="Wireless", process_id=1)
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert body["display_name"] == "Wireless"
    assert [(view["source"], view["status"]) for view in body["sources"]] == [
        ("radio", "active"),
        ("wire", "active"),
    ]
    assert body["sources"][0]["sender"].startswith("robot@radio")
    # Silence on the one is no news while the other still counts as heard.
    plant.wait(6)
    body = plant.ok("/apps/robot/x-medkit-beacon")
    assert (body["status"], body["display_name"]) == (Status.ACTIVE, "Wired")
    assert body["sources"][1]["status"] == "stale"
    assert len(plant.ok("/apps")["items"]) == 1


# Whatever was stored


@pytest.mark.parametrize(
    "text",
    ["\x00\x1b[31m", "\ud800", "\u2028", "𐍈" * 100, '"\\', "é" * 600, "<script>", "\x7f\x9b"],
)
def test_no_stored_text_makes_an_answer_fail(plant: Plant, text: str) -> None:
    payload = json.dumps({"entity_id": "odd", "display_name": text, "metadata": {"k": text}})
    plant.gateway.listeners[0].intake.offer(payload.encode(), "somebody")
    for path in ("/apps", "/apps/odd", "/apps/odd/x-medkit-beacon", "/health"):
        plant.ok(path)


def test_half_a_surrogate_pair_in_the_configuration_does_not_fail(make_plant: PlantMaker) -> None:
    plant = make_plant(vendor_name="a\ud800b")
    assert plant.ok("/version-info")["items"][0]["vendor_info"]["name"] == "a?b"


def test_ids_as_long_as_allowed_work(plant: Plant) -> None:
    entity_id = "a" * 256
    plant.announce(entity_id)
    assert plant.ok(f"/apps/{entity_id}/x-medkit-beacon")["entity_id"] == entity_id
