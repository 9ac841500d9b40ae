"""Endpoints that adapters bring: what one carrier heard, as ros2_medkit's plugins serve it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from beacon_core.errors import ConfigError

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

TOPIC, PARAM = "x-medkit-topic-beacon", "x-medkit-param-beacon"

KNOWN: dict[str, Any] = {
    "areas": [{"id": "hall"}],
    "components": [{"id": "ecu"}],
    "apps": [{"id": "planner"}],
    "functions": [{"id": "drive"}],
}

NOT_HEARD = (
    404,
    {
        "error_code": "vendor-error",
        "vendor_code": "x-medkit-beacon-not-found",
        "message": "No beacon data for entity",
    },
)

UNKNOWN_PATH = (
    404,
    {
        "error_code": "resource-not-found",
        "message": "Resource not found",
        "parameters": {"status": 404},
    },
)


@pytest.fixture
def plant(make_plant: PlantMaker) -> Plant:
    """Two carriers with an endpoint each, one of them with two sources; and one without."""
    return make_plant(
        sources={
            "near": {"adapter": "topic"},
            "far": {"adapter": "topic"},
            "polled": {"adapter": "param"},
            "other": {},
        },
        endpoints={"topic": TOPIC, "param": PARAM},
        entities=KNOWN,
    )


def vendors(plant: Plant) -> list[str]:
    """The capabilities of the planner that are a vendor's."""
    names = [one["name"] for one in plant.ok("/apps/planner")["capabilities"]]
    return [name for name in names if name.startswith("x-")]


@pytest.mark.parametrize("path", ["/apps/planner", "/components/ecu", "/apps/new"])
def test_exactly_the_14_keys_are_answered(plant: Plant, path: str) -> None:
    entity_id = path.rpartition("/")[2]
    said: dict[str, Any] = {
        "stable_id": "s",
        "display_name": "D",
        "transport_type": "t",
        "negotiated_format": "n",
        "process_id": 5,
        "process_name": "p",
        "hostname": "h",
        "component_id": "c",
        "function_ids": ("f",),
        "depends_on": ("d",),
        "metadata": {"k": "v"},
    }
    plant.announce(entity_id, source="near", **said)
    plant.wait(2)
    body = plant.ok(f"{path}/{TOPIC}")
    assert body == {
        "entity_id": entity_id,
        "status": "active",
        "age_sec": pytest.approx(2, abs=0.1),
        **said,
        "function_ids": ["f"],
        "depends_on": ["d"],
    }
    assert plant.ok(f"{path}/{TOPIC}/").keys() == body.keys()


def test_each_carrier_has_its_own_view(plant: Plant) -> None:
    plant.announce("planner", source="near", display_name="by topic")
    plant.announce("planner", source="polled", display_name="by parameter")
    plant.announce("planner", source="other", display_name="by another")
    assert plant.ok(f"/apps/planner/{TOPIC}")["display_name"] == "by topic"
    assert plant.ok(f"/apps/planner/{PARAM}")["display_name"] == "by parameter"


def test_of_several_sources_of_one_carrier_the_freshest_is_heard(plant: Plant) -> None:
    plant.announce("planner", source="far", display_name="far")
    plant.wait(1)
    plant.announce("planner", source="near", display_name="near")
    assert plant.ok(f"/apps/planner/{TOPIC}")["display_name"] == "near"
    plant.wait(1)
    plant.announce("planner", source="far", display_name="far")
    assert plant.ok(f"/apps/planner/{TOPIC}")["display_name"] == "far"


def test_a_silent_entity_is_stale(plant: Plant) -> None:
    plant.announce("planner", source="near")
    plant.wait(11)
    assert plant.ok(f"/apps/planner/{TOPIC}")["status"] == "stale"


def test_what_only_another_carrier_heard_is_not_heard(plant: Plant) -> None:
    plant.announce("planner", source="polled")
    plant.announce("ecu", source="other")
    assert plant.refused(f"/apps/planner/{TOPIC}") == NOT_HEARD
    assert plant.refused(f"/components/ecu/{TOPIC}") == NOT_HEARD


def test_an_entity_without_a_hint_or_with_an_expired_one_is_not_heard(plant: Plant) -> None:
    assert plant.refused(f"/apps/planner/{TOPIC}") == NOT_HEARD
    plant.announce("planner", source="near")
    plant.wait(301)
    assert plant.refused(f"/apps/planner/{TOPIC}") == NOT_HEARD


def test_one_that_said_goodbye_is_not_heard(plant: Plant) -> None:
    plant.announce("planner", source="near").close()
    plant.settle()
    assert plant.refused(f"/apps/planner/{TOPIC}") == NOT_HEARD


