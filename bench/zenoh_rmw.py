"""Hints a second from nodes that run rmw_zenoh into the store, against a bare subscriber.

    python bench/zenoh_rmw.py

Two processes on the loopback interface: one is a hundred publishers, with tokens, numbers and
attachments as rmw_zenoh has them, and sends as fast as Zenoh takes it (and waits where it does not,
so nothing is lost); the other is the router and receives, by turns with the whole adapter and with
a callback that only takes the bytes. The ratio is that of the processor time which the callback's
thread takes per hint.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable

import zenoh

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_NAME
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.rmw import RmwOptions, attachment
from beacon_zenoh.rmw.keys import every_hash
from beacon_zenoh.rmw.source import RmwTopicSource
from measure import Report, best_ns, options
from zenoh_throughput import Callbacks

PUBLISHERS = 100
AT_MOST = {"unchanged": 15.0, "changed": None}
"""Twice what a hint of the native dialect may cost: each of these has a stamp, and the intake must
weigh it. Of a changed one nearly all is decoder, validator and store: see bench/intake.py."""

HINTS = every_hash(0, RmwOptions().topic, TYPE_NAME)

SENDER = """
import sys, time, zenoh
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import cdr
from beacon_zenoh import ZenohOptions
from beacon_zenoh.config import session_config
from beacon_zenoh.rmw import RmwOptions, attachment
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.qos import DEFAULT_QOS
from beacon_zenoh.rmw.session import hint_member, node_member
from beacon_zenoh.rmw.tokens import Kind, gid_of, token_key
endpoint, count, messages, changing = sys.argv[1], *map(int, sys.argv[2:])
session = zenoh.open(session_config(ZenohOptions(connect=(endpoint,)), "client").make())
node = node_member(0, str(session.zid()), 0, "bench")
members = [
    hint_member(node, Kind.PUBLISHER, n + 1, RmwOptions().topic, DEFAULT_QOS) for n in range(count)
]
keys = [token_key(one) for one in members]
tokens = [session.liveliness().declare_token(key) for key in [token_key(node), *keys]]
gids = [gid_of(key) for key in keys]
block = zenoh.CongestionControl.BLOCK
publishers = [
    session.declare_publisher(data_key(one.data_key), congestion_control=block) for one in members
]
hints = [cdr.encode(bench_hint(n)) for n in range(count)]
others = [hint.replace(b"Engine", b"Motor_") if changing else hint for hint in hints]
print("ready", flush=True)
sys.stdin.readline()
for number in range(messages):
    turn, place = divmod(number, count)
    beside = attachment.encode(gids[place], turn + 1, time.time_ns())
    publishers[place].put((others if turn % 2 else hints)[place], attachment=beside)
