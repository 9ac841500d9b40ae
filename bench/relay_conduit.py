"""The relay over Zenoh against bare Zenoh; and what becomes of it when the far side is frozen.

    python bench/relay_conduit.py [--quick] [--check]

Two processes on the loopback interface, over TCP, shared memory off. One sends as fast as the
other takes it, with a bounded number under way: so little is dropped, and what is measured is what
a message costs. The rounds of all subjects take turns. Bare Zenoh is our session's configuration,
a publisher that drops, 48 bytes beside the payload, and a callback that takes both as bytes, called
by Zenoh (``bare``). The targets are against that. Through the binding's own queue
(``bare queued``), which for 1 MiB holds 256 MB, small messages are faster: for information.

And 256 bytes at 1 kHz, for the time that each takes.

Then 100 KB at 200 Hz, while the far side is stopped for 14 s: everything must arrive once and in
order if the forwarder may hold it, and else what is lost must be what the books say.
"""

from __future__ import annotations

import itertools
import json
import mmap
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import zenoh
from zenoh.handlers import Callback

from beacon_core.clock import SystemClock
from beacon_core.ports.conduit import Conduit
from beacon_core.ports.topic_side import TopicWatcher
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import content_header
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.republishing import RepublisherStats
from beacon_core.relay.settings import Forwarding
from beacon_core.relay.values import Mode, Qos, TopicType
from beacon_gateway.relay.end import End
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.relay import CONDUIT, RelayOptions
from measure import Report, options

SIZES = {64: (5, 100_000), 1024: (5, 100_000), 65_536: (5, 10_000), 1_048_576: (31, 1_000)}
"""Rounds and messages a round, by payload. Of 1 MiB runs of one and the same subject differ by a
quarter on two cores, which they fill."""
AT_LEAST = {64: 0.60, 1024: 0.60, 65_536: 0.75, 1_048_576: 0.90}
WINDOW_BYTES, WINDOW_MESSAGES = 16 * 1024 * 1024, 2000
LARGE_BYTES = 65_536
SUBJECTS = ("bare", "bare queued", "conduit", "relay")
MB = 1_000_000
MIB = 1024 * 1024
SOME_HEADERS = [content_header(7, 1, 1, seq, 0, 7, 0) for seq in range(4096)]
KEY = "bench/relay"
PACED_BYTES = 256
"""Messages of this size are sent at 1 kHz, and timed."""
ADDED_AT_MOST_MS = 0.1

Send = Callable[[bytes, bytes], object]


class Feeding:
    """A topic side with one topic, which the bench feeds."""

    def __init__(self) -> None:
        self.handle = 0
        self.watcher: TopicWatcher | None = None

    def start(self, watcher: TopicWatcher) -> None:
        self.watcher = watcher
        kind = TopicType("sensor_msgs/msg/Image", "RIHS01_1")
        watcher.topic_seen("/camera", SeenTopic(kind, Qos()))

    def subscribe(self, what: Subscribe) -> None:
        self.handle = what.handle

    def unsubscribe(self, handle: int) -> None: ...

    def create_publisher(self, what: CreatePublisher) -> None: ...

    def publish(self, what: Publish) -> None: ...

    def destroy_publisher(self, handle: int) -> None: ...

    def close(self) -> None: ...


class Taking(Feeding):
    """A topic side with no topics of its own, and a subscription to whatever is published."""

    def __init__(self, taken: Callable[[bytes], object]) -> None:
        super().__init__()
        self.taken = taken

    def start(self, watcher: TopicWatcher) -> None:
        self.watcher = watcher

    def create_publisher(self, what: CreatePublisher) -> None:
        assert self.watcher is not None
        self.watcher.matched(what.handle, 1, 1)

    def publish(self, what: Publish) -> None:
        self.taken(what.payload)


class Counting:
    """A frame sink, and a callback of Zenoh's, that counts where the other process sees it."""

    def __init__(self, seen: memoryview) -> None:
        self.count, self.first_ns, self.last_ns, self.cpu_ns = 0, 0, 0, 0
        self.late_ns: list[int] = []
        self.up = False
        self._seen = seen

    def frame(self, _: bytes, payload: bytes) -> None:
        self.taken(payload)

    def link(self, *, up: bool) -> None:
        self.up = up

    def sample(self, sample: zenoh.Sample) -> None:
        attachment = sample.attachment
        assert attachment is not None
        attachment.to_bytes()
        self.taken(sample.payload.to_bytes())

    def taken(self, payload: bytes) -> None:
        self.last_ns = time.perf_counter_ns()
        if len(payload) == PACED_BYTES:
            self.late_ns.append(self.last_ns - int.from_bytes(payload[:8], "little"))
        if not self.count:
            self.first_ns, self.cpu_ns = self.last_ns, time.process_time_ns()
        self.count += 1
        self._seen[0] = self.count


