"""Ctrl-C and SIGTERM as an orderly request to stop."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["on_stop_signal", "wait"]

_WAKE_S = 0.2


@contextmanager
def on_stop_signal(stop: Callable[[], None]) -> Iterator[None]:
    """Within: SIGINT and SIGTERM call ``stop``, every time, and do nothing else.

    Only in the main thread, where Python handles signals.
    """
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, lambda *_: stop()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def wait(stop: threading.Event, seconds: float | None = None) -> bool:
    """Wait for the event, as ``stop.wait(seconds)``, in the main thread.

    A signal may be delivered to another thread, such as one of Zenoh's. Then it does not wake this
    one, and Python calls the handler only when something else does.
    """
    end_s = math.inf if seconds is None else time.monotonic() + seconds
    while not stop.is_set() and (left_s := end_s - time.monotonic()) > 0:
        stop.wait(min(left_s, _WAKE_S))
    return stop.is_set()
