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


def shortest_cycle_us(wait_until: WaitUntil, cap: int) -> int:
    """The shorter of two: it was disturbed less."""
    with asking(wait_until, max_in_flight=cap) as (source, _):
        lengths: list[int] = []

        def have_more() -> bool:
            length = source.health().counters["cycle-us"]
            if length not in lengths[-1:]:
                lengths.append(length)
            # The first ones are those in which nodes were still being found.
            return len(lengths) >= 4

        wait_until(have_more, "two whole cycles are over", 60.0)
        return min(lengths[-2:])


def test_asking_all_at_once_takes_a_part_of_the_time_of_asking_one_after_another(
    start: Callable[..., list[Child]], wait_until: WaitUntil
) -> None:
    start(ANSWER_S)
    at_once = shortest_cycle_us(wait_until, cap=128)
    one_by_one = shortest_cycle_us(wait_until, cap=1)
    assert one_by_one >= NODES * ANSWER_S * 1e6
    assert at_once <= RATIO * one_by_one


def test_while_some_nodes_hang_each_of_the_others_is_heard_once_per_interval_and_timeout(
    start: Callable[..., list[Child]], wait_until: WaitUntil
) -> None:
    hung, *_ = start()
    with asking(wait_until) as (source, heard):
        began = time.monotonic()
        hung.signal(signal.SIGSTOP)
        wait_until(
            lambda: source.health().counters["silent"] == COUNTS[0],
            "they are noticed, all after one time-out",
            INTERVAL_S + 4 * TIMEOUT_S,
        )
        assert "one_of_many" in source.health().detail
        wait_until(lambda: time.monotonic() > began + 6.0, "that goes on for a while")
        now = time.monotonic()
        for number in range(COUNTS[0], NODES):
            gap_s = heard.longest_gap_s(f"/one_of_many_{number}", began, now)
            assert gap_s <= INTERVAL_S + TIMEOUT_S, f"one_of_many_{number}"
        hung.signal(signal.SIGCONT)
        back = time.monotonic()
        wait_until(
            lambda: all(times[-1] > back for times in heard.times.values()), "all answer again"
        )


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
