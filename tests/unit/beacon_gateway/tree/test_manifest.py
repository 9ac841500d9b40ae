"""The manifest: every key, every mistake with its place, whatever the document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.errors import ConfigError
from beacon_gateway.tree.entities import App, Area, Component, Function, RosBinding, Tree
from beacon_gateway.tree.linker import Unmanifested
from beacon_gateway.tree.manifest import Manifest, load_manifest, parse_manifest

ROOT = Path(__file__).parents[4]
MANIFESTS = ROOT / "tests" / "data" / "manifests"


def parsed(**sections: Any) -> Manifest:
    return parse_manifest({"manifest_version": "1.0", **sections})


def problems(**sections: Any) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        parsed(**sections)
    return str(caught.value).splitlines()


def doubts(**sections: Any) -> list[str]:
    return [str(doubt) for doubt in parsed(**sections).warnings]


def test_areas_within_areas_and_the_rest_of_a_vehicle_are_read() -> None:
    manifest = load_manifest(MANIFESTS / "vehicle.yaml")
    tree = manifest.tree
    assert manifest.warnings == ()
    assert manifest.unmanifested_nodes is Unmanifested.WARN
    assert [area.id for area in tree.top_areas()] == ["powertrain", "body", "brakes"]
    assert tree.areas["front-left-door"].parent_area_id == "door"
    assert {one.id for one in tree.contained_in("body")} == {"door-sensor-hw"}
    assert tree.apps["engine-calibration"] == App(
        id="engine-calibration",
        name="Engine Calibration",
        component_id="engine-ecu",
        depends_on=("engine-temp-sensor",),
        tags=("maintenance", "safety-critical"),
        ros_binding=RosBinding("calibration", "/powertrain/engine"),
    )
    assert tree.functions["engine-monitoring"].hosts == ("engine-temp-sensor", "engine-calibration")


def test_a_key_that_nobody_reads_is_warned_of_and_the_rest_is_read() -> None:
    manifest = load_manifest(MANIFESTS / "sensors.yaml")
    assert [str(doubt) for doubt in manifest.warnings] == [
        f"$.components[{index}].apps: unknown key; left out" for index in (0, 1)
    ]
    assert set(manifest.tree.components) == {"lidar-unit", "compute-unit"}


def test_the_example_is_a_manifest_without_fault() -> None:
    manifest = load_manifest(ROOT / "examples" / "manifest.yaml", strict=True)
    assert manifest.tree.components["picker_1"].identity["serial_number"] == "0042"


def test_every_key_of_every_kind_is_taken() -> None:
    manifest = parsed(
        config={
            "unmanifested_nodes": "include_as_orphan",
            "inherit_runtime_resources": False,
            "allow_manifest_override": False,
        },
        areas=[
            {"id": "a", "description": "D", "tags": ["t"], "translation_id": "tr"},
            {"id": "b", "namespace": "/n", "parent_area": "a"},
            {"id": "c", "parent_area_id": "b"},
        ],
        components=[
            {
                "id": "ecu",
                "name": "ECU",
                "type": "controller",
                "area": "a",
                "namespace": "/n",
                "variant": "v",
                "description": "D",
                "tags": ["t"],
                "translation_id": "tr",
                "depends_on": ["sub"],
                "external": False,
                "identity": {"serial": "1"},
                "lock": {"a": "part of the format that this gateway has no use for"},
            },
            {"id": "sub", "parent_component_id": "ecu"},
        ],
        apps=[
            {
                "id": "app",
                "is_located_on": "ecu",
                "depends_on": ["ecu"],
                "description": "D",
                "tags": ["t"],
                "translation_id": "tr",
                "external": True,
            }
        ],
        functions=[{"id": "f", "hosted_by": ["app"], "depends_on": [], "translation_id": "tr"}],
    )
    assert manifest == Manifest(
        Tree(
            areas={
                "a": Area("a", "a", "/a", "", "D", ("t",), "tr"),
                "b": Area("b", "b", "/n", "a"),
                "c": Area("c", "c", "/c", "b"),
            },
            components={
                "ecu": Component(
                    id="ecu",
                    name="ECU",
                    type="controller",
                    area="a",
                    namespace="/n",
                    fqn="/n/ecu",
                    depends_on=("sub",),
                    variant="v",
                    identity={"serial": "1"},
                    external=False,
                    description="D",
                    tags=("t",),
                    translation_id="tr",
                ),
                "sub": Component("sub", "sub", parent_component_id="ecu", fqn="/sub"),
            },
            apps={
                "app": App(
                    "app",
                    "app",
                    "ecu",
                    ("ecu",),
                    external=True,
                    description="D",
                    tags=("t",),
                    translation_id="tr",
                )
            },
            functions={"f": Function("f", "f", ("app",), translation_id="tr")},
        ),
        Unmanifested.INCLUDE_AS_ORPHAN,
        inherit_runtime_resources=False,
        allow_manifest_override=False,
    )


def test_discovery_is_another_name_of_config() -> None:
    assert parsed(discovery={"unmanifested_nodes": "error"}).unmanifested_nodes is (
        Unmanifested.ERROR
    )


def test_without_sections_the_defaults_hold_and_a_key_without_a_value_is_not_given() -> None:
    manifest = parsed(areas=None, config=None, apps=[{"id": "a", "description": None}])
    assert manifest.tree == Tree(apps={"a": App("a", "a")})
    assert manifest.unmanifested_nodes is Unmanifested.WARN
    assert manifest.inherit_runtime_resources
    assert manifest.allow_manifest_override


@pytest.mark.parametrize("version", ["1.0", 1.0])
def test_the_version_may_lack_its_quotes(version: object) -> None:
    assert parse_manifest({"manifest_version": version}).tree == Tree()


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({}, '$.manifest_version: R001: found nothing; give "1.0"'),
        ({"manifest_version": 2}, '$.manifest_version: R001: found the number 2; give "1.0"'),
        (
            [],
            "$: found a list of 0; give keys with values, such as manifest_version",
        ),
    ],
)
def test_r001_another_version(document: object, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_manifest(document)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("section", "code"),
    [("areas", "R002"), ("components", "R003"), ("apps", "R004"), ("functions", "R005")],
)
def test_r002_to_r005_an_id_is_given_once(section: str, code: str) -> None:
    assert problems(**{section: [{"id": "x"}, {"id": "y"}, {"id": "x"}]}) == [
        f"$.{section}[2].id: {code}: x is already the id of $.{section}[0]"
    ]


def test_an_id_stands_for_one_thing_whatever_its_kind() -> None:
    assert problems(areas=[{"id": "x", "subareas": [{"id": "y"}]}], apps=[{"id": "y"}]) == [
        "$.apps[0].id: R004: y is already the id of $.areas[0].subareas[0]"
    ]


def test_r006_areas_and_parents_must_be_there() -> None:
    assert problems(
        areas=[{"id": "a", "parent_area": "nowhere"}],
        components=[{"id": "c", "area": "a_", "parent_component_id": "d"}],
    ) == [
        "$.areas[0].parent_area: R006: area nowhere is not in this manifest",
        "$.components[0].area: R006: area a_ is not in this manifest",
        "$.components[0].parent_component_id: R006: component d is not in this manifest",
    ]


def test_r007_the_component_of_an_app_must_be_there() -> None:
    assert problems(apps=[{"id": "a", "is_located_on": "ecu"}]) == [
        "$.apps[0].is_located_on: R007: component ecu is not in this manifest"
    ]


def test_r008_and_r009_who_is_needed_or_takes_part_may_come_later() -> None:
    assert doubts(
        components=[{"id": "c", "depends_on": ["c2"]}],
        apps=[{"id": "a", "depends_on": ["c", "b"]}],
        functions=[{"id": "f", "hosted_by": ["a", "z"], "depends_on": ["g"]}],
    ) == [
        "$.components[0].depends_on[0]: R008: c2 is not in this manifest",
        "$.apps[0].depends_on[1]: R008: b is not in this manifest",
        "$.functions[0].depends_on[0]: R008: g is not in this manifest",
        "$.functions[0].hosted_by[1]: R009: z is not in this manifest",
    ]


def test_r010_two_apps_cannot_be_the_same_node() -> None:
    node = {"node_name": "n", "namespace": "/a"}
    assert problems(
        apps=[
            {"id": "a", "ros_binding": node},
            {"id": "b", "ros_binding": {**node, "namespace": "/a/"}},
            {"id": "c", "ros_binding": {"topic_namespace": "/t"}},
            {"id": "d", "ros_binding": {"topic_namespace": "/t"}},
        ]
    ) == [
        "$.apps[1].ros_binding: R010: the same as that of a",
        "$.apps[3].ros_binding: R010: the same as that of c",
    ]


def test_several_apps_may_be_nodes_of_one_name_in_any_namespace() -> None:
    anywhere = {"node_name": "n", "namespace": "*"}
    assert (
        doubts(apps=[{"id": "a", "ros_binding": anywhere}, {"id": "b", "ros_binding": anywhere}])
        == []
    )


def test_r011_apps_functions_and_parents_go_in_no_circle() -> None:
    assert problems(
        areas=[{"id": "x", "parent_area": "y"}, {"id": "y", "parent_area": "x"}],
        components=[{"id": "c", "parent_component_id": "c"}],
        apps=[
            {"id": "before", "depends_on": ["a"]},
            {"id": "a", "depends_on": ["b"]},
            {"id": "b", "depends_on": ["a", "before"]},
        ],
        functions=[{"id": "f", "depends_on": ["g"]}, {"id": "g", "depends_on": ["f"]}],
    ) == [
        "$.areas[0].parent_area: R011: a cycle: x -> y -> x",
        "$.components[0].parent_component_id: R011: a cycle: c -> c",
        "$.apps[1].depends_on: R011: a cycle: a -> b -> a",
        "$.functions[0].depends_on: R011: a cycle: f -> g -> f",
    ]


def test_two_ways_to_one_place_are_no_circle() -> None:
    apps = [{"id": "a", "depends_on": ["b", "c"]}, {"id": "b", "depends_on": ["c"]}, {"id": "c"}]
    assert doubts(apps=apps) == []


def test_however_many_ways_there_are_each_app_is_looked_at_once() -> None:
    apps = [
        {"id": f"{side}{n}", "depends_on": [f"a{n + 1}", f"b{n + 1}"]}
        for n in range(50)
        for side in "ab"
    ]
    assert doubts(apps=[*apps, {"id": "a50"}, {"id": "b50"}]) == []


def test_a_chain_of_ten_thousand_is_no_circle_and_no_problem() -> None:
    apps = [{"id": f"a{n}", "depends_on": [f"a{n + 1}"]} for n in range(10_000)]
    assert doubts(apps=[*apps, {"id": "a10000"}]) == []


def test_r013_an_external_app_is_no_node() -> None:
    assert doubts(apps=[{"id": "a", "external": True, "ros_binding": {"node_name": "n"}}]) == [
        "$.apps[0].ros_binding: R013: an external app is no node; it is not bound"
    ]


def test_a_binding_without_a_node_name_binds_nothing_and_says_so() -> None:
    assert doubts(apps=[{"id": "a", "ros_binding": {"topic_namespace": "/t"}}]) == [
        "$.apps[0].ros_binding: only node_name binds; without it, the app has no node"
    ]


def test_what_is_not_served_is_warned_of() -> None:
    assert doubts(assets=[], scripts=[], capabilities={}, metadata={}, aps=[]) == [
        "$.assets: not served by this gateway; left out",
        "$.scripts: not served by this gateway; left out",
        "$.aps: unknown key; left out; did you mean 'apps'?",
    ]


def test_every_problem_is_told_at_once_and_a_bad_entry_is_blamed_only_once() -> None:
    policies = "ignore, warn, error, include_as_orphan"
    assert problems(
        config={"unmanifested_nodes": "perhaps"},
        areas=[{"id": "a b", "subareas": [{"id": 3}]}, "hall"],
        components=[{"id": "ecu", "name": 3}, {"name": "nameless"}],
        apps=[{"id": "a", "is_located_on": "ecu", "ros_binding": {"namespace": "arm"}}],
        functions={"id": "f"},
    ) == [
        f"$.config.unmanifested_nodes: found the text 'perhaps'; give one of {policies}",
        "$.areas[0].id: found 'a b'; give an id: 1 to 256 characters of A-Z a-z 0-9 _ -",
        "$.areas[0].subareas[0].id: found the number 3; give an id",
        "$.areas[1]: found the text 'hall'; give keys with values",
        "$.components[0].name: found the number 3; give a text, in quotes",
        "$.components[1].id: missing; give an id",
        "$.apps[0].ros_binding.namespace: found 'arm'; give a namespace that begins with /, or *",
        "$.functions: found keys ('id'); give a list",
    ]


def test_strict_makes_errors_of_warnings() -> None:
    document = {"manifest_version": "1.0", "apps": [{"id": "a", "depends_on": ["b"]}], "aps": []}
    assert len(parse_manifest(document).warnings) == 2
    with pytest.raises(ConfigError, match="R008"):
        parse_manifest(document, strict=True)


def test_a_file_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: No such file or directory$"):
        load_manifest(tmp_path / "none.yaml")


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["id", "areas", "subareas", "apps", "ros_binding", "depends_on"])
            | st.text(max_size=3)
            | st.integers(),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(deadline=None, max_examples=200)
@given(
    st.fixed_dictionaries(
        {"manifest_version": st.just("1.0")},
        optional=dict.fromkeys(("config", "areas", "components", "apps", "functions"), anything),
    )
    | anything
)
def test_any_document_gives_a_manifest_or_problems_with_places(document: object) -> None:
    try:
        lines = [str(doubt) for doubt in parse_manifest(document).warnings]
    except ConfigError as error:
        lines = str(error).split("\n")
    assert all(line.startswith("$") for line in lines)
