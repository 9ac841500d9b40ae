"""What waits to be sent: capped in bytes, and put by a thread of its own.

Who sends a large frame, or any while the carrier is slow, shall not wait for the carrier: he leaves
it here. A frame that is sent again while it waits still does not wait twice: on a slow link the
other side asks for what is only late, and would slow it down the more.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

__all__ = ["Outbox"]


class Outbox:
    """Thread rule: any thread. ``put`` is called in the outbox's own."""

    def __init__(self, most_bytes: int, put: Callable[[bytes, bytes], bool]) -> None:
        """``put(header, payload)`` may take its time; ``False``: it was slow, or not possible."""
        self.busy = False
        """Something waits here, or the last one was slow: what follows must wait behind it."""
        self._most_bytes = most_bytes
        self._put = put
        self._changed = threading.Condition()
        self._waiting: dict[tuple[bytes, int], bytes] = {}
        self._bytes = 0
        self._closed = False
        self._thread: threading.Thread | None = None

    def offer(self, header: bytes, payload: bytes) -> bool:
        """Leave a frame. ``False`` if there is no room for it."""
        size = len(header) + len(payload)
        # The payload is kept as long as its address is.
        key = (header, id(payload))
        with self._changed:
            if key in self._waiting:
                return True
            if self._closed or self._bytes + size > self._most_bytes:
                return False
            self._waiting[key] = payload
            self._bytes += size
            self.busy = True
            self._begin()
            self._changed.notify()
        return True

    def clear(self) -> None:
        """Forget what waits: there is nobody to send it to."""
        with self._changed:
            self._bytes -= sum(len(h) + len(p) for (h, _), p in self._waiting.items())
            self._waiting.clear()

    def close(self, within_s: float) -> None:
        """Forget what waits, and wait for what is being put, but not for ever. Idempotent."""
        with self._changed:
            self._closed = True
            self._waiting.clear()
            self._changed.notify()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(within_s)

    def _begin(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="beacon-outbox", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        while (frame := self._next()) is not None:
            header, payload = frame
            swift = self._put(header, payload)
            with self._changed:
                self._bytes -= len(header) + len(payload)
                self.busy = bool(self._waiting) or not swift

    def _next(self) -> tuple[bytes, bytes] | None:
        with self._changed:
            while not self._waiting and not self._closed:
                self._changed.wait()
            if self._closed:
                return None
            key = next(iter(self._waiting))
            return key[0], self._waiting.pop(key)
