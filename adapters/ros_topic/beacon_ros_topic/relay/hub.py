"""The thread in which a topic side does what takes time, and takes the messages of all topics.

It sleeps until a bell rings: that of a group of subscriptions, that of the publishers, or its own.
Few bells serve many subscriptions, since a process may have no more than 1,024 files open.
"""

from __future__ import annotations

import atexit
import logging
import select
import threading
import weakref
from collections import deque
from collections.abc import Callable

from rclpy.context import Context

from beacon_ros.shutdown import at_shutdown
from beacon_ros_topic.relay.bells import Bell

__all__ = ["Drain", "Hub"]

_log = logging.getLogger(__name__)

_GROUPS = 64
"""While there are fewer subscriptions each has a bell of its own. With 1,000 of them each message
has 15 others looked at in vain, at 1.5 us each."""

_EXIT_WITHIN_S = 1.0

Drain = Callable[[], bool]
"""Takes some of what has come, and says whether there may be more."""


class Hub:
    """Thread rule: ``do``, ``wake`` and ``close`` from any thread; the rest from the hub's own.

    ``step`` is called first, after whatever has happened and after as many seconds as it returned
    (``None``: no need). ``on_end`` is the last call.
    """

    def __init__(
        self, context: Context, step: Callable[[], float | None], on_end: Callable[[], None]
    ) -> None:
        self._context, self._step, self._on_end = context, step, on_end
        self._epoll = select.epoll()
        self._own = Bell()
        self._epoll.register(self._own.fd, select.EPOLLIN)
        self._groups: list[list[Drain]] = []
        self._bells: list[Bell] = []
        self._by_fd: dict[int, int] = {}
        self._places: dict[Drain, int] = {}
        self._actions: deque[Callable[[], object]] = deque()
        self._thread = threading.Thread(target=self._run, name="beacon-ros-relay", daemon=True)
        self._closing = self._ended = False
        self._ringing = threading.Lock()

    @property
    def closing(self) -> bool:
        """Has it been told to end?"""
        return self._closing

    def start(self) -> None:
        """Begin."""
        _open.add(self)
        self._thread.start()

    def do(self, action: Callable[[], object]) -> None:
        """Have this done in the hub's thread, after all that was asked before."""
        self._actions.append(action)
        self._ring()

    def wake(self) -> None:
        """Let ``step`` be called soon."""
        self._ring()

    def add(self, drain: Drain) -> Bell:
        """The bell to ring when ``drain`` is to be called."""
        if len(self._groups) < _GROUPS:
            bell = Bell()
            self._bells.append(bell)
            self._groups.append([])
            self._by_fd[bell.fd] = len(self._groups) - 1
            self._epoll.register(bell.fd, select.EPOLLIN)
        place = min(range(len(self._groups)), key=lambda at: len(self._groups[at]))
        self._groups[place].append(drain)
        self._places[drain] = place
        return self._bells[place]

    def remove(self, drain: Drain) -> None:
        """It is not called any more."""
        self._groups[self._places.pop(drain)].remove(drain)

    def close(self, within_s: float) -> bool:
        """End it, and say whether it has ended. Called by its own thread, it ends afterwards."""
        self._closing = True
        if self._thread is threading.current_thread() or not self._thread.is_alive():
            return True
        self._ring()
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        stop_telling = at_shutdown(self._context, self._end_with_context)
        try:
            self._wait()
        except Exception:  # noqa: BLE001 - whatever it is, what is open must be ended
            _log.exception("the thread of a topic side ended")
        stop_telling()
        self._on_end()
        # What rings a bell is gone by now.
        with self._ringing:
            self._ended = True
        self._epoll.close()
        for bell in (self._own, *self._bells):
            bell.close()

    def _end_with_context(self) -> None:
        self._closing = True
        self._ring()

    def _wait(self) -> None:
        busy: list[Drain] = []
        while not self._closing:
            wait_s = self._step()
            rung = self._epoll.poll(0 if busy else -1 if wait_s is None else max(0.0, wait_s))
            ready = dict.fromkeys(busy)
            for fd, _ in rung:
                ready.update(self._answered(fd))
            self._act()
            busy = [drain for drain in ready if self._may_call(drain) and _safely(drain)]

    def _answered(self, fd: int) -> dict[Drain, None]:
        if fd == self._own.fd:
            self._own.clear()
            return {}
        place = self._by_fd[fd]
        self._bells[place].clear()
        return dict.fromkeys(self._groups[place])

    def _act(self) -> None:
        while self._actions and not self._closing:
            _safely(self._actions.popleft())

    def _may_call(self, drain: Drain) -> bool:
        return drain in self._places and not self._closing

    def _ring(self) -> None:
        with self._ringing:
            if not self._ended:
                self._own.ring()


def _safely(what: Callable[[], object]) -> object:
    """One topic's trouble is not that of the others."""
    try:
        return what()
    except Exception:  # noqa: BLE001 - it is for people to look at
        _log.exception("a topic side had trouble")
        return None


_open: weakref.WeakSet[Hub] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """A thread inside ROS while the interpreter is dismantled ends the process with SIGABRT."""
    for hub in list(_open):
        hub.close(_EXIT_WITHIN_S)