@pytest.mark.parametrize(("kind", "collection"), [("App", "apps"), ("Component", "components")])
def test_an_unknown_entity_is_not_found_even_if_a_hint_is_stored(
    make_plant: PlantMaker, kind: str, collection: str
) -> None:
    plant = make_plant(
        sources={"near": {"adapter": "topic"}},
        endpoints={"topic": TOPIC},
        allow_new_entities=False,
    )
    plant.announce("heard", source="near")
    assert plant.gateway.listeners[0].store.get("heard") is not None
    assert plant.refused(f"/{collection}/heard/{TOPIC}") == (
        404,
        {"error_code": "entity-not-found", "message": f"{kind} not found: heard"},
    )


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("/apps/ecu", "Entity 'ecu' is a Component, not a App"),
        ("/apps/hall", "Entity 'hall' is a Area, not a App"),
        ("/apps/drive", "Entity 'drive' is a Function, not a App"),
        ("/components/planner", "Entity 'planner' is a App, not a Component"),
    ],
)
def test_an_entity_of_another_kind(plant: Plant, path: str, message: str) -> None:
    plant.announce("ecu", source="near")
    plant.announce("planner", source="near")
    assert plant.refused(f"{path}/{TOPIC}") == (
        400,
        {"error_code": "invalid-parameter", "message": message},
    )


ALLOWED = "Only alphanumeric, underscore and hyphen are allowed"


@pytest.mark.parametrize(
    ("entity_id", "message"),
    [
        ("a" * 257, "Entity ID too long (max 256 characters)"),
        ("a%20b", f"Entity ID contains invalid character: ' '. {ALLOWED}"),
    ],
)
@pytest.mark.parametrize("collection", ["apps", "components"])
def test_what_can_be_no_id(plant: Plant, collection: str, entity_id: str, message: str) -> None:
    assert plant.refused(f"/{collection}/{entity_id}/{TOPIC}") == (
        400,
        {"error_code": "invalid-parameter", "message": message},
    )


def test_every_app_and_component_lists_the_endpoints_there_are(plant: Plant) -> None:
    plant.announce("new", source="other")
    for path in ("/apps/planner", "/apps/new", "/components/ecu"):
        assert plant.ok(path)["capabilities"][-3:] == [
            {"name": name, "href": f"/api/v1{path}/{name}"}
            for name in ("x-medkit-beacon", TOPIC, PARAM)
        ]
    body = plant.ok("/components/ecu")
    assert body["x-medkit"]["capabilities"] == body["capabilities"]


def test_without_a_source_of_that_adapter_there_is_no_such_path(make_plant: PlantMaker) -> None:
    plant = make_plant(endpoints={"topic": TOPIC}, entities=KNOWN)
    plant.announce("planner")
    assert plant.refused(f"/apps/planner/{TOPIC}") == UNKNOWN_PATH
    assert vendors(plant) == ["x-medkit-beacon"]


def test_areas_have_no_such_endpoint(plant: Plant) -> None:
    assert plant.refused(f"/areas/hall/{TOPIC}") == UNKNOWN_PATH


# What is refused at the start


@pytest.mark.parametrize(
    "endpoint", ["data", "x-", "x-Medkit", "x-a/b", "x-a--b", "x-a-", "x-{id}", "x-ä", " x-a"]
)
def test_an_endpoint_that_is_no_vendors_name_is_refused(
    make_plant: PlantMaker, endpoint: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        make_plant(sources={"near": {"adapter": "topic"}}, endpoints={"topic": endpoint})
    assert str(caught.value) == (
        f"$.sources.near: the adapter 'topic' wants to be served at {endpoint!r}, "
        "which must be x- and words of a-z and 0-9 with - between them"
    )


def test_the_gateways_own_endpoint_is_refused(make_plant: PlantMaker) -> None:
    with pytest.raises(ConfigError, match=r"at 'x-medkit-beacon', which is the gateway's own"):
        make_plant(sources={"near": {"adapter": "topic"}}, endpoints={"topic": "x-medkit-beacon"})


def test_two_adapters_that_share_an_endpoint_are_served_there_the_freshest_first(
    make_plant: PlantMaker,
) -> None:
    plant = make_plant(
        sources={"near": {"adapter": "topic"}, "far": {"adapter": "same"}},
        endpoints={"topic": TOPIC, "same": TOPIC},
        entities=KNOWN,
    )
    plant.announce("planner", source="near", display_name="near")
    assert plant.ok(f"/apps/planner/{TOPIC}")["display_name"] == "near"
    plant.wait(1.0)
    plant.announce("planner", source="far", display_name="far")
    assert plant.ok(f"/apps/planner/{TOPIC}")["display_name"] == "far"
    assert vendors(plant) == ["x-medkit-beacon", TOPIC]
