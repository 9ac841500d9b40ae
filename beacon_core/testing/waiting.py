"""Waiting for something to hold, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

__all__ = ["wait_until"]

_OVERRUN_S = 0.1


def wait_until(
    predicate: Callable[[], object], deadline_s: float, *, pause_s: float = 0.005
) -> bool:
    """Wait until ``predicate()`` holds (``True``), or for ``deadline_s`` seconds (``False``).

    Looks at once, and then each ``pause_s`` seconds. Thread rule: any thread.

    While a machine stands still its clock goes on, and what is waited for does not: of a pause that
    lasts longer than it should, no more than 0.1 s counts.
    """
    left_s, looks = deadline_s, time.monotonic()
    pause = threading.Event()
    while not predicate():
        if left_s <= 0:
            return False
        looked = time.monotonic()
        pause.wait(pause_s)
        now = time.monotonic()
        left_s -= looked - looks + min(now - looked, pause_s + _OVERRUN_S)
        looks = now
    return True