def conduit(*, listen: str = "", connect: str = "") -> Conduit:
    """One end of it."""
    there = RelayOptions(listen=(listen,)) if listen else RelayOptions(connect=(connect,))
    return CONDUIT.conduit(there)


def forwarding(side: Feeding, there: Conduit, hold_bytes: int) -> End:
    names = NameMap((Rule(allow=True, pattern="/**", mode=Mode.ORDERED),))
    settings = Forwarding(hold_bytes=hold_bytes)
    now_ns = time.monotonic_ns()
    core = Forwarder(origin=7, epoch=1, names=names, now_ns=now_ns, settings=settings)
    return End("forwarding", side, there, SystemClock(), forwarder=core)


def republishing(side: Taking, there: Conduit) -> End:
    core = Republisher(asker=9, now_ns=time.monotonic_ns())
    return End("republishing", side, there, SystemClock(), republisher=core)


def bare_session(options: RelayOptions, mode: Any) -> zenoh.Session:
    """With what the conduit gives Zenoh."""
    from beacon_zenoh.relay.conduit import DEFAULTS  # noqa: PLC0415 - beside what is bare

    return zenoh.open(session_config(options, mode, DEFAULTS).make())


def shared(path: str) -> memoryview:
    """A number that both processes see."""
    with Path(path).open("r+b") as file:
        return memoryview(mmap.mmap(file.fileno(), 8)).cast("Q")


# -- the process that sends


def sender(subject: str, endpoint: str, path: str, size: int, count: int) -> None:
    """Say when it can begin, wait for a line, send, say how it went, and wait for the end."""
    seen = shared(path)
    send, close = sending(subject, endpoint)
    print("ready", flush=True)
    sys.stdin.readline()
    began_ns = time.process_time_ns()
    if size == PACED_BYTES:
        pace(send, count)
    else:
        feed(send, bytes(size), count, seen)
    print(json.dumps({"cpu_us": (time.process_time_ns() - began_ns) / 1000}), flush=True)
    sys.stdin.readline()
    close()


def sending(subject: str, endpoint: str) -> tuple[Send, Callable[[], object]]:
    if subject.startswith("bare"):
        session = bare_session(RelayOptions(connect=(endpoint,)), "client")
        publisher = session.declare_publisher(KEY, congestion_control=zenoh.CongestionControl.DROP)
        wait_for(lambda: matching(publisher))
        return (
            lambda header, payload: publisher.put(payload, attachment=header),
            session.close,
        )
    there = conduit(connect=endpoint)
    if subject == "conduit":
        sink = Counting(memoryview(bytearray(8)).cast("Q"))
        there.start(sink)
        wait_for(lambda: sink.up)
        return there.send, there.close
    side = Feeding()
    end = forwarding(side, there, 64 * MIB)
    end.start()
    wait_for(lambda: end.state().linked and side.handle > 0)
    watcher, handle = side.watcher, side.handle
    assert watcher is not None
    return lambda _, payload: watcher.message(handle, payload), end.close


def matching(publisher: Any) -> bool:
    """Does anybody listen? (The stub of ``matching_status`` has another type.)"""
    return bool(publisher.matching_status.matching)


