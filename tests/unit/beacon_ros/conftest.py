"""A ROS domain for each test that asks for one, patience, and programs to watch end."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from beacon_ros.domains import DomainLease

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
def domain() -> Iterator[int]:
    with DomainLease() as lease:
        yield lease.domain_id


@pytest.fixture
def run_script(domain: int) -> Callable[[str], subprocess.CompletedProcess[str]]:
    """Runs a program in a process and in the test's domain to its end."""

    def run(script: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )

    return run


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
