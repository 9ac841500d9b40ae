"""Waiting for hundreds of subscriptions in one thread, at no cost while they are quiet.

A wait set is built anew for each wait, at a cost that grows with all that is in it. ROS can also
call a C function for each message that has come, in a thread of DDS. One of Python's would have to
wait there for Python's lock, which may be held by who waits for that thread. Its two arguments, a
pointer of one's own and a number, happen to be those of the system's ``eventfd_write``: so ROS is
told to call that, and no Python is involved until a thread wakes that waits for the eventfds.
"""

from __future__ import annotations

import ctypes as c
import os
from contextlib import suppress
from typing import Any

__all__ = ["Bell", "ring_at_event", "ring_at_message"]

_WRITE = c.cast(c.CDLL(None).eventfd_write, c.c_void_p)


class Bell:
    """An eventfd. Thread rule: any thread."""

    def __init__(self) -> None:
        self.fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)

    def ring(self) -> None:
        """Wake who waits for it."""
        with suppress(BlockingIOError):
            os.eventfd_write(self.fd, 1)

    def clear(self) -> None:
        """What rang so far is heard."""
        with suppress(BlockingIOError):
            os.eventfd_read(self.fd)

    def close(self) -> None:
        """Once nothing rings it any more. Not idempotent: the number may be another's then."""
        os.close(self.fd)


def ring_at_message(subscription: Any, bell: Bell | None) -> None:
    """Have this bell rung, or none, when this subscription (rclpy's handle) gets a message.

    When this has returned, one that was rung before is not rung any more. Thread rule: any thread.
    """
    _call("rcl_subscription_set_on_new_message_callback", subscription, bell)


def ring_at_event(event: Any, bell: Bell | None) -> None:
    """The same for a QoS event (rclpy's handle)."""
    _call("rcl_event_set_callback", event, bell)


def _call(name: str, handle: Any, bell: Bell | None) -> None:
    function = getattr(c.CDLL("librcl.so"), name)
    function.argtypes, function.restype = [c.c_void_p] * 3, c.c_int
    with handle:
        code = function(handle.pointer, bell and _WRITE, bell and bell.fd)
    if code:
        raise RuntimeError(f"{name} failed with {code}")
