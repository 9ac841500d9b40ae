"""Nodes come and go every second, are killed, and contexts are opened and closed: nothing grows.

``pytest -s -m slow tests/integration/ros/test_soak.py`` runs it for twice fifteen minutes (or as
many seconds as ``SOAK_S`` says) and prints what it measured: once with nodes that come back under
the names they had, as those of a robot do, and once with names that are always new. Fast DDS keeps
something of nodes that have gone: the gateway may grow hardly more than a process that asks the
same nodes by rclpy alone.
"""

from __future__ import annotations

import os
import re
import signal
import statistics
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from beacon_ros.domains import DomainLease

SAMPLE_S = 2.0
KILL_EVERY_S = 7.0
WARM_UP = 0.25
"""This part of the time is for caches to fill; the rest is looked at."""

GATEWAY = """
sources:
  topic: {adapter: ros_topic, ttl_s: 3}
  param: {adapter: ros_param, ttl_s: 5, options: {interval_s: 1}}
"""

LOG_LINE = re.compile(r"\d{4}-\d\d-\d\d [\d:,]+ (INFO|WARNING) +beacon_\S+: .*")


UNANSWERED = re.compile(
    r".*RuntimeWarning: failed to send response \(timeout\).*|  self\.__service.*"
)
"""What rclpy says, once, in a node whose asker went before it was answered: a busy machine's."""


@attrs.frozen
class Sample:
    """What a process holds at one moment."""

    threads: int
    files: int
    megabytes: float

    @classmethod
    def of(cls, pid: int) -> Sample:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        return cls(
            threads=sum(1 for _ in Path(f"/proc/{pid}/task").iterdir()),
            files=sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir()),
            megabytes=pages * os.sysconf("SC_PAGE_SIZE") / 2**20,
        )


def test_nothing_grows_while_nodes_come_and_go(soak: Callable[..., None]) -> None:
    soak("return", seconds=20.0, growth_mb=60.0)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("names", ["return", "new"])
def test_nothing_grows_in_a_quarter_of_an_hour(soak: Callable[..., None], names: str) -> None:
    soak(names, seconds=float(os.environ.get("SOAK_S", "900")), growth_mb=8.0)


@pytest.fixture
def elsewhere() -> Iterator[int]:
    """A domain beside the test's own."""
    with DomainLease() as lease:
        yield lease.domain_id


@pytest.fixture
def soak(
    children: Any, gateway: Callable[[str], Any], wait_until: Callable[..., None], elsewhere: int
) -> Callable[..., None]:
    def run(names: str, *, seconds: float, growth_mb: float) -> None:
        beacon = gateway(GATEWAY)
        churn = children.node("churn", names)
        bare = children.node("bare_churn", env={"ROS_DOMAIN_ID": str(elsewhere)})
        follow = children.node("bare_follow")
        watched = {"gateway": beacon.child, "churn": churn, "bare": bare, "follow": follow}
        samples: dict[str, list[Sample]] = {name: [] for name in watched}
        begin = killed_at = time.monotonic()
        victim = None
        while (now := time.monotonic()) < begin + seconds:
            assert churn.process.poll() is None, churn.err.read_text()
            if now >= begin + seconds * WARM_UP:
                for name, child in watched.items():
                    samples[name].append(Sample.of(child.pid))
            if now >= killed_at + KILL_EVERY_S:
                if victim is not None:
                    victim.signal(signal.SIGKILL)
                # It asks nobody: rclpy writes a warning when it cannot answer somebody dead. And it
                # has the usual lease: the shorter, the more often Fast DDS looks at it, and now and
                # then looking locks the looker up (Fast-DDS issue 6502).
                victim = children.node("churn", "speak-only")
                killed_at = now
            time.sleep(SAMPLE_S)  # the pace of sampling, not a wait for something
        _heard_everything(beacon, wait_until)
        _ends_cleanly(churn, signal.SIGTERM)
        _ends_cleanly(bare, signal.SIGTERM)
        _ends_cleanly(follow, signal.SIGTERM)
        _ends_cleanly(beacon.child, signal.SIGINT)
        assert not _stray(churn, UNANSWERED)
        assert not _stray(beacon.child, LOG_LINE)
        # What rclpy alone keeps, doing the same with the same care, is not ours.
        bare_mb = _grown(_thirds(samples["bare"], "bare"))
        follow_mb = _grown(_thirds(samples["follow"], "follow"))
        _is_level("gateway", samples["gateway"], max(growth_mb, follow_mb + 2.0))
        _is_level("churn", samples["churn"], growth_mb + bare_mb)

    return run


def _is_level(name: str, samples: list[Sample], growth_mb: float) -> None:
    """The last third holds no more than the first did; nodes differ by a few at any moment."""
    thirds = _thirds(samples, name)
    for what, allowed in (("threads", 12), ("files", 24), ("megabytes", growth_mb)):
        early, late = thirds[what]
        assert late <= early + allowed, f"{name}: {what} grew from {early} to {late}"


def _thirds(samples: list[Sample], name: str) -> dict[str, tuple[float, float]]:
    """The medians of the first third and of the last one."""
    third = max(1, len(samples) // 3)
    found = {}
    for what in ("threads", "files", "megabytes"):
        early, late = (
            statistics.median(getattr(one, what) for one in some)
            for some in (samples[:third], samples[-third:])
        )
        print(f"{name:8} {what:10} {early:8.1f} -> {late:8.1f}")  # noqa: T201 - the soak's report
        found[what] = early, late
    return found


def _grown(thirds: dict[str, tuple[float, float]]) -> float:
    """So many megabytes; none, if it holds less now."""
    early, late = thirds["megabytes"]
    return max(0.0, late - early)


def _heard_everything(beacon: Any, wait_until: Callable[..., None]) -> None:
    """Both carriers were heard to the end."""

    def both_are_heard() -> bool:
        sources = beacon.get("health")[1]["x-medkit-beacon"]["sources"]
        return all(one["hints"]["active"] for one in sources)

    wait_until(both_are_heard, "both are heard")
    sources = beacon.get("health")[1]["x-medkit-beacon"]["sources"]
    assert {one["name"] for one in sources} == {"topic", "param"}
    for one in sources:
        print(one["name"], one["condition"], one["messages"], one["counters"])  # noqa: T201
        assert one["messages"]["new"] > 0
        assert one["messages"]["fault"] == one["messages"]["malformed"] == 0


def _stray(child: Any, expected: re.Pattern[str]) -> list[str]:
    """Lines on stderr that nobody expects. Fast DDS's complaint about what a killed neighbour left
    of its shared memory is not ours to suppress."""
    lines = child.err.read_text().splitlines()
    return [one for one in lines if not expected.match(one) and "RTPS_TRANSPORT_SHM" not in one]


def _ends_cleanly(child: Any, number: signal.Signals) -> None:
    child.signal(number)
    assert child.ends() == 0, child.err.read_text()
