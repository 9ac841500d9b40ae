"""What ROS's C libraries say went wrong, for those who call them past rclpy."""

from __future__ import annotations

import ctypes as c

__all__ = ["said_by_ros"]


def said_by_ros() -> str:
    """What the last failed call of this thread said, which is then forgotten; ``""`` if nothing.

    Left where it is, ROS would write both to stderr when the next call fails. Thread rule: any.
    """
    utils = c.CDLL("librcutils.so")
    said = ""
    if utils.rcutils_error_is_set():
        get = utils.rcutils_get_error_string
        get.restype = _Text
        said = get().text.decode(errors="replace")
    utils.rcutils_reset_error()
    return said


class _Text(c.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = (("text", c.c_char * 1024),)
