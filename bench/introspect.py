"""How long it takes to say what the hints say: from scratch, and after 1 % of them changed.

    python bench/introspect.py

Prints the ratios the project promises and milliseconds of processor time (best of several). All
figures of one run come from one machine at one time, so the ratios hold anywhere.

The cost of 1,000 hints is that of one store of ten, mapped one after the other: so both sides of
the ratio go through the same amount of memory, and it shows the algorithm. 1,000 hints mapped again
and again alone stay in the processor's second cache, where each costs about a tenth less.
"""

from __future__ import annotations

import gc
import json
import time
from collections.abc import Callable

import attrs

from beacon_core.clock import ManualClock
from beacon_core.entities import App, Entities, Function
from beacon_core.hint import BeaconHint
from beacon_core.introspection import Introspection
from beacon_core.mapper import IncrementalMapper, map_hints
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from measure import Report, options

FUNCTIONS = 100
CPP_MAP_MS = 125.0
CPP_ALL_MS = 191.0
"""The C++ at 10,000 hints, one thread of a 2-core machine: mapping; snapshot, mapping and JSON."""


def hint(number: int, word: str = "Engine") -> BeaconHint:
    return attrs.evolve(
        bench_hint(number),
        display_name=f"{word} temperature {number:06d}",
        function_ids=(f"f{number % FUNCTIONS}", f"f{number * 7 % FUNCTIONS}"),
    )


class House:
    """A store of ``count`` hints, the tree that knows them all, and a mapper that is up to date."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.clock = ManualClock()
        self.store = HintStore(self.clock, max_hints=count)
        for number in range(count):
            self.store.update(hint(number))
        self.known = Entities(
            apps=[App(hint(number).entity_id) for number in range(count)],
            functions=[Function(f"f{number}", f"Function {number}") for number in range(FUNCTIONS)],
        )
        self.mapper = IncrementalMapper(self.store)
        self.round = 0
        self.incremental()

    def change(self, count: int) -> None:
        self.round += 1
        for number in range(0, self.count, self.count // count):
            self.store.update(hint(number, f"Round {self.round}"))

    def refresh(self) -> None:
        self.clock.advance(10**9)
        for number in range(self.count):
            self.store.update(
                hint(number, f"Round {self.round}" if number % 100 == 0 else "Engine")
            )

    def scratch(self) -> Introspection:
        return map_hints(self.store.snapshot(), self.known, self.clock.monotonic_ns())

    def first(self) -> Introspection:
        return IncrementalMapper(self.store).introspect(self.known)

    def incremental(self) -> Introspection:
        return self.mapper.introspect(self.known)

    def read_all(self) -> None:
        dict(self.incremental().metadata)

    def another_tree(self) -> None:
        self.known = attrs.evolve(self.known)


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


def as_json(result: Introspection) -> str:
    return json.dumps(
        {
            "metadata": dict(result.metadata),
            "apps": [(one.id, one.name, one.component_id) for one in result.new_apps],
            "functions": [(one.id, one.name, one.hosts) for one in result.new_functions],
        }
    )


def main() -> None:
    arguments = options()
    rounds = 1 if arguments.quick else 10
    big, small = House(10_000), [House(1_000) for _ in range(10)]
    assert len(big.scratch().new_apps) == 10_000
    # In turns, so that a busy neighbour disturbs all alike.
    turns = [
        (
            best_ms(big.scratch, nothing, 1),
            best_ms(lambda: [house.scratch() for house in small], nothing, 1) / 10,
            best_ms(small[0].scratch, nothing, 5),
        )
        for _ in range(1 if arguments.quick else 15)
    ]
    scratch, scratch_small, in_cache = map(min, zip(*turns, strict=True))
    one_percent = best_ms(big.incremental, lambda: big.change(100), rounds)
    rows = [
        ("from scratch, 1,000 hints (one of ten)", scratch_small),
        ("from scratch, 1,000 hints (alone)", in_cache),
        ("from scratch, 10,000 hints", scratch),
        ("the first time, 10,000 hints", best_ms(big.first, nothing, rounds)),
        ("1 % changed", one_percent),
        ("one changed", best_ms(big.incremental, lambda: big.change(1), rounds)),
        ("all refreshed, none changed", best_ms(big.incremental, big.refresh, min(rounds, 3))),
        ("an equal tree in another object", best_ms(big.incremental, big.another_tree, rounds)),
        (
            "reading all metadata",
            best_ms(lambda: dict(big.incremental().metadata), nothing, rounds),
        ),
        ("from scratch, as JSON", best_ms(lambda: as_json(big.scratch()), nothing, rounds)),
    ]
    report = Report("Mapping 10,000 hints onto 10,000 apps and 100 functions")
    report.ratio("1 % changed / from scratch", one_percent / scratch, 0.1)
    report.ratio("from scratch, 10,000 / 1,000", scratch / scratch_small, 12.0)
    report.ratio("from scratch / the C++'s 125 ms", scratch / CPP_MAP_MS, 1.0)
    report.ratio("from scratch with JSON / the C++'s 191 ms", rows[-1][1] / CPP_ALL_MS, 1.0)
    report.line("")
    for name, milliseconds in rows:
        report.line(f"{name:<58} {milliseconds:8.3f} ms")
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
