"""Hints over a ROS topic into the store, against a raw callback that only counts.

    python bench/ros_topic.py [--profile]

Two processes on one machine and real DDS: one publishes at a steady rate, the other receives, by
turns with a bare reader, with rclpy's EventsExecutor and a raw callback, and with the whole
adapter. The ratio is that of the processor time of the whole receiving process per message, its DDS
threads included. Loss shows by the counts: the history holds 1,000 messages, and what comes while
it is full overwrites the oldest.
"""

from __future__ import annotations

import cProfile
import pstats
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import attrs
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.task import Future

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.outcome import ACCEPTED
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.domains import DomainLease
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.reader import Reader
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import profile as qos_profile
from beacon_ros_topic.source import RosTopicSource
from measure import Report, options

RATE = 60_000
"""What the bare callback is offered."""

STORED_RATE = 30_000
"""What must be stored without loss where the bare callback takes all of that; and half of what it
takes on a machine that is slower."""

IDLE_AT_MOST = 0.01

KINDS = ("unchanged", "changed")

PUBLISHER = """
import sys, time
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import cdr
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import profile
domain, rate, messages, changing = map(int, sys.argv[1:])
options = RosTopicOptions(domain_id=domain)
own = OwnNode("bench", domain)
message = message_type(TYPE_NAME, TYPE_HASH)
publisher = own.node.create_publisher(message, options.topic, profile(options))
one = cdr.encode(bench_hint(0))
other = one.replace(b"Engine", b"Motor_") if changing else one
while not publisher.get_subscription_count():
    time.sleep(0.01)
time.sleep(0.5)  # a connection opens at both ends, but not at the same moment
began = time.perf_counter()
for number in range(messages):
    if not number % 16:
        while number > (time.perf_counter() - began) * rate:
            time.sleep(0.0002)
    publisher.publish(other if number % 2 else one)
print(messages / (time.perf_counter() - began), flush=True)
sys.stdin.readline()
own.close()
"""


@attrs.frozen
class Result:
    cpu_us: float
    """Processor time of this process for each message."""
    rate: float
    """Messages a second, as sent."""
    lost: int


class Counter:
    """The least that a reader can be given."""

    def __init__(self) -> None:
        self.count = 0

    def on_message(self, *_: object) -> None:
        self.count += 1

    def on_matched(self, publishers: int) -> None: ...

    def on_incompatible(self, total: int) -> None: ...

    def step(self) -> float | None:
        return None

    def on_end(self, error: str) -> None: ...


@contextmanager
def bare(domain: int) -> Iterator[Callable[[], int]]:
    """Our reader, with a callback that only counts."""
    own, counter = OwnNode("bench", domain), Counter()
    chosen = RosTopicOptions(domain_id=domain)
    message = message_type(TYPE_NAME, TYPE_HASH)
    reader = Reader(own.node, message, chosen.topic, qos_profile(chosen), counter)
    reader.start()
    yield lambda: counter.count
    reader.close(1.0)
    own.close()


@contextmanager
def executor(domain: int) -> Iterator[Callable[[], int]]:
    """rclpy's fastest executor, with a raw callback that only counts."""
    own, counter = OwnNode("bench", domain), Counter()
    chosen = RosTopicOptions(domain_id=domain)

    def callback(_: bytes) -> None:
        counter.count += 1

    message = message_type(TYPE_NAME, TYPE_HASH)
    own.node.create_subscription(message, chosen.topic, callback, qos_profile(chosen), raw=True)
    spinning, stop = EventsExecutor(context=own.context), Future()
    spinning.add_node(own.node)
    # With a time-out: without one it may take a whole core and never end.
    forever: dict[str, Any] = {"timeout_sec": 1e6}
    thread = threading.Thread(
        target=spinning.spin_until_future_complete, args=(stop,), kwargs=forever
    )
    thread.start()
    yield lambda: counter.count
    stop.set_result(None)
    thread.join()
    spinning.shutdown()
    own.close()


@contextmanager
def adapter(domain: int) -> Iterator[Callable[[], int]]:
    """The source, the intake and the store."""
    intake, source = new_intake(), RosTopicSource(RosTopicOptions(domain_id=domain))
    source.start(intake)
    yield lambda: sum(intake.totals().values())
    assert not [v for v, n in intake.totals().items() if n and v not in ACCEPTED]
    source.close()


