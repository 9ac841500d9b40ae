"""Asking 200 nodes of rmw_zenoh for their parameters with Zenoh: all at once or one by one.

    python bench/zenoh_rmw_param.py [--quick]

The nodes are those of our announcer, in four processes; this process is the router and asks, by
turns with its usual cap and with a cap of one. Compared is how long a cycle takes; told are also
the processor time that this process takes for one, the router's part included, and how long it
takes from the start of a source until it has heard of all.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zenoh

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.store import HintStore
from beacon_core.wire import json
from beacon_zenoh.harness import open_router
from beacon_zenoh.rmw_param import RmwParamOptions
from beacon_zenoh.rmw_param.source import RmwParamSource
from measure import Report, options

PROCESSES = 4
NODES, QUICK_NODES = 200, 20
INTERVAL_S = 1.0

THOROUGH, QUICK = (3, 4), (1, 2)
"""Rounds; cycles in each, of which the shortest counts, for it was disturbed least."""


SERVER = """
import sys
from beacon_core.testing.examples import bench_hint
from beacon_zenoh.rmw_param import RmwParamOptions
from beacon_zenoh.rmw_param.announcer import RmwParamAnnouncer
endpoint, first, count = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
announcer = RmwParamAnnouncer(RmwParamOptions(connect=(endpoint,)))
for number in range(first, first + count):
    announcer.announce(bench_hint(number))
print("ready", flush=True)
sys.stdin.read()
announcer.close()
"""


@contextmanager
def servers(endpoint: str, nodes: int) -> Iterator[None]:
    """So many nodes in all, in several processes."""
    each = nodes // PROCESSES
    started = []
    for number in range(PROCESSES):
        arguments = (endpoint, str(number * each), str(each))
        command = [sys.executable, "-c", SERVER, *arguments]
        started.append(
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603
        )
    try:
        for process in started:
            assert process.stdout is not None
            process.stdout.readline()
        yield
    finally:
        for process in started:
            process.communicate()


def cycle_ms(endpoint: str, nodes: int, cap: int, cycles: int) -> tuple[float, float, float]:
    """The shortest cycle, this process's time for one, and how long until all were heard."""
    source = RmwParamSource(
        RmwParamOptions(connect=(endpoint,), interval_s=INTERVAL_S, max_in_flight=cap)
    )
    store = HintStore(SystemClock(), ttl_s=60.0)
    began = time.monotonic()
    source.start(Intake(store, json.decode, source_rate=1e6, global_rate=1e6))
    try:
        wait_for(lambda: store.size() == nodes)
        all_heard_ms = (time.monotonic() - began) * 1000
        lengths = []
        began, cpu = time.monotonic(), time.process_time()
        for number in range(1, cycles + 1):
            # Looked at in the middle of the pause after each cycle.
            time.sleep(max(0.0, began + (number + 0.5) * INTERVAL_S - time.monotonic()))
            lengths.append(source.health().counters["cycle-us"] / 1000)
        spent = (time.process_time() - cpu) * 1000 / (cycles + 0.5)
        return min(lengths), spent, all_heard_ms
    finally:
        source.close()


def wait_for(true: Callable[[], bool], within_s: float = 60.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, "it takes too long"
        time.sleep(0.002)


def measure(report: Report, endpoint: str, nodes: int, *, rounds: int, cycles: int) -> None:
    at_once = one_by_one = cpu = all_heard = float("inf")
    for _ in range(rounds):
        length, spent, heard = cycle_ms(endpoint, nodes, 128, cycles)
        at_once, cpu, all_heard = min(at_once, length), min(cpu, spent), min(all_heard, heard)
        one_by_one = min(one_by_one, cycle_ms(endpoint, nodes, 1, cycles)[0])
    report.ratio("a cycle, all at once / one after another", at_once / one_by_one)
    report.line(f"  {at_once:.0f} ms / {one_by_one:.0f} ms, of {nodes} nodes")
    report.line(f"  time of router and asking process for one cycle and its pause: {cpu:.0f} ms")
    report.line(f"  from the start of a source until it has heard of all: {all_heard:.0f} ms")


def main() -> None:
    given = options()
    rounds, cycles = QUICK if given.quick else THOROUGH
    report = Report("parameters over rmw_zenoh")
    router, endpoint = open_router()
    with servers(endpoint, QUICK_NODES if given.quick else NODES):
        measure(
            report,
            endpoint,
            QUICK_NODES if given.quick else NODES,
            rounds=rounds,
            cycles=cycles,
        )
    close(router)
    report.finish(check=given.check)


def close(session: zenoh.Session) -> None:
    session.close()  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
