"""An executor in a thread of its own, for what only an executor can do: services and timers.

Its ``spin`` is left alone: with some builds of rclpy (wheels for manylinux_2_28) it takes a whole
core when idle, and does not return. A finite time-out avoids that; and the order of shutting down
is the one that leaves no thread behind (any other ended the process with SIGABRT, 10 times of 10).
"""

from __future__ import annotations

import threading

from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future

__all__ = ["Spinner"]

_FOREVER_S = 1e6


class Spinner:
    """Thread rule: any thread; ``close`` is idempotent, and not to be called from a callback."""

    def __init__(self, context: Context, *nodes: Node) -> None:
        self._executor = EventsExecutor(context=context)
        for node in nodes:
            self._executor.add_node(node)
        self._stop: Future[None] = Future()
        self._thread = threading.Thread(target=self._spin, name="beacon-ros-spinner", daemon=True)
        self._closed = False
        self._thread.start()

    def add_node(self, node: Node) -> None:
        """Serve this node too."""
        self._executor.add_node(node)

    def remove_node(self, node: Node) -> None:
        """Serve it no longer; then it may be destroyed."""
        self._executor.remove_node(node)

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
        self._executor.spin_until_future_complete(self._stop, timeout_sec=_FOREVER_S)