def new_intake() -> Intake:
    return Intake(HintStore(SystemClock()), cdr.decode, source_rate=1e9, global_rate=1e9)


def measured(subject: Any, rate: int, seconds: float, *, changing: bool = False) -> Result:
    """Run a publisher against the subject."""
    messages = round(rate * seconds)
    with DomainLease() as lease, subject(lease.domain_id) as heard:
        numbers = map(str, (lease.domain_id, rate, messages, int(changing)))
        with subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, "-c", PUBLISHER, *numbers],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        ) as publisher:
            assert publisher.stdout is not None
            while not heard():
                time.sleep(0.001)
            began = time.process_time()
            sent_rate = float(publisher.stdout.readline())
            last = settled(heard, messages)
            cpu_us = (time.process_time() - began) / max(1, last) * 1e6
            publisher.communicate(b"\n")
    return Result(cpu_us, sent_rate, messages - last)


def settled(heard: Callable[[], int], messages: int) -> int:
    """How many came, once all have or nothing more comes."""
    last, quiet_since = heard(), time.monotonic()
    while last < messages and time.monotonic() - quiet_since < 1.0:
        time.sleep(0.02)
        if heard() > last:
            last, quiet_since = heard(), time.monotonic()
    return heard()


def idle(seconds: float) -> float:
    """The part of a core that an open source takes when nobody speaks."""
    with DomainLease() as lease, adapter(lease.domain_id):
        time.sleep(1.0)
        began, began_cpu = time.perf_counter(), time.process_time()
        time.sleep(seconds)
        return (time.process_time() - began_cpu) / (time.perf_counter() - began)


def profile(messages: int) -> None:
    """The adapter's callback under the profiler, whose own cost is in it."""
    source, intake = RosTopicSource(RosTopicOptions()), new_intake()
    source._sink, source._offer = intake, intake.offer  # noqa: SLF001 - without ROS
    payload, gid = cdr.encode(bench_hint(0)), bytes(range(16))
    profiler = cProfile.Profile()
    profiler.enable()
    for number in range(1, messages):
        source.on_message(payload, gid, number, 0)
    profiler.disable()
    pstats.Stats(profiler).sort_stats("tottime").print_stats(14)


def main() -> None:
    arguments = options()
    rounds, seconds = (1, 0.5) if arguments.quick else (3, 4.0)
    report = Report("One hint over a ROS topic into the store / a bare reader of the same topic")
    first = [measured(bare, RATE, seconds) for _ in range(rounds)]
    taken = max(one.rate * (1 - one.lost / (RATE * seconds)) for one in first)
    stored_rate = min(STORED_RATE, round(taken / 2))
    report.line(
        f"    the bare reader takes {taken:,.0f} a second: {stored_rate:,} are to be stored"
    )
    subjects: dict[str, tuple[Any, int, bool]] = {
        "bare": (bare, RATE, False),
        "EventsExecutor": (executor, RATE, False),
        "adapter, unchanged": (adapter, stored_rate, False),
        "adapter, changed": (adapter, stored_rate, True),
        "bare at the same rate": (bare, stored_rate, False),
    }
    results: dict[str, list[Result]] = {name: [] for name in subjects}
    for _ in range(rounds):
        for name, (subject, rate, changing) in subjects.items():
            results[name].append(measured(subject, rate, seconds, changing=changing))
    best = {name: min(one.cpu_us for one in some) for name, some in results.items()}
    same = best["bare at the same rate"]
    report.ratio("unchanged", best["adapter, unchanged"] / same, 2.0)
    report.ratio("changed at each message", best["adapter, changed"] / same)
    report.ratio(
        "rclpy's EventsExecutor, raw, only counting", best["EventsExecutor"] / best["bare"]
    )
    for name, some in results.items():
        sent, lost = max(one.rate for one in some), [one.lost for one in some]
        report.line(f"    {name:24} {best[name]:6.2f} us  {sent:8,.0f} messages/s  lost {lost}")
    stored = [min(one.lost for one in results[f"adapter, {kind}"]) for kind in KINDS]
    report.ratio("messages lost of those that must be stored", max(stored), 0)
    report.ratio("of a core, when idle", idle(1.0 if arguments.quick else 10.0), IDLE_AT_MOST)
    if arguments.profile:
        profile(200_000)
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
