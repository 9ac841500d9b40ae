"""A ROS domain of its own for each test, with a gateway in miniature, and programs to watch end."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from beacon_ros_topic.harness import RosTopicHarness

DEADLINE_S = 20.0
"""Discovery between processes takes up to 3 s, on a busy machine more."""


def _eventually(true: Callable[[], object], within_s: float = DEADLINE_S) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, f"not within {within_s} s"
        time.sleep(0.005)


@pytest.fixture
def eventually() -> Callable[..., None]:
    return _eventually


@pytest.fixture
def harness(monkeypatch: pytest.MonkeyPatch) -> Iterator[RosTopicHarness]:
    """What needs rclpy is imported here: without it the tests that ask for this are skipped."""
    from beacon_ros_topic.harness import RosTopicHarness  # noqa: PLC0415

    made = RosTopicHarness()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(made.options().domain_id))
    yield made
    made.close()


@pytest.fixture
def start_script(harness: RosTopicHarness) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Starts a program in a process of its own and in the test's domain."""
    started: list[subprocess.Popen[str]] = []

    def start(script: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", script],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def run_script(
    start_script: Callable[[str], subprocess.Popen[str]],
) -> Callable[[str], tuple[int, str, str]]:
    """Runs one to its end; see ``end``."""
    return lambda script: _end(start_script(script))


def _end(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=DEADLINE_S)
    return process.returncode, out, err


@pytest.fixture
def end() -> Callable[[subprocess.Popen[str]], tuple[int, str, str]]:
    """Waits for the end of one: exit code, what it wrote to stdout, and to stderr."""
    return _end


def _count(what: str) -> int:
    return len([*Path("/proc/self", what).iterdir()])


@pytest.fixture
def threads() -> Callable[[], int]:
    """Counts the threads of this process, also those of DDS."""
    return lambda: _count("task")


@pytest.fixture
def leaves_nothing() -> Callable[..., None]:
    """Does something again and again; no thread and no file descriptor may be left of it."""

    def check(action: Callable[[], object], times: int = 50) -> None:
        action()  # what is made once for all may stay
        before = _count("task"), _count("fd")
        for _ in range(times):
            action()
        _eventually(lambda: _count("task") <= before[0] and _count("fd") <= before[1])

    return check
