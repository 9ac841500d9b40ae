"""A thread that waits on a ROS wait set of its own, and is ended in an order that ROS survives.

Everything that the owner is called with is called in this thread: it needs no lock against itself,
and once the thread has ended no call can follow. At the interpreter's exit what is still open is
ended first: a thread inside ROS while the interpreter is dismantled ends the process with SIGABRT.
"""

from __future__ import annotations

import atexit
import ctypes as c
import logging
import threading
import weakref
from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

from beacon_ros.shutdown import at_shutdown

__all__ = ["CONTEXT_ENDED", "NODE_ENDED", "Event", "Waiter"]

_log = logging.getLogger(__name__)

CONTEXT_ENDED = "the ROS context was shut down"
NODE_ENDED = "its ROS node was destroyed"

_EXIT_WITHIN_S = 1.0

Event = tuple[Any, Callable[[Any], None]]
"""rclpy's handle of a QoS event, and what to do with its status."""


class Waiter:
    """Thread rule: ``start`` once; ``wake`` and ``close`` from any thread.

    ``step`` is called first, after each ``wake`` and after as many seconds as it returned
    (``None``: no need). ``on_end`` is the last call, with why it ended by itself, ``""`` if it was
    closed. The context must live until then.
    """

    def __init__(
        self,
        context: Context,
        step: Callable[[], float | None],
        on_end: Callable[[str], None],
        *events: Event,
        subscription: Any = None,
        drain: Callable[[], bool] = lambda: False,
        graph_of: Node | None = None,
    ) -> None:
        """``drain`` takes what ``subscription`` holds, and says whether there may be more.
        ``graph_of``: a change of the ROS graph wakes it too; the node must outlive the thread."""
        self._context = context
        self._step = step
        self._on_end = on_end
        self._events = events
        self._subscription = subscription
        self._drain = drain
        self._graph_of = graph_of
        self._guard = _rclpy.GuardCondition(context.handle)
        self._thread = threading.Thread(target=self._run, name="beacon-ros", daemon=True)
        self._closing = self._context_ended = False

    @property
    def closing(self) -> bool:
        """Has it been told to end?"""
        return self._closing

    def start(self) -> None:
        """Begin to wait."""
        _open.add(self)
        self._thread.start()

    def wake(self) -> None:
        """Let ``step`` be called soon."""
        if self._thread.is_alive():
            self._guard.trigger_guard_condition()

    def close(self, within_s: float) -> bool:
        """End it, and say whether it has ended. Called by its own thread, it ends afterwards."""
        self._closing = True
        self.wake()
        if self._thread is threading.current_thread() or not self._thread.is_alive():
            return True
        self._thread.join(within_s)
        return not self._thread.is_alive()

    def end_with_context(self) -> None:
        """The context has been shut down: it is told here if nothing else tells it."""
        self._context_ended = True
        self._guard.trigger_guard_condition()

    def _run(self) -> None:
        stop_telling = at_shutdown(self._context, self.end_with_context)
        error = CONTEXT_ENDED
        try:
            self._wait()
        except Exception as failure:  # noqa: BLE001 - whatever rclpy raises when its things end
            error = self._explained(failure)
        stop_telling()
        for handle, _ in self._events:
            handle.destroy_when_not_in_use()
        if self._subscription is not None:
            self._subscription.destroy_when_not_in_use()
        self._on_end("" if self._closing else error)

    def _explained(self, failure: Exception) -> str:
        if self._context_ended:
            return CONTEXT_ENDED
        if isinstance(failure, InvalidHandle):
            return NODE_ENDED
        if not self._context.ok():
            return CONTEXT_ENDED
        if not self._closing:
            _log.exception("a thread of the ROS adapter ended")
        return f"reading ended: {failure}"

    def _wait(self) -> None:
        subscriptions = 0 if self._subscription is None else 1
        guards = 1 if self._graph_of is None else 2
        waits = _rclpy.WaitSet(
            subscriptions, guards, 0, 0, 0, len(self._events), self._context.handle
        )
        more = False
        while not (self._closing or self._context_ended):
            wait_s = self._step()
            waits.clear_entities()
            if self._subscription is not None:
                waits.add_subscription(self._subscription)
            waits.add_guard_condition(self._guard)
            if self._graph_of is not None:
                _add_graph(waits, self._graph_of)
            places = [waits.add_event(handle) for handle, _ in self._events]
            waits.wait(0 if more else -1 if wait_s is None else max(0, round(wait_s * 1e9)))
            more = self._drain()
            for place, (handle, tell) in zip(places, self._events, strict=True):
                if waits.is_ready("event", place):
                    tell(handle.take_event())
        waits.destroy_when_not_in_use()


def _add_graph(waits: Any, node: Node) -> None:
    """What rclpy does not offer: to wait for a change of the graph."""
    rcl = c.CDLL("librcl.so")
    guard_of, add = rcl.rcl_node_get_graph_guard_condition, rcl.rcl_wait_set_add_guard_condition
    guard_of.argtypes, guard_of.restype = [c.c_void_p], c.c_void_p
    add.argtypes = [c.c_void_p] * 3
    with node.handle:
        add(waits.pointer, guard_of(node.handle.pointer), None)


_open: weakref.WeakSet[Waiter] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for waiter in list(_open):
        waiter.close(_EXIT_WITHIN_S)
