"""The one tree of a gateway: all layers together, its host, its nodes, and who is active."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.store import HintStore
from beacon_fake import ADAPTER, FakeNetwork, FakeSource, share_network, unshare_network
from beacon_gateway.config import load_config, parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.tree.entities import App, Area, Component, Function, Kind, RosBinding, Tree
from beacon_gateway.tree.host import Host
from beacon_gateway.tree.keeper import TreeKeeper, TreeSettings
from beacon_gateway.tree.linker import Unmanifested
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.tree.rollup import RollUp
from beacon_gateway.views import Beacon, View

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import PlantMaker

HOST = Host("host", "Host", "unplaced")


class House:
    """A keeper over stores and a ROS graph that the test fills."""

    def __init__(
        self,
        *apps: App,
        components: Iterable[Component] = (),
        areas: Iterable[Area] = (),
        functions: Iterable[Function] = (),
        policy: Unmanifested | None = None,
        stores: int = 1,
        **settings: Any,
    ) -> None:
        self.clock = ManualClock()
        self.stores = [HintStore(self.clock, ttl_s=10, expiry_s=100) for _ in range(stores)]
        self.nodes: frozenset[str] = frozenset()
        self.tree_before = Tree(
            {one.id: one for one in areas},
            {one.id: one for one in components},
            {one.id: one for one in apps},
            {one.id: one for one in functions},
        )
        self.manifest = Manifest(self.tree_before, policy)
        self.settings = TreeSettings(HOST, **settings)
        self.keeper = self.new_keeper()

    def new_keeper(self) -> TreeKeeper:
        return TreeKeeper(
            self.manifest, self.stores, [lambda: self.nodes], self.beacon, self.settings
        )

    def beacon(self, entity_id: str) -> Beacon | None:
        return Beacon.of(
            View(str(number), "fake", stored)
            for number, store in enumerate(self.stores)
            if (stored := store.get(entity_id)) is not None
        )

    def hear(self, entity_id: str, store: int = 0, **fields: Any) -> None:
        self.stores[store].update(BeaconHint(entity_id, **fields), source="robot")

    @property
    def tree(self) -> Tree:
        return self.keeper.tree()


# The host.


def test_apps_that_nobody_places_are_on_the_host() -> None:
    house = House(App("known"), App("placed", component_id="ecu"), components=[Component("ecu")])
    house.hear("new")
    assert [one.id for one in house.tree.apps_on("host")] == ["known", "new"]
    assert house.tree.components["host"] == Component("host", "Host", source="host")
    assert house.tree.areas == {}


def test_the_host_is_listed_while_somebody_is_on_it() -> None:
    house = House(components=[Component("ecu")])
    assert set(house.tree.components) == {"ecu"}
    house.hear("new")
    assert set(house.tree.components) == {"ecu", "host"}
    house.clock.advance(100 * 10**9)
    assert set(house.tree.components) == {"ecu"}


def test_where_there_are_areas_the_host_is_in_one() -> None:
    house = House(App("a"), areas=[Area("hall")])
    assert house.tree.components["host"].area == "unplaced"
    assert house.tree.areas["unplaced"] == Area("unplaced", "Unplaced", source="host")
    assert [one.id for one in house.tree.components_in("unplaced")] == ["host"]


def test_a_host_that_the_manifest_knows_keeps_what_is_said_of_it() -> None:
    known = Component("host", "Known", area="hall")
    house = House(App("a"), components=[known], areas=[Area("hall")])
    assert house.tree.components["host"] == known


def test_a_hint_may_be_about_the_host() -> None:
    house = House()
    house.hear("host", display_name="Robot 1")
    assert house.tree.components["host"].name == "Robot 1"
    assert house.tree.apps == {}


def test_a_host_that_only_a_hint_is_about_is_in_its_area_too() -> None:
    house = House(areas=[Area("hall")])
    house.hear("host")
    assert house.tree.components["host"].area == "unplaced"


def test_a_hint_may_place_its_app_on_the_host() -> None:
    house = House()
    house.hear("a", component_id="host")
    assert set(house.tree.components) == {"host"}


def test_where_there_are_areas_a_component_that_only_hints_name_is_in_the_hosts() -> None:
    house = House(areas=[Area("hall")])
    house.hear("a", component_id="amr")
    assert house.tree.components == {"amr": Component("amr", area="unplaced", source="beacon")}
    assert set(house.tree.areas) == {"hall", "unplaced"}
    house.keeper.take_manifest(Manifest(Tree(functions={"f": Function("f")})))
    assert house.tree.components == {"amr": Component("amr", source="beacon")}
    assert house.tree.areas == {}
    house.keeper.take_manifest(Manifest(Tree(functions={"amr": Function("amr")})))
    assert house.tree.components == {}


def test_a_hint_places_an_app_where_the_manifest_may_be_overridden() -> None:
    house = House(App("a", component_id="ecu"), components=[Component("ecu")])
    house.hear("a", component_id="amr")
    assert set(house.tree.components) == {"ecu"}
    house.manifest = attrs.evolve(house.manifest, allow_manifest_override=False)
    house.keeper.take_manifest(house.manifest)
    assert set(house.tree.components) == {"ecu", "amr"}
    assert [one.id for one in house.tree.apps_on("amr")] == ["a"]
    assert house.tree == house.new_keeper().tree()


def test_a_component_that_only_hints_name_has_no_beacon_to_miss() -> None:
    house = House()
    house.hear("a", component_id="amr")
    house.hear("b", depends_on=("amr",))
    assert house.keeper.roll_up("b").active
    assert house.keeper.roll_up("amr").active


def test_the_default_id_is_made_of_this_computers_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "robot-7.example.org" + "x" * 300)
    host = Host.named("", "", "unplaced")
    assert host.id.startswith("host-robot-7-example-org")
    assert len(host.id) <= 256
    assert host.name.startswith("robot-7.example.org")
    assert Host.named("ecu", "ECU", "a") == Host("ecu", "ECU", "a")


# The ROS graph.


def bound(app_id: str, node: str) -> App:
    return App(app_id, ros_binding=RosBinding(node))


def test_an_app_is_online_while_its_node_is_there() -> None:
    house = House(bound("a", "n"))
    assert not house.tree.apps["a"].is_online
    house.nodes = frozenset({"/n"})
    assert (house.tree.apps["a"].is_online, house.tree.apps["a"].bound_fqn) == (True, "/n")
    house.nodes = frozenset()
    assert (house.tree.apps["a"].is_online, house.tree.apps["a"].bound_fqn) == (False, "")


@pytest.mark.parametrize(
    ("policy", "runtime_nodes", "shown"),
    [
        (None, False, False),
        (None, True, True),
        (Unmanifested.IGNORE, False, False),
        (Unmanifested.IGNORE, True, False),
        (Unmanifested.WARN, False, False),
        (Unmanifested.WARN, True, True),
        (Unmanifested.ERROR, False, False),
        (Unmanifested.INCLUDE_AS_ORPHAN, False, True),
    ],
)
def test_nodes_become_apps_only_if_somebody_asked_for_it(
    policy: Unmanifested | None, *, runtime_nodes: bool, shown: bool
) -> None:
    house = House(policy=policy, runtime_nodes=runtime_nodes)
    house.nodes = frozenset({"/arm/driver"})
    assert set(house.tree.apps) == ({"arm_driver"} if shown else set())


def test_a_hint_enriches_the_app_of_a_node() -> None:
    house = House(runtime_nodes=True)
    house.nodes = frozenset({"/driver"})
    assert house.tree.apps["driver"].source == "node"
    house.hear("driver", display_name="Arm driver")
    found = house.tree.apps["driver"]
    assert (found.name, found.source, found.is_online) == ("Arm driver", "node", True)


@pytest.mark.parametrize(
    ("policy", "level"),
    [(Unmanifested.WARN, logging.WARNING), (Unmanifested.ERROR, logging.ERROR)],
)
def test_a_node_of_no_app_is_logged_once(
    policy: Unmanifested, level: int, caplog: pytest.LogCaptureFixture
) -> None:
    house = House(bound("a", "n"), policy=policy)
    for nodes in ({"/n", "/x"}, {"/n"}, {"/x", "/y"}):
        house.nodes = frozenset(nodes)
        assert house.tree
    assert [(one.levelno, one.message) for one in caplog.records] == [
        (level, f"'{node}' is the node of no app of the manifest") for node in ("/x", "/y")
    ]


def test_without_a_policy_nothing_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    house = House()
    house.nodes = frozenset({"/x"})
    assert house.tree == Tree()
    assert caplog.records == []


# Who is active.


def test_an_app_is_active_while_it_and_all_it_needs_are_heard() -> None:
    house = House(App("a", depends_on=("b",)), App("b"))
    assert house.keeper.roll_up("a") == RollUp(False, ("a",), "a was never heard")
    house.hear("a")
    assert house.keeper.roll_up("a") == RollUp(False, ("a", "b"), "b was never heard")
    house.hear("b", depends_on=("c",))
    assert house.keeper.roll_up("a") == RollUp(False, ("a", "b", "c"), "c is unknown")
    house.hear("c")
    assert house.keeper.roll_up("a") == RollUp(active=True)
    house.stores[0].goodbye("c", source="robot")
    assert house.keeper.roll_up("a") == RollUp(False, ("a", "b", "c"), "c said goodbye")
    house.clock.advance(10 * 10**9)
    assert house.keeper.roll_up("a") == RollUp(False, ("a",), "a is stale: it is silent")
    assert house.keeper.roll_up("c").reason == "c is unknown"


def test_who_was_heard_and_forgotten_is_not_heard_any_more() -> None:
    house = House(App("a"))
    assert house.keeper.never_heard("a")
    house.hear("a")
    house.keeper.listen()
    house.clock.advance(100 * 10**9)
    assert not house.keeper.never_heard("a")
    assert house.keeper.roll_up("a").reason == "a is not heard any more"


def test_only_who_is_known_beforehand_can_be_missed() -> None:
    house = House(App("a"), components=[Component("ecu")], functions=[Function("f")])
    assert house.keeper.never_heard("ecu")
    assert not house.keeper.never_heard("f")
    assert not house.keeper.never_heard("nobody")
    assert not house.keeper.never_heard("host")


def test_what_has_no_beacon_of_its_own_is_not_blamed_for_that() -> None:
    house = House(
        bound("node", "n"),
        App("a", depends_on=("node",)),
        areas=[Area("hall")],
        functions=[Function("f", depends_on=("g",)), Function("g", depends_on=("a",))],
    )
    house.nodes = frozenset({"/n"})
    house.hear("a")
    active = {one for one, roll in house.keeper.roll_ups().items() if roll.active}
    assert active == {"host", "node", "a", "hall", "unplaced", "f", "g"}
    house.nodes = frozenset()
    assert house.keeper.roll_up("f").chain == ("f", "g", "a", "node")


def test_a_beacon_is_believed_more_than_a_node() -> None:
    house = House(bound("a", "n"))
    house.nodes = frozenset({"/n"})
    house.hear("a")
    house.clock.advance(10 * 10**9)
    assert house.keeper.roll_up("a").reason == "a is stale: it is silent"


def test_who_was_lost_on_one_source_is_there_again_once_another_one_hears_it() -> None:
    house = House(App("a"), stores=2)
    for store in (0, 1):
        house.hear("a", store)
    house.clock.advance(10**9)
    house.stores[0].lost("a", source="robot", reason="link down")
    assert house.keeper.roll_up("a").reason == "a is stale: link down"
    house.clock.advance(10**9)
    house.hear("a", 1)
    assert house.keeper.roll_up("a").active


def test_roll_ups_are_worked_out_once_for_each_change() -> None:
    house = House(App("a", depends_on=("b",)), App("b"))
    first = house.keeper.roll_ups()
    assert house.keeper.roll_ups() is first
    house.hear("a")
    house.hear("b")
    assert house.keeper.roll_ups()["a"].active
    house.clock.advance(10 * 10**9)
    assert house.keeper.roll_ups()["a"].reason == "a is stale: it is silent"
    assert not first["a"].active


# The report.


def test_the_report_says_how_the_tree_came_about() -> None:
    house = House(bound("a", "n"), App("ecu"), components=[Component("ecu")])
    house.nodes = frozenset({"/n", "/other"})
    house.hear("a")
    house.hear("new")
    report = house.keeper.report()
    assert report.layers == ("manifest", "runtime", "host", "beacon")
    assert set(house.tree.components) == {"ecu", "host"}
    assert set(house.tree.apps) == {"a", "ecu", "new"}
    assert (report.total_entities, report.enriched_count, report.id_collisions) == (5, 1, 1)
    assert (report.conflict_count, report.conflicts) == (0, ())
    assert report.linking is not None
    assert (report.linking.linked_count, report.linking.orphans) == (1, ("/other",))


def test_without_a_graph_there_is_no_report_of_linking(make_plant: PlantMaker) -> None:
    assert make_plant().gateway.directory.report().linking is None


# The whole of it.


def test_a_gateway_reads_its_manifest_from_beside_its_configuration(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("manifest_version: '1.0'\napps: [{id: a, name: A}]\n")
    (tmp_path / "gateway.yaml").write_text(
        "manifest: m.yaml\n"
        "sources: {robots: {adapter: fake, options: {network: manifest-test}}}\n"
        "entities: {apps: [{id: b, ros_node: /arm/b}]}\n"
        "default_component: {id: host, name: Host}\n"
    )
    share_network(FakeNetwork(ManualClock()), "manifest-test")
    try:
        directory = Gateway(load_config(tmp_path / "gateway.yaml").config).directory
    finally:
        unshare_network("manifest-test")
    assert {one.name or one.id for one in directory.tree().apps.values()} == {"A", "b"}
    assert directory.tree().apps["b"].ros_binding == RosBinding("arm/b")
    assert directory.tree().components["host"].name == "Host"
    assert directory.never_heard("a")
    assert directory.roll_ups()["a"] == directory.roll_up("a")


class Seeing(FakeSource):
    """A source whose carrier shows the ROS graph."""

    def nodes(self) -> frozenset[str]:
        return frozenset({"/arm/b", "/other"})


def test_a_source_that_sees_the_graph_says_who_is_online() -> None:
    adapter = attrs.evolve(ADAPTER, source=lambda _: Seeing(FakeNetwork(ManualClock())))
    sources = {"ros": {"adapter": "fake", "options": {"network": "none"}}}
    entities = {"apps": [{"id": "b", "ros_node": "/arm/b"}]}
    document = {"sources": sources, "entities": entities, "runtime_nodes": True}
    config = parse_config(document, lambda _: adapter).config
    directory = Gateway(config, lookup=lambda _: adapter).directory
    apps = directory.tree().apps
    assert {one.id: (one.is_online, one.bound_fqn) for one in apps.values()} == {
        "b": (True, "/arm/b"),
        "other": (True, "/other"),
    }
    assert directory.kind("other") is Kind.APP
    linking = directory.report().linking
    assert linking is not None
    assert (linking.linked_count, linking.orphan_count) == (1, 1)


def test_another_manifest_takes_the_place_of_the_first() -> None:
    house = House(bound("a", "n"), App("b"), areas=[Area("hall")])
    house.nodes = frozenset({"/n", "/m"})
    house.hear("a")
    house.hear("late")
    assert house.tree.apps["a"].is_online
    apps = [App("a"), bound("c", "m"), App("late"), App("new")]
    house.manifest = Manifest(Tree(apps={app.id: app for app in apps}))
    house.keeper.take_manifest(house.manifest)
    assert house.tree == house.new_keeper().tree()
    assert (house.tree.apps["a"].is_online, house.tree.apps["c"].is_online) == (False, True)
    assert set(house.tree.areas) == set()
    assert [one for one in house.tree.apps if house.keeper.never_heard(one)] == ["c", "new"]
    assert not house.keeper.never_heard("b")


def test_many_threads_read_while_hints_arrive() -> None:
    house = House(App("a", depends_on=("r0",)), stores=2)
    done = threading.Event()
    broken: list[BaseException] = []

    def read() -> None:
        try:
            while not done.is_set():
                tree = house.tree
                assert all(key == app.id for key, app in tree.apps.items())
                house.keeper.roll_ups().get("a")
                house.keeper.report()
        except BaseException as error:  # noqa: BLE001 - told to the test
            broken.append(error)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for number in range(300):
        house.hear(f"r{number % 50}", store=number % 2, display_name=str(number))
        house.clock.advance(10**8)
    done.set()
    for reader in readers:
        reader.join()
    assert broken == []
    assert house.tree == house.new_keeper().tree()


ids = st.sampled_from(["a", "b", "c", "host", "f"])
words = st.sampled_from(["", "one", "two"])
MANIFESTS = [
    Manifest(Tree()),
    Manifest(Tree(apps={"a": App("a", component_id="one"), "two": App("two")})),
    Manifest(Tree({"one": Area("one")}, {"two": Component("two")}), allow_manifest_override=False),
    Manifest(
        Tree({"hall": Area("hall")}, {}, {"b": App("b", component_id="one")}),
        allow_manifest_override=False,
    ),
]


class KeptUpToDate(RuleBasedStateMachine):
    """Whatever happens in stores and graph, the tree that was kept is the one made anew."""

    def __init__(self) -> None:
        super().__init__()
        self.house = House(
            bound("a", "n"),
            App("b", "B", depends_on=("a",)),
            components=[Component("c")],
            areas=[Area("hall")],
            functions=[Function("f", hosts=("b",)), Function("g")],
            stores=2,
            runtime_nodes=True,
        )

    @rule(
        entity_id=ids,
        store=st.integers(0, 1),
        name=words,
        component=st.sampled_from(["", "one", "two", "a", "c", "f", "hall", "unplaced"]),
        functions=st.lists(st.sampled_from(["f", "g", "h"]), max_size=2, unique=True).map(tuple),
        needs=st.lists(ids, max_size=2).map(tuple),
    )
    def heard(
        self, entity_id: str, store: int, name: str, component: str, functions: Any, needs: Any
    ) -> None:
        self.house.hear(
            entity_id,
            store,
            display_name=name,
            component_id=component,
            function_ids=functions,
            depends_on=needs,
        )

    @rule(entity_id=ids, store=st.integers(0, 1))
    def left(self, entity_id: str, store: int) -> None:
        self.house.stores[store].goodbye(entity_id, source="robot")

    @rule(entity_id=ids, store=st.integers(0, 1))
    def forgotten(self, entity_id: str, store: int) -> None:
        self.house.stores[store].forget(entity_id)

    @rule(seconds=st.sampled_from([1, 11, 101]))
    def time_passes(self, seconds: int) -> None:
        self.house.clock.advance(seconds * 10**9)

    @rule(nodes=st.frozensets(st.sampled_from(["/n", "/b", "/x", "/f"])))
    def graph_changes(self, nodes: frozenset[str]) -> None:
        self.house.nodes = nodes

    @rule(manifest=st.sampled_from(MANIFESTS))
    def manifest_changes(self, manifest: Manifest) -> None:
        house = self.house
        house.manifest = attrs.evolve(manifest, tree=joined(house.tree_before, manifest.tree))
        house.keeper.take_manifest(house.manifest)

    @invariant()
    def nobody_is_lost_on_the_way(self) -> None:
        """From a component to each app, unless the place's id stands for something else, or is kept
        for the area of who is nowhere."""
        tree, known = self.house.tree, self.house.manifest.tree
        for app in tree.apps.values():
            if tree.kind(app.component_id) is None and app.component_id != HOST.area:
                assert known.apps[app.id].component_id == app.component_id
        for component in tree.components.values():
            if component.source == "beacon":
                assert list(tree.apps_on(component.id))
                assert not any(
                    component.id in ids for ids in (tree.apps, tree.areas, tree.functions)
                )
                assert (component.area in tree.areas) == bool(known.areas)

    @invariant()
    def kept_is_made_anew(self) -> None:
        house, anew = self.house, self.house.new_keeper()
        assert content(house.tree) == content(anew.tree())
        kept = dict(house.keeper.roll_ups())
        fresh = dict(anew.roll_ups())
        assert {one: roll.active for one, roll in kept.items()} == {
            one: roll.active for one, roll in fresh.items()
        }
        assert house.keeper.report().enriched_count == anew.report().enriched_count


def joined(one: Tree, other: Tree) -> Tree:
    """Both; of what is in both the second, whatever its kind."""
    taken = {*other.areas, *other.components, *other.apps, *other.functions}
    kinds = ("areas", "components", "apps", "functions")
    return Tree(
        *(
            {key: item for key, item in getattr(one, kind).items() if key not in taken}
            | getattr(other, kind)
            for kind in kinds
        )
    )


def content(tree: Tree) -> Tree:
    """Without the order of hosts, which is that in which they joined."""
    functions = {
        one.id: attrs.evolve(one, hosts=tuple(sorted(one.hosts))) for one in tree.functions.values()
    }
    return attrs.evolve(tree, functions=functions)


KeptUpToDate.TestCase.settings = settings(deadline=None, max_examples=100, stateful_step_count=20)
TestKeptUpToDate = KeptUpToDate.TestCase