sys.stdin.readline()  # closing now would drop what is still in Zenoh's queues
"""


def sender(endpoint: str, messages: int, *, changing: bool) -> subprocess.Popen[bytes]:
    """A process that sends when it is told to."""
    numbers = (str(PUBLISHERS), str(messages), str(int(changing)))
    process = subprocess.Popen(  # noqa: S603 - ourselves
        [sys.executable, "-c", SENDER, endpoint, *numbers],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    return process


def measured(
    callbacks: Callbacks, endpoint: str, messages: int, heard: Callable[[], int], *, changing: bool
) -> tuple[float, float]:
    """Processor nanoseconds per hint, and hints a second."""
    process = sender(endpoint, messages, changing=changing)
    time.sleep(0.3)  # the tokens are known
    cpu_ns = callbacks.cpu_ns()
    assert process.stdin is not None
    process.stdin.write(b"\n")
    process.stdin.flush()
    while not heard():
        time.sleep(0.0001)
    began_ns, deadline = time.perf_counter_ns(), time.monotonic() + 120
    while heard() < messages:
        time.sleep(0.002)
        assert time.monotonic() < deadline, f"{heard()} of {messages} came"
    wall_ns, cpu_ns = time.perf_counter_ns() - began_ns, callbacks.cpu_ns() - cpu_ns
    process.kill()
    process.communicate()
    return cpu_ns / messages, messages / wall_ns * 1e9


def bare(messages: int, *, changing: bool) -> tuple[float, float]:
    """A callback that only calls ``to_bytes``."""
    endpoint, callbacks, count = free_endpoint(), Callbacks(), 0
    config = session_config(ZenohOptions(listen=(endpoint,)), "router")

    def callback(sample: zenoh.Sample) -> None:
        nonlocal count
        sample.payload.to_bytes()
        count += 1

    with zenoh.open(config.make()) as session:
        session.declare_subscriber(HINTS, callback)
        return measured(callbacks, endpoint, messages, lambda: count, changing=changing)


def adapter(messages: int, *, changing: bool) -> tuple[float, float]:
    """The source, the intake and the store."""
    endpoint, callbacks, intake = free_endpoint(), Callbacks(), new_intake()
    source = RmwTopicSource(RmwOptions(mode="router", listen=(endpoint,)))
    source.start(intake)
    useful = (Verdict.NEW, Verdict.CHANGED if changing else Verdict.REFRESHED)

    def heard() -> int:
        totals = intake.totals()
        return sum(totals[verdict] for verdict in useful)

    result = measured(callbacks, endpoint, messages, heard, changing=changing)
    source.close()
    return result


def new_intake() -> Intake:
    return Intake(HintStore(SystemClock()), cdr.decode, source_rate=1e9, global_rate=1e9)


def stages(report: Report) -> None:
    """Where the adapter's own time goes, each stage alone, with a message of Zenoh's."""
    samples: list[zenoh.Sample] = []
    payload, gid = cdr.encode(bench_hint(0)), bytes(range(16))
    config = session_config(ZenohOptions(listen=("tcp/127.0.0.1:0",)), "router")
    with zenoh.open(config.make()) as session:
        session.declare_subscriber("**", samples.append)
        session.put(HINTS.replace("*", "h"), payload, attachment=attachment.encode(gid, 1, 1))
        while not samples:
            time.sleep(0.001)
    sample, intake, name = samples[0], new_intake(), gid.hex()
    rounds = 20_000
    numbers = iter(range(1, 10**9))

    def repeat(stage: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            for _ in range(rounds):
                stage()

        return run

    def offer() -> None:
        stamp_ns = time.time_ns()
        intake.offer(payload, name, stamp_ns=stamp_ns, incarnation=name, sequence=next(numbers))

    best = best_ns(
        {
            "nothing": repeat(lambda: None),
            "attachment": repeat(lambda: attachment.decode(sample.attachment.to_bytes())),  # type: ignore[union-attr]
            "payload": repeat(lambda: sample.payload.to_bytes()),  # noqa: PLW0108 - a new one each time
            "intake and store, unchanged": repeat(offer),
        },
        rounds=10,
    )
    nothing = best.pop("nothing")
    report.line("\nwhere the adapter's time goes, each stage alone, in us:")
    for stage, total in best.items():
        report.line(f"  {stage:40} {(total - nothing) / rounds / 1000:6.2f}")


def main() -> None:
    arguments = options()
    rounds, messages = (1, 20_000) if arguments.quick else (5, 200_000)
    report = Report("One hint over rmw_zenoh into the store / a bare callback's to_bytes()")
    for changing, name in ((False, "unchanged"), (True, "changed")):
        costs: dict[str, list[tuple[float, float]]] = {"bare": [], "adapter": []}
        for _ in range(rounds):
            costs["bare"].append(bare(messages, changing=changing))
            costs["adapter"].append(adapter(messages, changing=changing))
        best = {who: min(cost for cost, _ in results) for who, results in costs.items()}
        rate = {who: max(rate for _, rate in results) for who, results in costs.items()}
        report.ratio(name, best["adapter"] / best["bare"], AT_MOST[name])
        for who in costs:
            report.line(f"    {who:8} {best[who] / 1000:6.2f} us  {rate[who]:10,.0f} hints/s")
    stages(report)
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
