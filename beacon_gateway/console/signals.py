"""Ctrl-C and SIGTERM as an orderly request to stop, SIGHUP as one to read again."""

from __future__ import annotations

import logging
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["on_reload_signal", "on_stop_signal", "wait"]

_log = logging.getLogger(__name__)

_WAKE_S = 0.2
_END_S = 2.0


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


@contextmanager
def on_reload_signal(reload: Callable[[], object]) -> Iterator[None]:
    """Within: SIGHUP calls ``reload``, in a thread of its own, and one after the other.

    Only in the main thread, where Python handles signals.
    """
    asked, ended = threading.Event(), threading.Event()

    def follow() -> None:
        while True:
            asked.wait()
            if ended.is_set():
                return
            asked.clear()
            try:
                reload()
            except Exception:  # noqa: BLE001 - a defect must not make the gateway deaf to the next one
                _log.exception("reloading failed")

    before = signal.signal(signal.SIGHUP, lambda *_: asked.set())
    thread = threading.Thread(target=follow, name="beacon-reload", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)
        ended.set()
        asked.set()
        thread.join(_END_S)


def wait(stop: threading.Event, seconds: float | None = None) -> bool:
    """Wait for the event, as ``stop.wait(seconds)``, in the main thread.

    A signal may be delivered to another thread, such as one of Zenoh's. Then it does not wake this
    one, and Python calls the handler only when something else does.
    """
    end_s = math.inf if seconds is None else time.monotonic() + seconds
    while not stop.is_set() and (left_s := end_s - time.monotonic()) > 0:
        stop.wait(min(left_s, _WAKE_S))
    return stop.is_set()
