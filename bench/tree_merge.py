"""How long it takes to merge the entity tree: from scratch, and after 1 % of it changed.

    python bench/tree_merge.py

Prints the ratios the project promises and milliseconds of processor time (best of several). All
figures of one run come from one machine at one time, so the ratios hold anywhere.

A tree of 10,000 apps, half of them in a manifest, a tenth bound to ROS nodes; each is heard.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable

import attrs

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.store import HintStore
from beacon_gateway.tree.entities import App, Component, Function, RosBinding, Tree
from beacon_gateway.tree.host import Host
from beacon_gateway.tree.incremental import IncrementalMerge
from beacon_gateway.tree.keeper import TreeKeeper, TreeSettings
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.tree.merge import Layer, MergeResult, merge
from beacon_gateway.tree.policies import BEACONS, MANIFEST, RUNTIME
from beacon_gateway.views import Beacon, View
from measure import Report, options

APPS = 10_000
CHANGED = APPS // 100
FUNCTIONS = 100
COMPONENTS = 200


def app_id(number: int) -> str:
    return f"app_{number:05d}"


def manifest_tree(apps: int) -> Tree:
    components = {f"c{n}": Component(f"c{n}", f"Component {n}") for n in range(COMPONENTS)}
    functions = {f"f{n}": Function(f"f{n}", f"Function {n}") for n in range(FUNCTIONS)}
    known = [
        App(
            app_id(number),
            f"App {number}",
            f"c{number % COMPONENTS}",
            (app_id((number + 1) % apps),),
            RosBinding(f"node_{number:05d}") if number % 10 == 0 else None,
        )
        for number in range(apps)
    ]
    return Tree({}, components, {app.id: app for app in known}, functions)


class Layers:
    """What the layers say, with every app in two of them."""

    def __init__(self) -> None:
        self.manifest = manifest_tree(APPS)
        bound = [app for app in self.manifest.apps.values() if app.ros_binding]
        self.runtime = Tree(apps={app.id: App(app.id, is_online=True) for app in bound})
        self.beacons = Tree(apps={app_id(n): self.shadow(n, "first") for n in range(APPS)})
        self.round = 0
        self.kept = IncrementalMerge()
        self.incremental()

    def shadow(self, number: int, word: str) -> App:
        return App(app_id(number), f"{word} {number}", source="beacon")

    def now(self) -> tuple[Layer, ...]:
        return (
            Layer("manifest", self.manifest, MANIFEST),
            Layer("runtime", self.runtime, RUNTIME),
            Layer("beacon", self.beacons, BEACONS, unites_lists=True),
        )

    def change(self) -> None:
        self.round += 1
        apps = dict(self.beacons.apps)
        for number in range(0, APPS, APPS // CHANGED):
            apps[app_id(number)] = self.shadow(number, f"round {self.round}")
        self.beacons = Tree(apps=apps)

    def scratch(self) -> MergeResult:
        return merge(self.now())

    def incremental(self) -> MergeResult:
        return self.kept.merge(self.now())


class House:
    """The same from the stores on, as a gateway has it."""

    def __init__(self) -> None:
        self.store = HintStore(ManualClock(), max_hints=APPS)
        self.manifest = manifest_tree(APPS // 2)
        self.nodes = frozenset(f"/node_{number:05d}" for number in range(0, APPS // 2, 10))
        self.round = 0
        for number in range(APPS):
            self.hear(number)
        self.kept = self.keeper()
        self.kept.tree()
        self.kept.roll_ups()

    def hear(self, number: int) -> None:
        self.store.update(
            BeaconHint(
                app_id(number),
                display_name=f"Round {self.round}",
                function_ids=(f"f{number % FUNCTIONS}",),
            )
        )

    def change(self, count: int = CHANGED) -> None:
        self.round += 1
        for number in range(0, APPS, APPS // count):
            self.hear(number)

    def beacon(self, entity_id: str) -> Beacon | None:
        stored = self.store.get(entity_id)
        return None if stored is None else Beacon((View("robots", "fake", stored),))

    def keeper(self) -> TreeKeeper:
        settings = TreeSettings(Host.named("host", "Host", "unplaced"))
        manifest = Manifest(self.manifest)
        return TreeKeeper(manifest, [self.store], [lambda: self.nodes], self.beacon, settings)


def best_ms(work: Callable[[], object], before: Callable[[], object], rounds: int) -> float:
    best = float("inf")
    for _ in range(rounds):
        before()
        gc.collect()
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best * 1000


def nothing() -> None:
    pass


def relations(tree: Tree) -> None:
    attrs.evolve(tree).apps_on("c1")


def main() -> None:
    arguments = options()
    rounds = 1 if arguments.quick else 15
    layers, house = Layers(), House()
    layers.change()
    assert layers.incremental().tree == layers.scratch().tree
    scratch = best_ms(layers.scratch, nothing, rounds)
    one_percent = best_ms(layers.incremental, layers.change, rounds)
    first = best_ms(lambda: house.keeper().tree(), nothing, rounds)
    again = best_ms(house.kept.tree, house.change, rounds)
    rows = [
        ("merge from scratch", scratch),
        ("merge, 1 % changed", one_percent),
        ("merge, nothing changed", best_ms(layers.incremental, nothing, rounds)),
        ("from the stores on, the first time", first),
        ("from the stores on, 1 % changed", again),
        (
            "from the stores on, one changed",
            best_ms(house.kept.tree, lambda: house.change(1), rounds),
        ),
        ("from the stores on, nothing changed", best_ms(house.kept.tree, nothing, rounds)),
        (
            "who is on what, of a new tree",
            best_ms(lambda: relations(house.kept.tree()), nothing, rounds),
        ),
        ("all roll-ups", best_ms(house.kept.roll_ups, house.change, rounds)),
    ]
    report = Report("Merging 10,000 apps, 200 components and 100 functions")
    report.ratio("1 % changed / from scratch", one_percent / scratch, 0.05)
    report.ratio("the same from the stores on", again / first, 0.05)
    report.line("")
    for name, milliseconds in rows:
        report.line(f"{name:<58} {milliseconds:8.3f} ms")
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
