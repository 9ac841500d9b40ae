"""A flood: one source at 50,000 messages a second beside 100 quiet ones, for 20 seconds.

Promised: no quiet entity leaves ACTIVE, memory stays flat, and every drop is counted.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable
from pathlib import Path

import attrs
import pytest

from beacon_core.clock import ManualClock, SystemClock
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json as wire_json
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.source import ZenohSource

QUIET = 100
SECONDS = 20
FLOOD_PER_S = 50_000
QUIET_PER_S = 2
S = 1_000_000_000


@attrs.define
class Flood:
    """What the flooder says next; of each kind of trouble some."""

    honest: bytes = wire_json.encode(bench_hint(10_000))
    number: int = 0

    def next(self) -> bytes:
        self.number += 1
        match self.number % 4:
            case 0:
                return self.honest
            case 1:
                return b'{"entity_id": "invented-%d"}' % self.number
            case 2:
                return b"\xff not a hint"
            case _:
                return b'{"entity_id": "one-loud-robot", "metadata": {"n": "%d"}}' % self.number


def test_quiet_sources_stay_active_beside_a_flood_in_simulated_time() -> None:
    clock = ManualClock()
    store = HintStore(clock, ttl_s=1.0, expiry_s=30.0)
    intake = Intake(store, wire_json.decode)
    quiet = [(f"quiet-{n}", wire_json.encode(bench_hint(n))) for n in range(QUIET)]
    flood, offered, sizes = Flood(), 0, []
    for source, payload in quiet:
        intake.offer(payload, source)
    # The pace is the real one: each step of 10 ms brings what falls into it.
    for step in range(SECONDS * 100):
        clock.advance(S // 100)
        for _ in range(FLOOD_PER_S // 100):
            intake.offer(flood.next(), "flooder")
        for source, payload in quiet[step % 50 :: 50]:
            intake.offer(payload, source)
        offered += FLOOD_PER_S // 100 + 2
        if step % 25 == 0:
            for number in range(QUIET):
                stored = store.get(bench_hint(number).entity_id)
                assert stored is not None
                assert stored.status is Status.ACTIVE, (step, number)
            sizes.append(resident_bytes())
    totals = intake.totals()
    assert sum(totals.values()) == offered + QUIET
    assert totals[Verdict.SOURCE_RATE] > 0.9 * offered
    reports = {report.name: report for report in intake.sources()}
    assert sum(reports["flooder"].counts.values()) == SECONDS * FLOOD_PER_S
    assert all(
        set(reports[source].counts) == {Verdict.NEW, Verdict.REFRESHED} for source, _ in quiet
    )
    # What the flooder got in is bounded by its rate; after that nothing grows any more.
    assert max(sizes) - sizes[len(sizes) // 4] < 4 * 2**20


FLOODER = """
    import sys, time, zenoh
    endpoint, seconds, rate = sys.argv[1], float(sys.argv[2]), int(sys.argv[3])
    config = zenoh.Config.from_json5(
        '{mode:"client",connect:{endpoints:["%s"]},scouting:{multicast:{enabled:false}}}' % endpoint
    )
    with zenoh.open(config) as session:
        # Zenoh drops by itself what a link cannot carry; here every message is to arrive.
        publisher = session.declare_publisher(
            "beacon/hint/one-loud-robot", congestion_control=zenoh.CongestionControl.BLOCK
        )
        while not publisher.matching_status.matching:
            time.sleep(0.01)
        sent, start = 0, time.monotonic()
        while (elapsed := time.monotonic() - start) < seconds:
            while sent < elapsed * rate:
                publisher.put(b'{"entity_id": "one-loud-robot", "metadata": {"n": "%d"}}' % sent)
                sent += 1
            time.sleep(0.001)
    print(sent, flush=True)
"""

QUIET_FLEET = """
    import sys, time
    from beacon_core.testing.examples import bench_hint
    from beacon_zenoh.announcer import ZenohAnnouncer
    from beacon_zenoh.options import ZenohOptions
    announcer = ZenohAnnouncer(ZenohOptions(connect=[sys.argv[1]]), period_s=1.0)
    for number in range(int(sys.argv[2])):
        announcer.announce(bench_hint(number))
    print("ready", flush=True)
    sys.stdin.read()
    announcer.close()
"""


def spawn(script: str, *arguments: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script), *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def resident_bytes() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_quiet_robots_stay_active_beside_a_flood_over_zenoh(endpoint: str) -> None:
    store = HintStore(SystemClock(), ttl_s=3.0, expiry_s=60.0)
    intake = Intake(store, wire_json.decode)
    source = ZenohSource(ZenohOptions(listen=(endpoint,)))
    source.start(intake)
    memory = []
    try:
        with spawn(QUIET_FLEET, endpoint, QUIET) as fleet:
            wait_until(lambda: store.size() == QUIET)
            with spawn(FLOODER, endpoint, SECONDS, FLOOD_PER_S) as flooder:
                while flooder.poll() is None:
                    for number in range(QUIET):
                        stored = store.get(bench_hint(number).entity_id)
                        assert stored is not None
                        assert stored.status is Status.ACTIVE, (number, intake.totals())
                    memory.append(resident_bytes())
                    threading.Event().wait(0.25)
                assert flooder.stdout is not None
                sent = int(flooder.stdout.read())
            wait_until(lambda: source_count(intake, "one-loud-robot") == sent)
            assert fleet.stdin is not None
            fleet.stdin.close()
    finally:
        source.close()
    totals = intake.totals()
    logging.getLogger(__name__).info("sent %d, %s, resident %s", sent, totals, memory[::8])
    assert sent >= 0.8 * SECONDS * FLOOD_PER_S
    assert totals[Verdict.SOURCE_RATE] > 0.9 * sent
    settled = memory[len(memory) // 4 :]
    assert max(settled) - min(settled) < 20 * 2**20


def wait_until(condition: Callable[[], bool], seconds: float = 30) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "not in time"
        threading.Event().wait(0.05)


def source_count(intake: Intake, name: str) -> int:
    return sum(sum(report.counts.values()) for report in intake.sources() if report.name == name)
