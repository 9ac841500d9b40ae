from __future__ import annotations

import attrs
import pytest

from beacon_core import entities
from beacon_core.entities import App, Area, Component, Entities, Function


def test_an_empty_tree_is_made_of_nothing() -> None:
    tree = Entities()
    assert (dict(tree.areas), dict(tree.components)) == ({}, {})
    assert (dict(tree.apps), dict(tree.functions)) == ({}, {})


def test_each_kind_is_found_by_id_and_keeps_the_order_given() -> None:
    tree = Entities(
        areas=[Area("front", "Front")],
        components=(Component("z"), Component("a")),
        apps=(App(app_id) for app_id in ("z", "m", "a")),
        functions=[Function("stop", "Emergency stop", hosts=("m",))],
    )
    assert tree.areas["front"].name == "Front"
    assert list(tree.components) == ["z", "a"]
    assert list(tree.apps) == ["z", "m", "a"]
    assert tree.functions["stop"].hosts == ("m",)
    assert "nobody" not in tree.apps


def test_of_several_with_one_id_the_first_counts() -> None:
    tree = Entities(apps=[App("a", "first"), App("b"), App("a", "second")])
    assert list(tree.apps.values()) == [App("a", "first"), App("b")]


def test_kinds_do_not_share_ids() -> None:
    tree = Entities(apps=[App("x", "app")], components=[Component("x", "component")])
    assert (tree.apps["x"].name, tree.components["x"].name) == ("app", "component")


def test_sources_are_those_of_ros2_medkit_unless_given() -> None:
    assert (App("a").source, Component("c").source) == ("manifest", "node")
    assert Function("f").source == "manifest"
    assert App("a", source="beacon").source == "beacon"


def test_nothing_can_be_changed_afterwards() -> None:
    apps = [App("a")]
    tree = Entities(apps=apps)
    apps.append(App("b"))
    assert list(tree.apps) == ["a"]
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        tree.apps = {}  # type: ignore[misc]
    with pytest.raises(TypeError):
        tree.apps["b"] = App("b")  # type: ignore[index]


def test_a_changed_tree_can_be_made_from_another() -> None:
    tree = Entities(apps=[App("a")], functions=[Function("f")])
    grown = attrs.evolve(tree, apps=[*tree.apps.values(), App("b")])
    assert list(grown.apps) == ["a", "b"]
    assert grown.functions == tree.functions
    assert grown != tree
    assert attrs.evolve(grown, apps=[App("a")]) == tree


def test_all_that_is_public_is_exported() -> None:
    assert set(entities.__all__) == {"App", "Area", "Component", "Entities", "Function"}
