"""What beacons add to the tree of a gateway, over all its sources."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.store import HintStore
from beacon_gateway.tree.beacons import BeaconLayer
from beacon_gateway.tree.entities import App, Component, Function, Kind, Tree
from beacon_gateway.views import Beacon, View

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

TWO = {"fast": {"ttl_s": 10.0}, "slow": {"ttl_s": 60.0}}
HOST = {"id": "host", "name": "Host"}
VECTORS = Path(__file__).parents[3] / "data" / "vectors" / "mapper.jsonl"
CASES = [json.loads(line) for line in VECTORS.read_text(encoding="utf-8").splitlines()]


@pytest.fixture
def make(make_plant: PlantMaker) -> Any:
    """Makes a gateway whose own host is ``host``, from its ``entities`` and other keys."""

    def made(**config: Any) -> Plant:
        return make_plant(**{"default_component": HOST, **config})

    return made


def tree(plant: Plant) -> Tree:
    return plant.gateway.directory.tree()


def test_a_hint_fills_what_is_not_known_of_an_app_and_changes_nothing_else(make: Any) -> None:
    known = [{"id": "a", "name": "Known"}, {"id": "b"}]
    plant = make(entities={"apps": known, "components": [{"id": "ecu"}]})
    plant.announce("a", display_name="Told", component_id="ecu")
    plant.announce("b", display_name="Told")
    assert tree(plant).apps == {
        "a": App("a", "Known", "ecu"),
        "b": App("b", "Told", "host"),
    }


def test_a_hint_names_a_component_and_cannot_place_it(make: Any) -> None:
    plant = make(entities={"components": [{"id": "ecu"}]})
    plant.announce("ecu", display_name="ECU", component_id="elsewhere")
    (component,) = tree(plant).components.values()
    assert (component.name, component.parent_component_id, component.source) == (
        "ECU",
        "",
        "manifest",
    )


def test_a_hint_about_nobody_makes_an_app_that_says_what_it_needs(make: Any) -> None:
    plant = make()
    plant.announce("new", display_name="New", component_id="gone", depends_on=("a",))
    assert tree(plant).apps == {"new": App("new", "New", "gone", ("a",), source="beacon")}
    assert tree(plant).components == {"gone": Component("gone", source="beacon")}
    assert [app.id for app in tree(plant).apps_on("gone")] == ["new"]


def test_a_component_that_only_hints_name_is_there_while_an_app_is_on_it(make: Any) -> None:
    plant = make()
    first = plant.announce("a", component_id="amr")
    plant.announce("b", component_id="amr", display_name="B")
    assert tree(plant).components == {"amr": Component("amr", source="beacon")}
    first.close()
    plant.settle()
    plant.announce("b", component_id="other", display_name="B")
    assert set(tree(plant).components) == {"amr", "other"}, "who said goodbye is listed for a while"
    plant.wait(11)
    assert set(tree(plant).components) == {"other"}
    plant.wait(400)
    assert tree(plant) == Tree()


@pytest.mark.parametrize("config", [{"strict_upstream_merge": True}, {"allow_new_entities": False}])
def test_hints_make_no_component_where_that_is_not_wanted(
    make: Any, config: dict[str, bool]
) -> None:
    plant = make(**config, entities={"apps": [{"id": "a"}]})
    plant.announce("a", component_id="amr")
    assert tree(plant).apps["a"].component_id == "amr"
    assert set(tree(plant).components) == set()


def test_the_id_of_anything_else_is_no_component(make: Any) -> None:
    known = {"areas": [{"id": "hall"}], "apps": [{"id": "app"}], "functions": [{"id": "f"}]}
    plant = make(entities=known)
    ids = ("hall", "unplaced", "app", "f", "host", "new")
    for number, component_id in enumerate(ids):
        plant.announce(f"a{number}", component_id=component_id)
    assert set(tree(plant).components) == {"host", "new"}
    new = plant.announce("new")
    assert set(tree(plant).components) == {"host"}
    assert tree(plant).kind("new") is Kind.APP
    new.close()
    plant.settle()
    plant.wait(11)
    assert tree(plant).kind("new") is Kind.COMPONENT


def test_what_is_placed_beforehand_stays_there_though_nobody_knows_the_place(make: Any) -> None:
    plant = make(entities={"apps": [{"id": "a", "component_id": "nowhere"}]})
    plant.announce("a", component_id="nowhere")
    assert tree(plant).components == {}
    plant.announce("a", component_id="elsewhere")
    assert tree(plant).components == {}
    assert tree(plant).apps["a"].component_id == "nowhere"


def test_in_strict_mode_what_a_hint_needs_does_not_reach_the_tree(make: Any) -> None:
    plant = make(strict_upstream_merge=True, entities={"functions": [{"id": "f", "hosts": ["a"]}]})
    plant.announce("new", depends_on=("a",), function_ids=("f",))
    assert tree(plant).apps["new"].depends_on == ()
    assert tree(plant).functions["f"].hosts == ("a",)
    assert plant.gateway.directory.roll_up("new").chain == ("new", "a")


def test_without_new_entities_a_hint_about_nobody_is_skipped_and_logged_once(
    make: Any, caplog: pytest.LogCaptureFixture
) -> None:
    plant = make(allow_new_entities=False, entities={"functions": [{"id": "f"}]})
    with caplog.at_level(logging.WARNING):
        plant.announce("new", function_ids=("f",))
        assert tree(plant).apps == {}
        plant.announce("new", display_name="changed")
        assert tree(plant).apps == {}
    assert tree(plant).functions["f"].hosts == ()
    logged = [one.message for one in caplog.records if "skipped" in one.message]
    assert logged == ["'new' is no known app or component: its hint is skipped"]


def test_function_ids_make_a_host_of_functions_that_exist(make: Any) -> None:
    plant = make(entities={"functions": [{"id": "f", "hosts": ["a"]}, {"id": "g"}]})
    said = plant.announce("b", function_ids=("f", "nowhere"))
    plant.announce("c", function_ids=("f", "g"))
    assert {f.id: f.hosts for f in tree(plant).functions.values()} == {
        "f": ("a", "b", "c"),
        "g": ("c",),
    }
    said.close()
    plant.settle()
    assert tree(plant).functions["f"].hosts == ("a", "c")


def test_who_changes_functions_leaves_the_old_ones(make: Any) -> None:
    plant = make(entities={"functions": [{"id": "f"}, {"id": "g"}]})
    plant.announce("a", function_ids=("f",))
    assert tree(plant).functions["f"].hosts == ("a",)
    plant.announce("a", function_ids=("g",))
    assert {f.id: f.hosts for f in tree(plant).functions.values()} == {"f": (), "g": ("a",)}


def test_an_app_that_said_goodbye_is_listed_until_its_tombstone_lapses(make: Any) -> None:
    plant = make()
    plant.announce("a", display_name="A").close()
    plant.settle()
    assert tree(plant).apps["a"].name == "A"
    plant.wait(11)
    assert tree(plant) == Tree()


def test_a_silent_app_is_listed_until_it_expires(make: Any) -> None:
    plant = make(sources={"robots": {"ttl_s": 10.0, "expiry_s": 100.0}})
    plant.announce("a")
    plant.wait(99)
    assert set(tree(plant).apps) == {"a"}
    plant.wait(1)
    assert tree(plant) == Tree()


def test_of_two_sources_the_freshest_is_believed_also_after_a_mere_refresh(make: Any) -> None:
    plant = make(sources=TWO)
    said = BeaconHint("a", display_name="Fast")
    fast = plant.announcer("fast one", "fast")
    fast.announce(said)
    plant.settle()
    plant.wait(1)
    plant.announce("a", source="slow", display_name="Slow")
    assert tree(plant).apps["a"].name == "Slow"
    plant.wait(1)
    fast.announce(said)
    plant.settle()
    assert tree(plant).apps["a"].name == "Fast"


def test_of_many_over_whom_two_sources_differ_some_are_looked_at_each_time_in_turn() -> None:
    clock, count, looked = ManualClock(), 250, list[str]()
    stores = [HintStore(clock), HintStore(clock)]
    layer = BeaconLayer(stores, _looking(stores, looked), allow_new_entities=True)
    for number in range(count):
        for store, name in zip(stores, ("One", "Other"), strict=True):
            store.update(BeaconHint(f"app_{number}", display_name=name), source="robot")
    layer.map(Tree())
    assert len(looked) == count
    rounds = []
    for _ in range(3):
        looked.clear()
        layer.map(Tree())
        rounds.append([*looked])
    assert [len(one) for one in rounds] == [100, 100, 100]
    assert len({one for asked in rounds for one in asked}) == count


def test_a_layer_says_of_whom_it_says_something_else() -> None:
    store = HintStore(ManualClock())
    layer = BeaconLayer([store], _looking([store], []), allow_new_entities=True)
    for name in ("a", "b"):
        store.update(BeaconHint(name, component_id="ecu"), source="robot")
    layer.map(Tree())
    assert {kind: {*ids} for kind, ids in layer.touched.items() if ids} == {
        "apps": {"a", "b"},
        "components": {"ecu"},
    }
    store.update(BeaconHint("a", display_name="A"), source="robot")
    layer.map(Tree())
    assert {kind: {*ids} for kind, ids in layer.touched.items() if ids} == {"apps": {"a"}}


def _looking(stores: list[HintStore], looked: list[str]) -> Callable[[str], Beacon | None]:
    """How all stores together have an entity; ``looked`` takes down who is asked for."""

    def beacon(entity_id: str) -> Beacon | None:
        looked.append(entity_id)
        return Beacon.of(
            View(str(number), "fake", stored)
            for number, store in enumerate(stores)
            if (stored := store.get(entity_id)) is not None
        )

    return beacon


def test_a_goodbye_on_one_source_outweighs_an_older_word_on_another(make: Any) -> None:
    plant = make(sources=TWO, entities={"functions": [{"id": "f"}]})
    plant.announce("a", source="slow", function_ids=("f",))
    plant.wait(1)
    leaving = plant.announce("a", source="fast", function_ids=("f",))
    assert tree(plant).functions["f"].hosts == ("a",)
    leaving.close()
    plant.settle()
    assert tree(plant).functions["f"].hosts == ()
    assert plant.gateway.directory.roll_up("a").reason == "a said goodbye"
    plant.wait(11)
    assert tree(plant).functions["f"].hosts == ()
    assert "a" in tree(plant).apps


def test_without_a_change_it_is_the_same_tree(make: Any) -> None:
    plant = make(sources=TWO)
    plant.announce("a", source="slow")
    plant.announce("a", source="fast", display_name="differs")
    first = tree(plant)
    plant.wait(1)
    assert tree(plant) is first


def test_a_store_that_has_forgotten_what_changed_is_read_anew(make: Any) -> None:
    plant = make(sources={"robots": {"max_hints": 20_000, "global_rate": 1e6}})
    store = plant.gateway.listeners[0].store
    plant.announce("before")
    assert set(tree(plant).apps) == {"before"}
    for number in range(10_001):
        store.update(BeaconHint(f"passing{number}"))
    store.forget()
    store.update(BeaconHint("after"))
    assert set(tree(plant).apps) == {"after"}


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=f"{case['n']}")
        for case in CASES
        # No store holds two hints about one id.
        if not case["name"].startswith("duplicate hints")
    ],
)
def test_hints_are_laid_over_the_tree_as_in_the_cpp_system(case: dict[str, Any]) -> None:
    store = HintStore(ManualClock(), ttl_s=1e6, expiry_s=1e7)
    for hint in case["hints"]:
        fields: dict[str, Any] = {
            key: tuple(v) if isinstance(v, list) else v for key, v in hint.items()
        }
        for key in ("age_ns", "age_sec", "status"):
            del fields[key]
        store.update(BeaconHint(**fields))
    layer = BeaconLayer(
        [store],
        lambda entity_id: Beacon.of(
            View("", "", stored) for stored in [store.get(entity_id)] if stored
        ),
        allow_new_entities=case["allow_new_entities"],
        strict_upstream=True,
    )
    current = case["current"]
    said = layer.map(
        Tree(
            components={one["id"]: Component(**one) for one in current["components"]},
            apps={one["id"]: App(**one) for one in current["apps"]},
            functions={
                one["id"]: Function(one["id"], one["name"], tuple(one["hosts"]))
                for one in current["functions"]
            },
        )
    )
    new = case["result"]["new_entities"]
    assert {one.id: (one.name, one.component_id) for one in said.apps.values()} == {
        one["id"]: (one["name"], one["component_id"]) for one in new["apps"]
    }
    assert {one.id: one.name for one in said.components.values()} == {
        one["id"]: one["name"] for one in new["components"]
    }
    assert {one.id: set(one.hosts) for one in said.functions.values()} == {
        one["id"]: set(one["hosts"]) for one in new["functions"]
    }
