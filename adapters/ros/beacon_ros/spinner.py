"""An executor in a thread of its own, for what only an executor can do: services and timers.

Its ``spin`` is left alone: with some builds of rclpy (wheels for manylinux_2_28) it takes a whole
core when idle, and does not return. A finite time-out avoids that; and the order of shutting down
is the one that leaves no thread behind (any other ended the process with SIGABRT, 10 times of 10).

What changes the set of nodes is done in the executor's own thread: it iterates over the set, and
ended with "Set changed size during iteration" when nodes were added from outside.
"""

from __future__ import annotations

import atexit
import logging
import threading
import weakref
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

__all__ = ["Spinner"]

_log = logging.getLogger(__name__)

_FOREVER_S = 1e6
_RUN_WITHIN_S = 1.0
_EXIT_WITHIN_S = 1.0


class Spinner:
    """Thread rule: any thread; ``close`` is idempotent, and not to be called from a callback."""

    def __init__(self, context: Context, *nodes: Node) -> None:
        """Serves the nodes from now on."""
        self._context = context
        self._executor = EventsExecutor(context=context)
        for node in nodes:
            self._executor.add_node(node)
        self._stop: Any = Future()
        self._thread = threading.Thread(target=self._spin, name="beacon-ros-spinner", daemon=True)
        self._closed = False
        _open.add(self)
        self._thread.start()

    def add_node(self, node: Node) -> None:
        """Serve this node too."""
        self.run(lambda: self._executor.add_node(node))

    def remove_node(self, node: Node) -> None:
        """Serve it no longer; then it may be destroyed."""
        self.run(lambda: self._executor.remove_node(node))

    def run(self, action: Callable[[], object], within_s: float = _RUN_WITHIN_S) -> bool:
        """Let the spinner's thread do this between two callbacks, wait for it, and say whether it
        was done in time. Raises what ``action`` raises. After ``close`` nothing is done."""
        if threading.current_thread() is self._thread:
            action()
            return True
        work = _Work(action)
        if not self._closed:
            self._executor.create_task(work)
        return work.wait(within_s if self._thread.is_alive() and not self._closed else 0.0)

    def close(self, within_s: float) -> bool:
        """Stop, and say whether it has. Before the nodes are destroyed and the context is shut
        down."""
        if not self._closed:
            self._closed = True
            self._stop.set_result(None)
        self._thread.join(within_s)
        if self._thread.is_alive():
            return False
        self._executor.shutdown()
        return True

    def _spin(self) -> None:
        while not self._stop.done():
            try:
                self._executor.spin_until_future_complete(self._stop, timeout_sec=_FOREVER_S)
            except Exception:  # noqa: BLE001
                # An executor passes on what a callback raises; the other nodes are not to blame.
                if self._closed or not self._context.ok():
                    return
                _log.exception("a callback of a node failed")


class _Work:
    """Something to do in another thread, once."""

    def __init__(self, action: Callable[[], object]) -> None:
        self._action = action
        self._done = threading.Event()
        self._error: Exception | None = None

    def __call__(self) -> None:
        try:
            self._action()
        except Exception as error:  # noqa: BLE001 - raised again where it was asked for
            self._error = error
        self._done.set()

    def wait(self, within_s: float) -> bool:
        done = self._done.wait(within_s)
        if self._error is not None:
            raise self._error
        return done


_open: weakref.WeakSet[Spinner] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """A thread inside ROS while the interpreter is dismantled ends the process with SIGABRT."""
    for spinner in list(_open):
        spinner.close(_EXIT_WITHIN_S)
