"""Waiting for something to hold, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["wait_until"]


def wait_until(
    predicate: Callable[[], object], deadline_s: float, *, pause_s: float = 0.005
) -> bool:
    """Wait until ``predicate()`` holds (``True``), or for ``deadline_s`` seconds (``False``).

    Looks at once, and then each ``pause_s`` seconds. Thread rule: any thread.
    """
    deadline = time.monotonic() + deadline_s
    pause = threading.Event()
    while not predicate():
        if time.monotonic() >= deadline:
            return False
        pause.wait(pause_s)
    return True
