"""Ctrl-C and SIGTERM as an orderly request to stop."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["on_stop_signal"]


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
