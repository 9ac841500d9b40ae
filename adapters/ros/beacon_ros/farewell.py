"""Publishing when ROS itself would not any more.

A program's ROS context is usually shut down before anything of the program gets to say goodbye:
on Ctrl-C by ROS's own signal handler. From then on rcl refuses to publish. The middleware below it
does not, as long as the publisher exists; so the last words go there directly.
"""

from __future__ import annotations

import ctypes as c
import time
from collections.abc import Iterable

from rclpy.exceptions import InvalidHandle
from rclpy.publisher import Publisher
from rclpy.utilities import get_rmw_implementation_identifier

from beacon_ros.errors import said_by_ros

__all__ = ["say_last"]


def say_last(publisher: Publisher, payloads: Iterable[bytes], within_s: float) -> bool:
    """Publish these, also after the context was shut down, and wait for readers to have them.

    Says whether all matched reliable readers have. What cannot be said in that time is left out: a
    reader that hangs makes each of many words slow. Thread rule: any thread.
    """
    deadline = time.monotonic() + within_s
    try:
        with publisher.handle:
            all_said = _say_all(publisher.handle.pointer, payloads, deadline)
    except InvalidHandle:
        return False
    said_by_ros()  # what may have failed is told by the result
    return all_said


def _say_all(publisher: int, payloads: Iterable[bytes], deadline: float) -> bool:
    rmw = c.CDLL(f"lib{get_rmw_implementation_identifier()}.so")
    rmw.rmw_publish_serialized_message.argtypes = [c.c_void_p] * 3
    rmw.rmw_publisher_wait_for_all_acked.argtypes = [c.c_void_p, _Duration]
    get_handle = c.CDLL("librcl.so").rcl_publisher_get_rmw_handle
    get_handle.restype, get_handle.argtypes = c.c_void_p, [c.c_void_p]
    handle = get_handle(publisher)
    if not handle:
        return False
    for payload in payloads:
        message = _Message(payload, len(payload), len(payload))
        failed = rmw.rmw_publish_serialized_message(handle, c.addressof(message), None)
        if failed or time.monotonic() > deadline:
            return False
    left_ns = max(0, round((deadline - time.monotonic()) * 1e9))
    left = _Duration(*divmod(left_ns, 1_000_000_000))
    acknowledged: int = rmw.rmw_publisher_wait_for_all_acked(handle, left)
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
