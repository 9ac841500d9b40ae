"""What ``beacon run`` asks of its process."""

from __future__ import annotations

import gc
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from beacon_gateway.console.process import (
    keep_answers_prompt,
    keep_memory_together,
    memory_given_back,
)


@pytest.fixture
def as_it_was() -> Iterator[None]:
    interval_s, thresholds = sys.getswitchinterval(), gc.get_threshold()
    yield
    sys.setswitchinterval(interval_s)
    gc.set_threshold(*thresholds)
    gc.unfreeze()


@pytest.mark.usefixtures("as_it_was")
def test_no_thread_keeps_another_waiting_for_long_and_what_is_loaded_is_not_searched_again() -> (
    None
):
    keep_answers_prompt()
    assert sys.getswitchinterval() <= 0.001
    assert gc.get_freeze_count() > 10_000
    assert gc.isenabled()


def test_what_threads_give_back_is_kept_in_two_heaps(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []
    libc = SimpleNamespace(mallopt=lambda what, value: asked.append((what, value)))
    monkeypatch.setattr("ctypes.CDLL", lambda _: libc)
    keep_memory_together()
    assert asked == [(-8, 2)]


def test_without_glibc_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ctypes.CDLL", lambda _: SimpleNamespace())
    keep_memory_together()
    with memory_given_back(0.001):
        pass


def test_what_is_free_is_given_back_until_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: queue.Queue[int] = queue.Queue()
    monkeypatch.setattr("ctypes.CDLL", lambda _: SimpleNamespace(malloc_trim=asked.put))
    with memory_given_back(0.001):
        assert [asked.get(timeout=5) for _ in range(3)] == [0, 0, 0]
    given = asked.qsize()
    assert not [one for one in threading.enumerate() if one.name == "beacon-trim"]
    assert asked.qsize() == given


ENDING = """
import ctypes, sys, time
from beacon_gateway.console.process import end_watched
with end_watched(0.2) as begins:
    begins()
    {meanwhile}
time.sleep(0.5)
"""


def ended(meanwhile: str) -> tuple[int, str]:
    """The exit code and stderr of a process that does this while it ends."""
    script = ENDING.format(meanwhile=meanwhile)
    command = [sys.executable, "-c", script]
    process = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60)
    return process.returncode, process.stderr


def test_who_cannot_end_says_where_it_is_and_is_ended() -> None:
    code, said = ended("ctypes.PyDLL(None).sleep(60)  # with Python's lock")
    assert code == 1
    assert 'File "<string>", line 6' in said


def test_who_ends_in_time_is_left_alone() -> None:
    assert ended("pass") == (0, "")
