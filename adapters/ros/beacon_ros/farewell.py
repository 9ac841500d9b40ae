"""Publishing when ROS itself would not any more.

A program's ROS context is usually shut down before anything of the program gets to say goodbye:
on Ctrl-C by ROS's own signal handler. From then on rcl refuses to publish. The middleware below it
does not, as long as the publisher exists; so the last words go there directly.
"""

from __future__ import annotations

import ctypes as c
from collections.abc import Iterable

from rclpy.publisher import Publisher
from rclpy.utilities import get_rmw_implementation_identifier

__all__ = ["say_last"]


def say_last(publisher: Publisher, payloads: Iterable[bytes], within_s: float) -> bool:
    """Publish these, also after the context was shut down, and wait for readers to have them.

    Says whether all matched reliable readers have. Thread rule: any thread.
    """
    rmw = c.CDLL(f"lib{get_rmw_implementation_identifier()}.so")
    rmw.rmw_publish_serialized_message.argtypes = [c.c_void_p] * 3
    rmw.rmw_publisher_wait_for_all_acked.argtypes = [c.c_void_p, _Duration]
    get_handle = c.CDLL("librcl.so").rcl_publisher_get_rmw_handle
    get_handle.restype, get_handle.argtypes = c.c_void_p, [c.c_void_p]
    with publisher.handle:
        handle = get_handle(publisher.handle.pointer)
        if not handle:
            return False
        for payload in payloads:
            message = _Message(payload, len(payload), len(payload))
            rmw.rmw_publish_serialized_message(handle, c.addressof(message), None)
        seconds, rest = divmod(round(within_s * 1e9), 1_000_000_000)
        acknowledged: int = rmw.rmw_publisher_wait_for_all_acked(handle, _Duration(seconds, rest))
    return acknowledged == 0


class _Message(c.Structure):
    """``rmw_serialized_message_t``; its allocator is left empty, since nothing is allocated."""

    _fields_ = (
        ("data", c.c_char_p),
        ("length", c.c_size_t),
        ("capacity", c.c_size_t),
        ("allocator", c.c_void_p * 5),
    )


class _Duration(c.Structure):
    """``rmw_time_t``."""

    _fields_ = (("seconds", c.c_uint64), ("nanoseconds", c.c_uint64))
