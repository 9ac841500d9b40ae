"""Hints a second over Zenoh into the store, against a callback that only takes the bytes.

    python bench/zenoh_throughput.py [--profile]

Two processes on the loopback interface: one sends as fast as Zenoh takes it (and waits where it
does not, so nothing is lost), the other is the router and receives, by turns with the whole adapter
and with the bare callback. The ratio is that of the processor time which the callback's thread
takes per hint: hints a second are shown too, but of the bare callback the sender limits them.
"""

from __future__ import annotations

import cProfile
import pstats
import subprocess
import sys
import threading
import time
from collections.abc import Callable

import zenoh

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json as wire_json
from beacon_zenoh import ZenohOptions, wire
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.keys import Keys
from beacon_zenoh.source import ZenohSource
from measure import Report, best_ns, options

ENTITIES = 100
AT_MOST = {"unchanged": 8.0, "changed": None}
"""Of a changed hint nearly all is the decoder, the validator and the store: see bench/intake.py."""

KEYS = Keys("beacon")

SENDER = """
import sys, zenoh
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json
from beacon_zenoh import ZenohOptions, wire
from beacon_zenoh.config import session_config
endpoint, entities, messages, changing = sys.argv[1], *map(int, sys.argv[2:])
session = zenoh.open(session_config(ZenohOptions(connect=(endpoint,)), "client").make())
block = zenoh.CongestionControl.BLOCK
keys = [f"beacon/hint/{bench_hint(n).entity_id}" for n in range(entities)]
publishers = [session.declare_publisher(key, congestion_control=block) for key in keys]
hints = [json.encode(bench_hint(n)) for n in range(entities)]
others = [hint.replace(b"Engine", b"Motor_") if changing else hint for hint in hints]
attachments = [wire.encode("bench-run", n + 1, 0) for n in range(messages)]
print("ready", flush=True)
sys.stdin.readline()
for number, attachment in enumerate(attachments):
    turn, place = divmod(number, entities)
    publishers[place].put((others if turn % 2 else hints)[place], attachment=attachment)
sys.stdin.readline()  # closing now would drop what is still in Zenoh's queues
"""


class Sender:
    """A process that sends when told to, and then ends."""

    def __init__(self, endpoint: str, messages: int, *, changing: bool) -> None:
        numbers = (str(ENTITIES), str(messages), str(int(changing)))
        self.process = subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-c", SENDER, endpoint, *numbers],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == b"ready\n"

    def go(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


class Callbacks:
    """The processor time of Zenoh's callback threads, which is read from outside.

    Only theirs: Zenoh's own threads burn some more while they wait for a slower callback.
    """

    def __init__(self) -> None:
        self.before = set(threading.enumerate())

    def cpu_ns(self) -> int:
        new = set(threading.enumerate()) - self.before
        idents = [one.ident for one in new if "pyo3" in one.name and one.ident]
        return sum(time.clock_gettime_ns(time.pthread_getcpuclockid(one)) for one in idents)


def measured(
    callbacks: Callbacks, endpoint: str, messages: int, heard: Callable[[], int], *, changing: bool
) -> tuple[float, float]:
    """Processor nanoseconds per hint, and hints a second."""
    sender = Sender(endpoint, messages, changing=changing)
    cpu_ns = callbacks.cpu_ns()
    sender.go()
    while not heard():
        time.sleep(0.0001)
    began_ns, deadline = time.perf_counter_ns(), time.monotonic() + 120
    while heard() < messages:
        time.sleep(0.002)
        assert time.monotonic() < deadline, f"{heard()} of {messages} came"
    wall_ns, cpu_ns = time.perf_counter_ns() - began_ns, callbacks.cpu_ns() - cpu_ns
    sender.end()
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
        session.declare_subscriber(KEYS.hints, callback)
        return measured(callbacks, endpoint, messages, lambda: count, changing=changing)


def adapter(messages: int, *, changing: bool) -> tuple[float, float]:
    """The source, the intake and the store."""
    endpoint, callbacks, intake = free_endpoint(), Callbacks(), new_intake()
    source = ZenohSource(ZenohOptions(listen=(endpoint,)))
    source.start(intake)
    useful = (Verdict.NEW, Verdict.CHANGED if changing else Verdict.REFRESHED)

    def heard() -> int:
        totals = intake.totals()
        return sum(totals[verdict] for verdict in useful)

    result = measured(callbacks, endpoint, messages, heard, changing=changing)
    source.close()
    return result


def new_intake() -> Intake:
    return Intake(HintStore(SystemClock()), wire_json.decode, source_rate=1e9, global_rate=1e9)


def stages(report: Report) -> None:
    """Where the adapter's own time goes, each stage alone, with a message of Zenoh's."""
    samples: list[zenoh.Sample] = []
    payload = wire_json.encode(bench_hint(0))
    config = session_config(ZenohOptions(listen=("tcp/127.0.0.1:0",)), "router")
    with zenoh.open(config.make()) as session:
        session.declare_subscriber("**", samples.append)
        key = KEYS.hint(bench_hint(0).entity_id)
        session.put(key, payload, attachment=wire.encode("bench-run", 1, 1))
        while not samples:
            time.sleep(0.001)
    sample, intake = samples[0], new_intake()
    entity_id = KEYS.entity_of(key)
    rounds = 20_000
    numbers = iter(range(1, 10**9))

    def repeat(stage: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            for _ in range(rounds):
                stage()

        return run

    def offer() -> None:
        intake.offer(
            payload,
            entity_id,
            entity_id=entity_id,
            stamp_ns=0,
            incarnation="bench-run",
            sequence=next(numbers),
        )

    best = best_ns(
        {
            "nothing": repeat(lambda: None),
            "key": repeat(lambda: KEYS.entity_of(str(sample.key_expr))),
            "attachment": repeat(lambda: wire.decode(sample.attachment.to_bytes())),  # type: ignore[union-attr]
            "payload": repeat(lambda: sample.payload.to_bytes()),  # noqa: PLW0108 - a new one each time
            "intake and store, unchanged": repeat(offer),
        },
        rounds=10,
    )
    nothing = best.pop("nothing")
    report.line("\nwhere the adapter's time goes, each stage alone, in us:")
    for name, total in best.items():
        report.line(f"  {name:40} {(total - nothing) / rounds / 1000:6.2f}")


def profile(messages: int) -> None:
    """The adapter's callback under the profiler, whose own cost is in it."""
    samples: list[zenoh.Sample] = []
    endpoint = free_endpoint()
    config = session_config(ZenohOptions(listen=(endpoint,)), "router")
    with zenoh.open(config.make()) as session:
        session.declare_subscriber(KEYS.hints, samples.append)
        measured(Callbacks(), endpoint, messages, lambda: len(samples), changing=False)
    source = ZenohSource(ZenohOptions())
    give(source, new_intake())
    profiler = cProfile.Profile()
    profiler.enable()
    for sample in samples:
        source._on_hint(sample)  # noqa: SLF001
    profiler.disable()
    pstats.Stats(profiler).sort_stats("tottime").print_stats(16)


def give(source: ZenohSource, intake: Intake) -> None:
    """A sink, without a session: the callback is called by hand."""
    source._sink, source._offer = intake, intake.offer  # noqa: SLF001


def main() -> None:
    arguments = options()
    rounds, messages = (1, 20_000) if arguments.quick else (5, 200_000)
    report = Report("One hint over Zenoh into the store / a bare callback's to_bytes()")
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
    if arguments.profile:
        profile(messages // 4)
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
