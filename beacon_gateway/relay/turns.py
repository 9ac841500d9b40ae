"""One at a time, in order, and nobody waits: who comes while others work, leaves its work to them.

Theory. What happens to an end, happens in many threads: messages in the network's, frames in the
conduit's, time in the waker's. The core takes one at a time, and what it asks to be done must be
done before it is asked again. With a lock held over all of it, one slow send would hold up
everybody. So whoever comes puts down its job, and then does what has been put down, if nobody is
doing so already ("flat combining": Hendler et al., SPAA 2010). In the usual case it does its own
job at once, in its own thread: that costs half a microsecond, where handing it to another thread
costs fifty.

So that what is put down stays bounded, whoever brings a large one, or finds many, waits for a
little while until it can help.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

__all__ = ["HEAVY_BYTES", "Turns"]

_log = logging.getLogger(__name__)

_T = TypeVar("_T")

HEAVY_BYTES = 64 * 1024
"""A job that holds more than this is not put down and left: who brings it, waits a little."""

_MANY = 256
"""So many jobs may be left to others: with less than 64 KiB each, 16 MiB."""

_PATIENCE_S = 0.05
"""Who has waited so long, leaves its job all the same."""

_working = threading.local()


class Turns:
    """Thread rule: any thread. A job may take turns again: it comes after those before it."""

    def __init__(self) -> None:
        self._jobs: deque[tuple[Callable[..., object], tuple[Any, ...]]] = deque()
        self._busy = threading.Lock()

    def take(self, job: Callable[..., object], *args: Any, size: int = 0) -> None:
        """Have the job done, after those that were put down before; maybe later, by another thread.

        ``size``: bytes that it holds. What it raises is logged.
        """
        self._jobs.append((job, args))
        if size > HEAVY_BYTES or len(self._jobs) > _MANY:
            self._take_patiently()
        elif self._busy.acquire(blocking=False):
            self._work()

    def ask(self, job: Callable[[], _T], within_s: float = 1.0) -> _T:
        """What the job returns, or raises; ``TimeoutError`` if its turn does not come.

        Not from within a job.
        """
        answer: Future[_T] = Future()

        def answered() -> None:
            try:
                answer.set_result(job())
            except Exception as error:  # noqa: BLE001 - it is the asker's
                answer.set_exception(error)

        self.take(answered)
        return answer.result(within_s)

    def _take_patiently(self) -> None:
        # Who is at work already may be waited for by whom it would wait for.
        patience_s = 0.0 if getattr(_working, "depth", 0) else _PATIENCE_S
        if self._busy.acquire(timeout=patience_s):
            self._work()

    def _work(self) -> None:
        """Do all that has been put down; called with the lock held."""
        jobs = self._jobs
        before, _working.depth = getattr(_working, "depth", 0), 1
        try:
            while True:
                try:
                    while jobs:
                        job, args = jobs.popleft()
                        job(*args)
                except Exception:  # noqa: BLE001 - what one job breaks, the next need not suffer
                    _log.exception("a defect of the relay, or of what it is connected to")
                finally:
                    self._busy.release()
                # Whoever came between the last look and the release, has left its job to us.
                if not jobs or not self._busy.acquire(blocking=False):
                    return
        finally:
            _working.depth = before
