"""How a gateway that starts late can learn the present hints from Zenoh, and what each way costs.

    python bench/zenoh_late_gateway.py [--quick]

A router, a number of announcers behind it (each with a session of its own, in two processes) that
have spoken once and are silent since, and then a gateway:

* ``advanced``: advanced publishers with a cache and detection, an advanced subscriber with history;
* ``queryable``: the announcer answers a question on its key; one thread answers for all its keys;
* ``own thread``: the same, with a callback of its own for each key, as Zenoh makes them by default;
* ``roll call``: the gateway shows a token, and whoever sees it says its hint again;
* ``the adapter``: what was chosen, with everything around it.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import attrs
import zenoh
from zenoh import ext

from beacon_core.outcome import Outcome, Verdict
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json
from beacon_zenoh import ADAPTER, ZenohOptions, wire
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import open_router
from measure import options

WAYS = ("advanced", "queryable", "own thread", "roll call", "the adapter")
ATTACHMENT = wire.encode("bench-run", 1, 1)


def client(endpoint: str) -> zenoh.Session:
    return zenoh.open(session_config(ZenohOptions(connect=(endpoint,)), "client").make())


# In the announcers' processes


class Announcers:
    """So many, one way. Everything declared is kept, for Zenoh undeclares what is forgotten."""

    def __init__(self, way: str, endpoint: str, numbers: range) -> None:
        self.kept: list[Any] = []
        self.questions: queue.SimpleQueue[tuple[int, zenoh.Query]] = queue.SimpleQueue()
        threading.Thread(target=self._answer_all, daemon=True).start()
        speak = {
            "advanced": self._advanced,
            "queryable": self._queryable,
            "own thread": self._own_thread,
            "roll call": self._roll_call,
        }
        for number in numbers:
            if way == "the adapter":
                announcer = ADAPTER.announcer(ZenohOptions(connect=(endpoint,)), None)
                announcer.announce(bench_hint(number))
                self.kept.append(announcer)
                continue
            session = client(endpoint)
            token = f"beacon/live/{bench_hint(number).entity_id}/bench-run"
            self.kept += [session, session.liveliness().declare_token(token)]
            speak[way](session, number)

    def _advanced(self, session: zenoh.Session, number: int) -> None:
        publisher = ext.declare_advanced_publisher(
            session,
            key(number),
            cache=ext.CacheConfig(max_samples=1),
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None),
            publisher_detection=True,
        )
        publisher.put(payload(number), attachment=ATTACHMENT)
        self.kept.append(publisher)

    def _queryable(self, session: zenoh.Session, number: int) -> None:
        put(session, number)
        handler = zenoh.handlers.Callback(partial(self._asked, number), indirect=False)
        self.kept.append(session.declare_queryable(key(number), handler))

    def _asked(self, number: int, query: zenoh.Query) -> None:
        self.questions.put((number, query))

    def _own_thread(self, session: zenoh.Session, number: int) -> None:
        put(session, number)
        self.kept.append(session.declare_queryable(key(number), partial(answer, number)))

    def _roll_call(self, session: zenoh.Session, number: int) -> None:
        def called(sample: zenoh.Sample) -> None:
            if sample.kind == zenoh.SampleKind.PUT:
                put(session, number)

        put(session, number)
        gateways = "beacon/gateway/*"
        self.kept.append(session.liveliness().declare_subscriber(gateways, called, history=True))

    def _answer_all(self) -> None:
        while True:
            answer(*self.questions.get())


def key(number: int) -> str:
    return f"beacon/hint/{bench_hint(number).entity_id}"


def payload(number: int) -> bytes:
    return json.encode(bench_hint(number))


def put(session: zenoh.Session, number: int) -> None:
    session.put(key(number), payload(number), attachment=ATTACHMENT)


def answer(number: int, query: zenoh.Query) -> None:
    with query:
        query.reply(key(number), payload(number), attachment=ATTACHMENT)


def announce(way: str, endpoint: str, first: str, last: str) -> None:
    """The whole of an announcers' process."""
    numbers = range(int(first), int(last))
    before = resident_kb()
    announcers = Announcers(way, endpoint, numbers)
    time.sleep(0.5)  # what is said at once has then been said
    each = (resident_kb() - before) / len(numbers)
    print(round(each), len(list(Path("/proc/self/task").iterdir())), flush=True)
    sys.stdin.readline()
    assert announcers.kept
    os._exit(0)


def resident_kb() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


# In the gateway's


@attrs.define
class Seen:
    """Whom the gateway has heard of; also a sink."""

    wanted: int
    ids: set[str] = attrs.Factory(set)
    done: threading.Event = attrs.Factory(threading.Event)

    def note(self, sample: zenoh.Sample) -> None:
        self.offer(sample.payload.to_bytes(), str(sample.key_expr).rpartition("/")[2])

    def note_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self.note(reply.ok)

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
        self.ids.add(source)
        if len(self.ids) == self.wanted:
            self.done.set()
        return Outcome(Verdict.NEW)

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


def join(way: str, endpoint: str, seen: Seen) -> Callable[[], None]:
    """Start a gateway; returns how to close it."""
    if way == "the adapter":
        source = ADAPTER.source(ZenohOptions(mode="client", connect=(endpoint,)))
        source.start(seen)
        return source.close
    session = client(endpoint)
    session.liveliness().declare_subscriber("beacon/live/**", lambda _: None, history=True)
    if way == "advanced":
        history = ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
        ext.declare_advanced_subscriber(
            session, "beacon/hint/*", seen.note, history=history, recovery=None
        )
    else:
        session.declare_subscriber("beacon/hint/*", seen.note)
    if way in ("queryable", "own thread"):
        session.get("beacon/hint/*", seen.note_reply, target=zenoh.QueryTarget.ALL, timeout=5)
    if way == "roll call":
        token = session.liveliness().declare_token(f"beacon/gateway/{session.zid()}")
        return lambda: (token, session.close())[1]  # type: ignore[no-untyped-call]
    return session.close


def late(way: str, count: int, trials: int) -> str:
    """One line of the table."""
    router, endpoint = open_router()
    middle = (count + 1) // 2
    bounds = [(0, middle), (middle, count)] if count > 1 else [(0, 1)]
    processes = [
        subprocess.Popen(  # noqa: S603 - ourselves
            [sys.executable, __file__, "--announce", way, endpoint, str(first), str(last)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for first, last in bounds
    ]
    said = [process.stdout.readline().split() for process in processes if process.stdout]
    times, fewest = [], count
    for _ in range(trials):
        seen = Seen(count)
        began = time.monotonic()
        close = join(way, endpoint, seen)
        seen.done.wait(3)
        times.append((time.monotonic() - began) * 1000)
        fewest = min(fewest, len(seen.ids))
        close()
    for process in processes:
        process.communicate("\n")
    router.close()  # type: ignore[no-untyped-call]
    kilobytes, threads = said[0]
    return (
        f"{way:12} {count:6} {min(times):9.1f} {sorted(times)[len(times) // 2]:9.1f} "
        f"{fewest:9} {kilobytes:>8} {threads:>8}"
    )


def main() -> None:
    arguments = options()
    counts, trials = ((10,), 1) if arguments.quick else ((1, 100, 1000), 5)
    print("\nA gateway that starts late: ms until all are seen; memory and threads of announcers\n")
    print(
        f"{'':12} {'among':>6} {'best':>9} {'median':>9} {'seen':>9} {'kB each':>8} {'threads':>8}"
    )
    for count in counts:
        for way in WAYS:
            print(late(way, count, trials), flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--announce"]:
        announce(*sys.argv[2:])
    else:
        main()