def feed(send: Send, payload: bytes, count: int, seen: memoryview) -> None:
    """Send, with a bounded number under way. What does not come within 1 s is given up."""
    most = max(4, min(WINDOW_MESSAGES, WINDOW_BYTES // len(payload)))
    gave_up = 0
    for number in range(count):
        if number - gave_up - seen[0] >= most:
            # To look more often would take from the processor what is measured.
            pause_s = 0.0005 if len(payload) >= LARGE_BYTES else 0.00005
            gave_up += room(seen, number - gave_up, most, pause_s)
        send(SOME_HEADERS[number % 4096], payload)


def pace(send: Send, count: int) -> None:
    """Send at 1 kHz, each with the time at which it is sent."""
    filler, began = bytes(PACED_BYTES - 8), time.perf_counter_ns()
    for number in range(count):
        while (left_ns := began + number * 1_000_000 - time.perf_counter_ns()) > 0:
            time.sleep(left_ns / 1e9)
        payload = time.perf_counter_ns().to_bytes(8, "little") + filler
        send(SOME_HEADERS[number % 4096], payload)


def room(seen: memoryview, sent: int, most: int, pause_s: float) -> int:
    """Wait until there is room for half of what may be under way, or nothing comes any more."""
    last, since = seen[0], time.monotonic()
    while sent - seen[0] > most // 2:
        time.sleep(pause_s)
        if seen[0] != last:
            last, since = seen[0], time.monotonic()
        elif time.monotonic() - since > 1.0:
            return int(sent - last)
    return 0


# -- the process that receives, and measures


@attrs.frozen
class Run:
    """One round of one subject."""

    rate: float
    """Messages a second."""
    lost: int
    cpu_us: tuple[float, float]
    """Processor time a message, of the process that sends and of the one that receives, with all
    of Zenoh's threads. On a machine that does other things it says more than the rate."""
    late_us: float
    """The median from sending to receiving, of what is paced."""


def measured(subject: str, size: int, count: int) -> Run:
    endpoint = free_endpoint()
    with tempfile.NamedTemporaryFile() as file:
        file.write(bytes(8))
        file.flush()
        counting = Counting(shared(file.name))
        close = receiving(subject, endpoint, counting)
        arguments = ("sender", subject, endpoint, file.name, str(size), str(count))
        with child(*arguments) as other:
            assert answer(other) == "ready"
            tell(other)
            sent: dict[str, float] = json.loads(answer(other))
            wait_for(lambda: quiet(counting, count))
            took_us = (time.process_time_ns() - counting.cpu_ns) / 1000
            tell(other)
            other.wait()
        close()
    took_s = (counting.last_ns - counting.first_ns) / 1e9
    rate = (counting.count - 1) / took_s
    late_us = statistics.median(counting.late_ns) / 1000 if counting.late_ns else 0.0
    return Run(rate, count - counting.count, (sent["cpu_us"] / count, took_us / count), late_us)


def receiving(subject: str, endpoint: str, counting: Counting) -> Callable[[], object]:
    if subject.startswith("bare"):
        session = bare_session(RelayOptions(listen=(endpoint,)), "router")
        session.declare_subscriber(
            KEY, Callback(counting.sample, indirect=subject == "bare queued")
        )
        return session.close
    there = conduit(listen=endpoint)
    if subject == "conduit":
        there.start(counting)
        return there.close
    end = republishing(Taking(counting.taken), there)
    end.start()
    return end.close


def quiet(counting: Counting, count: int) -> bool:
    """All has come, or nothing comes any more."""
    since_ns = time.perf_counter_ns() - counting.last_ns
    return counting.count >= count or since_ns > 3e9


# -- frozen


def frozen(seconds: float, hold_bytes: int) -> dict[str, float]:
    """The far side is stopped for so long, at 100 KB and 200 Hz."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    endpoint, side = free_endpoint(), Feeding()
    end = forwarding(side, conduit(listen=endpoint), hold_bytes)
    end.start()
    sent, worst_s = 0, 0.0
    with child("far", endpoint) as far:
        assert answer(far) == "ready"
        wait_for(lambda: end.state().linked)
        assert side.watcher is not None
        filler = bytes(100_000 - 8)
        began = time.monotonic()
        stop_at, go_at, done_at = 1.0, 1.0 + seconds, 2.0 + seconds
        stopped = going = False
        while (now := time.monotonic() - began) < done_at:
            if now > stop_at and not stopped:
                far.send_signal(signal.SIGSTOP)
                stopped = True
            if now > go_at and not going:
                far.send_signal(signal.SIGCONT)
                going = True
            payload = sent.to_bytes(8, "little") + filler
            before = time.monotonic()
            side.watcher.message(side.handle, payload)
            worst_s = max(worst_s, time.monotonic() - before)
            sent += 1
            time.sleep(max(0.0, began + sent / 200 - time.monotonic()))
        tell(far)
        result: dict[str, float] = json.loads(answer(far))
        far.wait()
    state = end.state()
    assert state.forwarder is not None
    books = state.forwarder
    assert books.entered == sent == books.held + sum(books.fates.values())
    end.close()
    return result | {
        "sent": sent,
        "lost": sent - result["came"],
        "worst send, ms": round(worst_s * 1000),
        "sender's RSS, MB": peak_mb(),
    }


def far(endpoint: str) -> None:
    """The far side: notes what comes, and in which order."""
    came: list[int] = []
    end = republishing(
        Taking(lambda payload: came.append(int.from_bytes(payload[:8], "little"))),
        conduit(connect=endpoint),
    )
    end.start()

    def books() -> RepublisherStats:
        stats = end.state().republisher
        assert stats is not None
        return stats

    # What was sent before it has joined is not for it.
    wait_for(lambda: books().routes > 0)
    print("ready", flush=True)
    sys.stdin.readline()
    time.sleep(1.5)  # a digest, which says what there is
    wait_for(lambda: books().held + books().missing == 0)
    stats = books()
    fates = {str(fate): count for fate, count in stats.fates.items()}
    result = {
        "came": len(came),
        "again": len(came) - len(set(came)),
        "out of order": sum(b < a for a, b in itertools.pairwise(came)),
        "counted as lost": sum(fates.values()) - fates.get("delivered", 0),
        "receiver's RSS, MB": peak_mb(),
    }
    print(json.dumps(result), flush=True)
    end.close()


# -- what they share


def child(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(  # noqa: S603 - ourselves
        [sys.executable, __file__, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def answer(other: subprocess.Popen[str]) -> str:
    assert other.stdout is not None
    return other.stdout.readline().strip()


def tell(other: subprocess.Popen[str]) -> None:
    assert other.stdin is not None
    other.stdin.write("\n")
    other.stdin.flush()


def wait_for(what: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "it takes too long"
        time.sleep(0.005)


def peak_mb() -> int:
    """The most that this process has had resident."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) // 1000


def latency(report: Report, *, rounds: int, count: int) -> None:
    """256 bytes at 1 kHz: what the relay adds to bare Zenoh."""
    late_us: dict[str, list[float]] = {subject: [] for subject in ("bare", "conduit", "relay")}
    for _ in range(rounds):
        for subject, some in late_us.items():
            some.append(measured(subject, PACED_BYTES, count).late_us)
    best = {subject: min(some) for subject, some in late_us.items()}
    for subject, some in late_us.items():
        shown = " ".join(f"{one:.0f}" for one in some)
        report.line(f"    {PACED_BYTES} B at 1 kHz, {subject:8} median {shown} us")
    added_ms = (best["relay"] - best["bare"]) / 1000
    report.ratio("ms added to 256 B at 1 kHz", added_ms, ADDED_AT_MOST_MS)


def throughput(report: Report, *, share: float) -> None:
    for size, (most_rounds, most) in SIZES.items():
        rounds, count = most_rounds if share == 1 else 1, max(50, int(most * share))
        runs: dict[str, list[Run]] = {subject: [] for subject in SUBJECTS}
        for _ in range(rounds):
            for subject in SUBJECTS:
                runs[subject].append(measured(subject, size, count))
        for subject, some in runs.items():
            report.line(row(size, subject, some))
        for subject, base in itertools.product(("conduit", "relay"), ("bare", "bare queued")):
            pairs = zip(runs[subject], runs[base], strict=True)
            share_of = statistics.median(one.rate / bare.rate for one, bare in pairs)
            # The report judges what should be small.
            report.ratio(
                f"{size} B: {base} / {subject}; {share_of:.2f} the other way",
                1 / share_of,
                1 / AT_LEAST[size] if (subject, base) == ("relay", "bare") else None,
            )


def row(size: int, subject: str, runs: list[Run]) -> str:
    rate = statistics.median(one.rate for one in runs)
    sends, receives = (min(one.cpu_us[side] for one in runs) for side in (0, 1))
    lost = sum(one.lost for one in runs)
    return (
        f"  {size:8} B  {subject:12} {rate:10,.0f} msg/s  {lost} lost"
        f"   at least {sends:.1f} + {receives:.1f} us of processor time"
    )


def main() -> None:
    arguments = options()
    report = Report("A relay over Zenoh / bare Zenoh, TCP loopback, shared memory off")
    rounds, share, seconds = (1, 0.1, 2.0) if arguments.quick else (5, 1.0, 14.0)
    # First, since a process keeps some of what it once had.
    for hold_bytes in (5 * MB, 512 * MB):
        result = frozen(seconds, hold_bytes)
        report.line(f"\n  far side stopped for {seconds:g} s, cap {hold_bytes // MB} MB: {result}")
        uncounted = abs(result["lost"] - result["counted as lost"])
        report.ratio("    lost and not counted", uncounted, 0)
        report.ratio("    repeated or out of order", result["again"] + result["out of order"], 0)
        if hold_bytes > 300 * MB:
            report.ratio("    lost", result["lost"], 0)
    latency(report, rounds=rounds, count=int(3000 * share))
    throughput(report, share=share)
    report.finish(check=arguments.check)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["sender", subject, endpoint, path, size, count]:
            sender(subject, endpoint, path, int(size), int(count))
        case ["far", endpoint]:
            far(endpoint)
        case _:
            main()
