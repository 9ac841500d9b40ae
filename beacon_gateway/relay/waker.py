"""Rings when somebody's time has come: one thread for all who have set a time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable

from beacon_core.clock import Clock

__all__ = ["Waker"]

_END_S = 1.0


class Waker:
    """Thread rule: any thread; ``ring`` is called in the waker's own, and not while a time is set.

    A time set anew replaces the one before; rung once, it is gone.
    """

    def __init__(self, clock: Clock, ring: Callable[[Hashable], object], name: str) -> None:
        self._clock, self._ring = clock, ring
        self._due: dict[Hashable, int] = {}
        self._changed = threading.Condition()
        self._wakes_ns: int | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=f"{name}-waker", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def set(self, key: Hashable, due_ns: int | None) -> None:
        """Ring ``key`` at this time of the monotonic clock; ``None``: not any more."""
        with self._changed:
            if due_ns is None:
                self._due.pop(key, None)
                return
            self._due[key] = due_ns
            if self._wakes_ns is None or due_ns < self._wakes_ns:
                self._changed.notify()

    def close(self) -> None:
        """Ring no more. Idempotent; not from within ``ring``."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(_END_S)

    def _run(self) -> None:
        while (rung := self._next()) is not None:
            for key in rung:
                self._ring(key)

    def _next(self) -> list[Hashable] | None:
        """Wait for the next ones that are due, the earliest first; ``None`` at the end."""
        with self._changed:
            while not self._ended:
                now_ns = self._clock.monotonic_ns()
                rung = [key for key, due_ns in self._due.items() if due_ns <= now_ns]
                if rung:
                    rung.sort(key=self._due.__getitem__)
                    for key in rung:
                        del self._due[key]
                    return rung
                # Whoever sets an earlier time, wakes it; a later one is seen when it wakes.
                self._wakes_ns = min(self._due.values(), default=None)
                left_ns = None if self._wakes_ns is None else self._wakes_ns - now_ns
                self._changed.wait(None if left_ns is None else left_ns / 1e9)
        return None
