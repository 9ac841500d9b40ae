"""The thread in which a topic side tells its watcher whatever there is to tell, in order.

So the watcher is never called from inside a method, nor from a thread of Zenoh's, which could not
receive anything while a watcher is busy.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue

__all__ = ["Teller"]

_log = logging.getLogger(__name__)


class Teller:
    """Thread rule: any thread; ``start`` once."""

    def __init__(self) -> None:
        self._tellings: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="beacon-rmw-relay", daemon=True)
        self._closed = False

    def start(self) -> None:
        """Begin to tell; what was left here before is told first."""
        self._thread.start()

    def tell(self, what: Callable[[], object]) -> None:
        """Have this called, after all that was left here before."""
        self._tellings.put(what)

    def close(self, within_s: float) -> None:
        """Tell nothing any more, and wait for what is being told, but not for ever. Idempotent."""
        self._closed = True
        self._tellings.put(None)
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(within_s)

    def _run(self) -> None:
        while (what := self._tellings.get()) is not None and not self._closed:
            try:
                what()
            except Exception:  # noqa: BLE001
                # Watchers do not raise; one that does must not cost what follows.
                _log.exception("the watcher raised")
