"""Asking 200 real ROS nodes for their parameters: all at once or one by one, and when some hang.

    python bench/ros_param_poll.py [--quick]

The nodes are ordinary ones, with rclpy's own executor, in four processes on this machine. First the
same source asks them with its usual cap and with a cap of one, by turns; compared is how long a
cycle takes. Then the process that has 60 of them is stopped (SIGSTOP), and for each of the others
the longest time between two answers is noted, beginning before the stop. At last the source is
closed while requests to stopped nodes are under way.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

import attrs

from beacon_core.outcome import Outcome, Verdict
from beacon_ros.domains import DomainLease
from beacon_ros_param.options import RosParamOptions
from beacon_ros_param.source import RosParamSource
from measure import Report, options

SERVERS = (60, 50, 45, 45)
"""Nodes in each process; those of the first will hang."""

QUICK_SERVERS = (6, 5, 5, 4)

INTERVAL_S = 1.0
TIMEOUT_S = 1.0

THOROUGH = (3, 4, 15.0)
"""Rounds; cycles in each, of which the shortest counts, for it was disturbed least; and how long to
watch while some hang: less than the 20 s after which they are gone from the graph."""

QUICK = (1, 2, 4.0)

RATIO = 0.25
CLOSE_WITHIN_S = 1.0

SERVER = """
import sys, threading
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from beacon_core.testing.examples import bench_hint
from beacon_ros_param.beacon import declare_beacon
domain, first, count = map(int, sys.argv[1:])
context = Context()
context.init(args=[], initialize_logging=False, domain_id=domain)
executor = SingleThreadedExecutor(context=context)
for number in range(first, first + count):
    node = Node(f"bench_{number}", context=context, use_global_arguments=False)
    declare_beacon(node, bench_hint(number))
    executor.add_node(node)
print("ready", flush=True)
executor.spin()
"""


@attrs.frozen
class Heard:
    """A sink that notes when it heard of whom."""

    times: dict[str, list[float]] = attrs.field(factory=lambda: defaultdict(list))

    def offer(
        self,
        payload: bytes,  # noqa: ARG002
        source: str,
        *,
        entity_id: str = "",  # noqa: ARG002
        stamp_ns: int = 0,  # noqa: ARG002
        incarnation: str = "",  # noqa: ARG002
        sequence: int = 0,  # noqa: ARG002
    ) -> Outcome:
        self.times[source].append(time.monotonic())
        return Outcome(Verdict.REFRESHED)

    def goodbye(
        self,
        entity_id: str,
        source: str,  # noqa: ARG002
        *,
        incarnation: str = "",  # noqa: ARG002
        sequence: int = 0,  # noqa: ARG002
    ) -> Outcome:
        return Outcome(Verdict.UNKNOWN, entity_id)

    def lost(
        self,
        entity_id: str,
        source: str,  # noqa: ARG002
        *,
        incarnation: str = "",  # noqa: ARG002
        reason: str = "",  # noqa: ARG002
    ) -> Outcome:
        return Outcome(Verdict.UNKNOWN, entity_id)

    def longest_gap_s(self, nodes: Sequence[str], since_s: float, until_s: float) -> float:
        """Of the worst of these; who was not heard at all counts with the whole time."""
        longest = 0.0
        for node in nodes:
            between = [one for one in self.times[node] if since_s <= one <= until_s]
            moments = [since_s, *between, until_s]
            longest = max(longest, *(b - a for a, b in pairwise(moments)))
        return longest


@contextmanager
def servers(domain_id: int, counts: Sequence[int]) -> Iterator[list[subprocess.Popen[str]]]:
    """So many nodes in each process, all of them ready."""
    started: list[subprocess.Popen[str]] = []
    for number, count in enumerate(counts):
        arguments = map(str, (domain_id, sum(counts[:number]), count))
        started.append(
            subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", SERVER, *arguments], stdout=subprocess.PIPE, text=True
            )
        )
    try:
        for process in started:
            assert process.stdout is not None
            process.stdout.readline()
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


@contextmanager
def asking(domain_id: int, nodes: int, cap: int) -> Iterator[tuple[RosParamSource, Heard]]:
    """A source that has heard all of them."""
    chosen = RosParamOptions(
        domain_id=domain_id, interval_s=INTERVAL_S, timeout_s=TIMEOUT_S, max_in_flight=cap
    )
    source, heard = RosParamSource(chosen), Heard()
    source.start(heard)
    try:
        wait_for(lambda: len(heard.times) == nodes)
        yield source, heard
    finally:
        source.close()


def shortest_cycle(domain_id: int, nodes: int, cap: int, cycles: int) -> tuple[float, float]:
    """How long it took, and how much time of this process's (both in ms)."""
    with asking(domain_id, nodes, cap) as (source, _):
        lengths = []
        began, cpu = time.monotonic(), time.process_time()
        for number in range(1, cycles + 1):
            # Looked at in the middle of the pause after each cycle.
            time.sleep(max(0.0, began + (number + 0.5) * INTERVAL_S - time.monotonic()))
            lengths.append(source.health().counters["cycle-us"] / 1000)
        return min(lengths), (time.process_time() - cpu) * 1000 / (cycles + 0.5)


