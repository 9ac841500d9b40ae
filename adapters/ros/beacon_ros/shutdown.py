"""Being told that a ROS context is shut down.

rclpy keeps methods that it shall call weakly: it leaves out every second of those whose objects go
while it calls them, and writes to stderr about those that are left when the interpreter ends.
Functions it keeps as long as the context lives. So here each context is given one function, and who
wants to be told is told by that, for as long as it wants.

It calls with the context's lock held. So what is told must not ask the context anything, not even
whether it is ``ok``, nor wait for a lock under which somebody else might.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from functools import partial

from rclpy.context import Context

__all__ = ["at_shutdown"]

_Callback = Callable[[], None]


def at_shutdown(context: Context, callback: _Callback) -> _Callback:
    """Call back when this program shuts the context down; returns what undoes that.

    ROS's signal handler shuts contexts down without telling anybody. Thread rule: any thread.
    """
    token = object()
    with _lock:
        callbacks = _wanted.get(context)
        first = callbacks is None
        if callbacks is None:
            callbacks = _wanted[context] = {}
        callbacks[token] = callback
    if first:
        context.on_shutdown(partial(_tell, callbacks))

    def stop() -> None:
        callbacks.pop(token, None)

    return stop


_lock = threading.Lock()
_wanted: weakref.WeakKeyDictionary[Context, dict[object, _Callback]] = weakref.WeakKeyDictionary()


def _tell(callbacks: dict[object, _Callback]) -> None:
    for callback in [*callbacks.values()]:
        callback()
