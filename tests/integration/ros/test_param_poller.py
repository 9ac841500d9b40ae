"""Many real nodes are asked at the same time, and those that hang hold up nobody."""

from __future__ import annotations

import signal
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to ask")

from beacon_core.outcome import Outcome, Verdict
from beacon_ros_param.options import RosParamOptions
from beacon_ros_param.source import RosParamSource

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Child, Children

WaitUntil = Callable[..., None]

COUNTS = (12, 10, 9, 9)
"""Nodes in each process; those of the first are made to hang."""

NODES = sum(COUNTS)
INTERVAL_S = 1.0
TIMEOUT_S = 1.0
CLOSE_WITHIN_S = 1.0
WINDOW_S = 6.0
ANSWER_S = 0.05
RATIO = 0.25


class Heard:
    """A sink that notes when it heard of whom."""

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = defaultdict(list)

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        self.times[source].append(time.monotonic())
        return Outcome(Verdict.REFRESHED)

    def goodbye(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return Outcome(Verdict.UNKNOWN)

    def lost(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return Outcome(Verdict.UNKNOWN)

    def longest_gap_s(self, node: str, since_s: float, until_s: float) -> float:
        between = [one for one in self.times[node] if since_s <= one <= until_s]
        return max(later - earlier for earlier, later in pairwise([since_s, *between, until_s]))


@pytest.fixture
def start(children: Children, wait_until: WaitUntil) -> Callable[..., list[Child]]:
    """Starts all nodes; they take so long to answer."""

    def start(delay_s: float = 0.0) -> list[Child]:
        started = [
            children.node("many_nodes", str(sum(COUNTS[:number])), str(count), str(delay_s))
            for number, count in enumerate(COUNTS)
        ]
        wait_until(lambda: all(child.said() for child in started), "all nodes are there")
        return started

    return start


@contextmanager
def asking(wait_until: WaitUntil, **given: Any) -> Iterator[tuple[RosParamSource, Heard]]:
    """A source that has heard all nodes."""
    options = RosParamOptions(interval_s=INTERVAL_S, timeout_s=TIMEOUT_S, **given)
    source, heard = RosParamSource(options), Heard()
    source.start(heard)
    try:
        wait_until(lambda: len(heard.times) == NODES, "all nodes are heard")
        yield source, heard
    finally:
        source.close()


def whole_cycles_us(source: RosParamSource) -> Callable[[], list[int]]:
    """What notes the lengths of its cycles, without the first: nodes were still being found."""
    lengths: list[int] = []

    def so_far() -> list[int]:
        length = source.health().counters["cycle-us"]
        if length not in lengths[-1:]:
            lengths.append(length)
        return lengths[2:]

    return so_far


def longest_gap_while_hung_s(
    hung: Child, source: RosParamSource, heard: Heard, wait_until: WaitUntil
) -> float:
    """Let these nodes hang for a while; so long one of the others was not heard."""
    began = time.monotonic()
    hung.signal(signal.SIGSTOP)
    wait_until(lambda: source.health().counters["silent"] == COUNTS[0], "they are noticed")
    assert "one_of_many" in source.health().detail
    wait_until(lambda: time.monotonic() > began + WINDOW_S, "that goes on for a while")
    now = time.monotonic()
    hung.signal(signal.SIGCONT)
    wait_until(lambda: all(times[-1] > now for times in heard.times.values()), "all answer again")
    others = (f"/one_of_many_{number}" for number in range(COUNTS[0], NODES))
    return max(heard.longest_gap_s(name, began, now) for name in others)


def test_asking_all_at_once_takes_a_part_of_the_time_of_asking_one_after_another(
    start: Callable[..., list[Child]], wait_until: WaitUntil
) -> None:
    start(ANSWER_S)
    with asking(wait_until, max_in_flight=1) as (source, _):
        lengths = whole_cycles_us(source)
        wait_until(lambda: len(lengths()) >= 2, "two whole cycles are over", 60.0)
        one_by_one = min(lengths())
    assert one_by_one >= NODES * ANSWER_S * 1e6
    with asking(wait_until, max_in_flight=128) as (source, _):
        lengths = whole_cycles_us(source)

        def short() -> bool:
            # A cycle in which some rest would be short for that.
            if source.health().counters["silent"]:
                return False
            return any(length <= RATIO * one_by_one for length in lengths())

        # Whoever asks all at once needs the processor: what else runs there makes cycles longer.
        wait_until(short, f"a cycle takes {RATIO} of {one_by_one} us", 60.0)


def test_while_some_nodes_hang_each_of_the_others_is_heard_once_per_interval_and_timeout(
    start: Callable[..., list[Child]], wait_until: WaitUntil
) -> None:
    hung, *_ = start()
    with asking(wait_until) as (source, heard):
        gaps: list[float] = []
        # A machine that stands still for a second makes a gap: then it is looked at once more.
        while len(gaps) < 2 and not any(gap <= INTERVAL_S + TIMEOUT_S for gap in gaps):
            gaps.append(longest_gap_while_hung_s(hung, source, heard, wait_until))
    assert min(gaps) <= INTERVAL_S + TIMEOUT_S, gaps


def test_closing_takes_no_second_while_requests_to_hung_nodes_are_under_way(
    start: Callable[..., list[Child]], wait_until: WaitUntil
) -> None:
    hung, *_ = start()
    with asking(wait_until) as (source, heard):
        hung.signal(signal.SIGSTOP)
        wait_until(lambda: source.health().counters["failures"] > 0, "some hang")
        wait_until(lambda: source.health().counters["in-flight"] > 0, "they are asked again")
        began = time.monotonic()
        source.close()
        assert time.monotonic() - began < CLOSE_WITHIN_S
        told = sum(map(len, heard.times.values()))
        hung.signal(signal.SIGCONT)
        over = time.monotonic() + 1.0
        wait_until(lambda: time.monotonic() > over, "late answers would have come")
        assert sum(map(len, heard.times.values())) == told
