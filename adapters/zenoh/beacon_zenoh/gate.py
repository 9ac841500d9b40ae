"""Between a carrier's threads and a sink: what makes "after ``close``, no call" true."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from threading import get_ident
from typing import TypeVar

from beacon_core.ports.sink import HintSink

__all__ = ["Gate"]

_log = logging.getLogger(__name__)

_R = TypeVar("_R")


class Gate:
    """Lets one call at a time through to the sink, until it is shut.

    Thread rule: any thread. A call may come from within another of the same thread only to
    :meth:`shut`.
    """

    def __init__(self) -> None:
        self.errors = 0
        """Calls in which the sink raised. Sinks do not; one that does must not end a source."""
        self.is_shut = False
        self._sink: HintSink | None = None
        self._held = threading.Lock()
        self._inside = 0  # the thread that is in a call

    def lead_to(self, sink: HintSink) -> None:
        """Say where it leads, before anything is let through. Only the first call counts."""
        if self._sink is None:
            self._sink = sink

    def let(self, call: Callable[[HintSink], _R]) -> _R | None:
        """Make the call. ``None`` if the gate is shut, or leads nowhere yet, or the sink raised."""
        with self._held:
            if self.is_shut or self._sink is None:
                return None
            self._inside = get_ident()
            try:
                return call(self._sink)
            except Exception:  # noqa: BLE001 - see errors
                self.errors += 1
                _log.exception("the sink raised")
                return None
            finally:
                self._inside = 0

    def shut(self, within_s: float) -> float:
        """Let nothing through any more, and wait for a call that is under way, but not for ever.

        Returns the seconds it took; a negative number from within a call, which is not waited for.
        """
        began = time.monotonic()
        inside = self._inside == get_ident()
        # A sink that hangs must not hang us: it finds the gate shut when it is through.
        held = not inside and self._held.acquire(timeout=within_s)
        self.is_shut = True
        if held:
            self._held.release()
        return -1.0 if inside else time.monotonic() - began
