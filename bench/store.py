"""What a store of 100,000 hints costs: memory for each, and a sweep.

    python bench/store.py

Memory is what Python's allocator handed out (``tracemalloc``), with the hints decoded from JSON as
they are in a gateway, so that no string is shared by accident of the benchmark. The sweep's 99,900
other hints have all been refreshed since they were stored, as they are in real life.
"""

from __future__ import annotations

import gc
import time
import tracemalloc

from beacon_core.clock import ManualClock
from beacon_core.intake import Intake
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json as wire_json
from measure import Report, options

CPP_BYTES_PER_HINT = 1547.0
S = 1_000_000_000


def bytes_per_hint(count: int, *, whole_road: bool) -> float:
    """With the intake's accounts and remembered payloads, or the store alone."""
    payloads = [wire_json.encode(bench_hint(number)) for number in range(count)]
    clock = ManualClock()
    gc.collect()
    tracemalloc.start()
    store = HintStore(clock, max_hints=count, max_bytes=2**40)
    if whole_road:
        intake = Intake(store, wire_json.decode, source_rate=1e9, global_rate=1e9)
        for number, payload in enumerate(payloads):
            intake.offer(payload, f"robot-{number // 100}")
    else:
        for payload in payloads:
            announcement = wire_json.decode(payload)
            store.update(announcement.hint, source="robot")  # type: ignore[union-attr]
    del payloads
    gc.collect()
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert store.size() == count
    return size / count


def sweep_ms(fleet: int, expiring: int) -> float:
    """One sweep in which ``expiring`` hints become STALE, beside a fleet that is refreshed."""
    clock = ManualClock()
    store = HintStore(clock, max_hints=fleet + expiring, max_bytes=2**40)
    silent = [bench_hint(number) for number in range(expiring)]
    others = [bench_hint(number) for number in range(expiring, expiring + fleet)]
    for hint in silent + others:
        store.update(hint)
    for _ in range(9):
        clock.advance(S)
        for hint in others:
            store.update(hint)
    clock.advance(S)
    gc.disable()
    start = time.perf_counter_ns()
    changed = store.sweep()
    elapsed = time.perf_counter_ns() - start
    gc.enable()
    assert changed == expiring, changed
    return elapsed / 1e6


def main() -> None:
    arguments = options()
    count = 10_000 if arguments.quick else 100_000
    report = Report(f"A store of {count:,} hints of 428 bytes each")
    alone = bytes_per_hint(count, whole_road=False)
    whole = bytes_per_hint(count, whole_road=True)
    report.ratio("bytes per hint / the C++'s 1,547", alone / CPP_BYTES_PER_HINT, 1.0)
    report.ratio("  with accounts and remembered payloads", whole / CPP_BYTES_PER_HINT)
    report.line(f"  ({alone:.0f} and {whole:.0f} bytes)")
    tries = 1 if arguments.quick else 3
    few = min(sweep_ms(0, 100) for _ in range(tries))
    many = min(sweep_ms(count, 100) for _ in range(tries))
    report.ratio("sweep, 100 expiring: ms above what 100 alone cost", many - few, 1.0)
    report.line(f"  ({many:.3f} ms beside {count:,}, {few:.3f} ms alone)")
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
