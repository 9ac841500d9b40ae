"""The tree's relations."""

from __future__ import annotations

import pytest

from beacon_gateway.tree.entities import App, Area, Component, Function, Kind, Tree

TREE = Tree(
    areas={
        "plant": Area("plant"),
        "hall": Area("hall", parent_area_id="plant"),
        "cell": Area("cell", parent_area_id="hall"),
        "lost": Area("lost", parent_area_id="nowhere"),
    },
    components={
        "robot": Component("robot", area="hall"),
        "arm": Component("arm", area="cell", parent_component_id="robot"),
        "twice": Component("twice"),
    },
    apps={
        "driver": App("driver", component_id="arm"),
        "planner": App("planner", component_id="gone"),
        "twice": App("twice"),
    },
    functions={"pick": Function("pick"), "hall": Function("hall")},
)


@pytest.mark.parametrize(
    ("entity_id", "kind"),
    [
        ("robot", Kind.COMPONENT),
        ("driver", Kind.APP),
        ("plant", Kind.AREA),
        ("pick", Kind.FUNCTION),
        ("twice", Kind.COMPONENT),
        ("hall", Kind.AREA),
        ("nobody", None),
    ],
)
def test_an_id_is_looked_up_as_component_app_area_and_function(
    entity_id: str, kind: Kind | None
) -> None:
    assert TREE.kind(entity_id) is kind


def test_areas_are_in_areas_and_components_in_both() -> None:
    assert [one.id for one in TREE.top_areas()] == ["plant"]
    assert [one.id for one in TREE.subareas("plant")] == ["hall"]
    assert [one.id for one in TREE.components_in("hall")] == ["robot"]
    assert [one.id for one in TREE.contained_in("plant")] == ["robot", "arm"]
    assert [one.id for one in TREE.contained_in("cell")] == ["arm"]
    assert list(TREE.contained_in("nowhere_else")) == []


def test_components_are_in_components_and_apps_on_them_whether_or_not_they_exist() -> None:
    assert [one.id for one in TREE.top_components()] == ["robot", "twice"]
    assert [one.id for one in TREE.subcomponents("robot")] == ["arm"]
    assert [one.id for one in TREE.apps_on("arm")] == ["driver"]
    assert [one.id for one in TREE.apps_on("gone")] == ["planner"]
    assert list(TREE.apps_on("nobody")) == []


def test_areas_in_a_circle_are_walked_once() -> None:
    tree = Tree(
        areas={"a": Area("a", parent_area_id="b"), "b": Area("b", parent_area_id="a")},
        components={"c": Component("c", area="b")},
    )
    assert [one.id for one in tree.contained_in("a")] == ["c"]


def test_an_empty_tree_has_nothing_on_top() -> None:
    assert (list(Tree().top_areas()), list(Tree().top_components())) == ([], [])