def wait_for(true: Callable[[], bool], within_s: float = 60.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, "it takes too long"
        time.sleep(0.002)


def measure_cycles(report: Report, domain_id: int, nodes: int, *, rounds: int, cycles: int) -> None:
    at_once = one_by_one = cpu = float("inf")
    for _ in range(rounds):
        length, spent = shortest_cycle(domain_id, nodes, 128, cycles)
        at_once, cpu = min(at_once, length), min(cpu, spent)
        one_by_one = min(one_by_one, shortest_cycle(domain_id, nodes, 1, cycles)[0])
    report.ratio("a cycle, all at once / one after another", at_once / one_by_one, RATIO)
    report.line(f"  {at_once:.0f} ms / {one_by_one:.0f} ms, of {nodes} nodes")
    report.line(f"  time of the asking process for one cycle and its pause: {cpu:.0f} ms")


def measure_hung(
    report: Report,
    domain_id: int,
    counts: Sequence[int],
    processes: Sequence[subprocess.Popen[str]],
    watch_s: float,
) -> None:
    live = [f"/bench_{number}" for number in range(counts[0], sum(counts))]
    with asking(domain_id, sum(counts), 128) as (source, heard):
        began = time.monotonic()
        time.sleep(INTERVAL_S / 2)
        processes[0].send_signal(signal.SIGSTOP)
        time.sleep(watch_s)
        gap_s = heard.longest_gap_s(live, began, time.monotonic())
        allowed_s = INTERVAL_S + TIMEOUT_S
        report.ratio("longest gap of a live node / (interval + time-out)", gap_s / allowed_s, 1.0)
        hung = source.health().counters
        report.line(f"  {gap_s:.2f} s, with {hung['silent']} of {sum(counts)} nodes hung")
        wait_for(lambda: source.health().counters["in-flight"] > 0)
        closing = time.monotonic()
        source.close()
        took_s = time.monotonic() - closing
        report.ratio("close() while nodes hang / 1 s", took_s / CLOSE_WITHIN_S, 1.0)


def main() -> None:
    arguments = options()
    counts = QUICK_SERVERS if arguments.quick else SERVERS
    report = Report(f"{sum(counts)} nodes in {len(counts)} processes, asked over ROS 2")
    with DomainLease() as lease, servers(lease.domain_id, counts) as processes:
        rounds, cycles, watch_s = QUICK if arguments.quick else THOROUGH
        measure_cycles(report, lease.domain_id, sum(counts), rounds=rounds, cycles=cycles)
        measure_hung(report, lease.domain_id, counts, processes, watch_s)
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
