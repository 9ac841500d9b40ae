"""What one message costs on its way through the intake, against reading its JSON.

    python bench/intake.py [--profile]

The measure is ``json.loads`` of the same payload, since any gateway in Python would do at least
that. Payloads are fresh objects in every round, as they are when they come from a socket, so their
hashes are not known yet.
"""

from __future__ import annotations

import cProfile
import json
import pstats
import random
from collections.abc import Callable

import attrs

from beacon_core.clock import SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.outcome import Verdict
from beacon_core.ports.adapter import Decoder
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import cdr
from beacon_core.wire import json as wire_json
from measure import Report, best_ns, options

MESSAGES = 2_000
"""Messages per round."""


class Road:
    """An intake whose rates are no hindrance, and a fleet that speaks through it."""

    def __init__(
        self,
        decode: Decoder,
        encode: Callable[[BeaconHint], bytes],
        entities: int,
        *,
        sources: int | None = None,
    ) -> None:
        store = HintStore(SystemClock(), max_hints=entities)
        self.intake = Intake(store, decode, source_rate=1e9, global_rate=1e9)
        once = list(range(entities))
        random.Random(1).shuffle(once)  # noqa: S311
        order = once * max(1, MESSAGES // entities)
        self.payloads = [
            [encode(hint(number, f"1.2.{version}")) for number in order] for version in (3, 4)
        ]
        # Every message of a changing fleet differs from the one before it.
        turns = [place // entities % 2 for place in range(len(order))]
        self.changing = [self.payloads[turn][place] for place, turn in enumerate(turns)]
        self.sources = [f"robot-{number % (sources or entities)}" for number in order]
        self.refresh(self.copies())

    def copies(self, version: int = 0) -> list[bytes]:
        return [bytes(bytearray(payload)) for payload in self.payloads[version]]

    def refresh(self, payloads: list[bytes]) -> None:
        offer = self.intake.offer
        for payload, source in zip(payloads, self.sources, strict=True):
            offer(payload, source)

    def change(self) -> None:
        before = self.intake.totals()[Verdict.CHANGED]
        self.refresh(self.changing)
        assert self.intake.totals()[Verdict.CHANGED] - before >= len(self.changing) * 0.9


def hint(number: int, firmware: str) -> BeaconHint:
    return attrs.evolve(bench_hint(number), metadata={"firmware": firmware, "vendor": "acme"})


def each(function: Callable[[bytes], object], payloads: list[bytes]) -> Callable[[], None]:
    def run() -> None:
        for payload in payloads:
            function(payload)

    return run


def main() -> None:
    arguments = options()
    rounds = 3 if arguments.quick else 40
    refresh_targets = {1: 0.25, 100: None, 10_000: None}
    report = Report("One message through the intake / json.loads of the same 428 bytes")
    for entities, target in refresh_targets.items():
        road = Road(wire_json.decode, wire_json.encode, entities)
        # One fresh copy of each payload per round: a hash is kept by the object it was made for.
        fresh = [road.copies() for _ in range(rounds)]
        best = best_ns(
            {
                "json": each(json.loads, road.payloads[0]),
                "refresh": lambda road=road, fresh=fresh: road.refresh(fresh.pop()),  # type: ignore[misc]
            },
            rounds=rounds,
        )
        report.ratio(f"unchanged, {entities} entities", best["refresh"] / best["json"], target)
    road = Road(wire_json.decode, wire_json.encode, 100, sources=1)
    fresh = [road.copies() for _ in range(rounds)]
    best = best_ns(
        {
            "json": each(json.loads, road.payloads[0]),
            "refresh": lambda: road.refresh(fresh.pop()),
        },
        rounds=rounds,
    )
    report.ratio("unchanged, 100 entities of one source", best["refresh"] / best["json"])

    road = Road(wire_json.decode, wire_json.encode, 100)
    best = best_ns(
        {
            "json": each(json.loads, road.payloads[0]),
            "decode": each(wire_json.decode, road.payloads[0]),
            "change": road.change,
        },
        rounds=rounds,
    )
    report.ratio("changed, JSON", best["change"] / best["json"], 3.0)
    report.ratio("  of that, beacon_core.wire.json.decode", best["decode"] / best["json"])

    cdr_road = Road(cdr.decode, cdr.encode, 100)
    best = best_ns(
        {"decode": each(cdr.decode, cdr_road.payloads[0]), "change": cdr_road.change},
        rounds=rounds,
    )
    report.ratio("changed, CDR / a bare cdr.decode", best["change"] / best["decode"], 2.0)

    if arguments.profile:
        profile("unchanged", lambda: road.refresh(road.copies()))
        profile("changed", road.change)
    report.finish(check=arguments.check)


def profile(what: str, function: Callable[[], object]) -> None:
    print(f"\nWhere the time of an {what} message goes (the profiler's own cost is in it):\n")
    profiler = cProfile.Profile()
    profiler.runcall(function)
    pstats.Stats(profiler).sort_stats("tottime").print_stats(18)


if __name__ == "__main__":
    main()
