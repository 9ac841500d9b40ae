"""Message types without generated code: raw bytes in, raw bytes out, no compiler needed.

Theory. rclpy asks a message class for one thing only, a capsule with a pointer to a
``rosidl_message_type_support_t``; the rest of a generated class serves typed messages. The
middleware reads from there the type's name and hash, which it announces and by which both ends
match, and a bound of its size. The functions that convert are never called for raw bytes. So the
three C structures are filled in here, by their layout in ROS 2 Jazzy (rosidl_runtime_c and
rosidl_typesupport_fastrtps_c); :func:`beacon_ros.environment.why_no_raw_types` tells where that
holds. What is made lives as long as the process: the middleware keeps pointers to it.
"""

from __future__ import annotations

import ctypes as c
import importlib
from collections.abc import Callable
from functools import cache
from typing import Any

from rclpy.type_support import check_for_type_support

from beacon_core.errors import ConfigError
from beacon_ros.environment import why_no_raw_types

__all__ = ["message_type", "raw_type"]


def message_type(full_name: str, type_hash: str) -> type[Any]:
    """The class of ``package/msg/Name``: the installed one, or one for raw bytes made now.

    Raises ``ConfigError`` if it cannot be imported and cannot be made. Thread rule: any thread.
    """
    package, folder, name = full_name.split("/")
    try:
        found: type[Any] = getattr(importlib.import_module(f"{package}.{folder}"), name)
        # Loads what is generated in C; without it rclpy's classes are empty.
        check_for_type_support(found)
    except Exception as error:  # not installed, too old to have the message, or broken
        if why := why_no_raw_types():
            raise ConfigError(f"{full_name} cannot be imported ({error}), and {why}") from error
        return raw_type(full_name, type_hash)
    return found


@cache
def raw_type(full_name: str, type_hash: str) -> type[Any]:
    """A class for ``create_subscription(..., raw=True)`` and for publishers that publish bytes.

    ``type_hash``: ``RIHS01_`` and 64 hexadecimal digits, as ``ros2 topic info -v`` shows it.
    """
    package, folder, name = full_name.split("/")
    library = _Runtime()
    getters = library.getters(full_name, type_hash)
    members = _Members(f"{package}__{folder}".encode(), name.encode(), 0, 8, False)
    introspection = _TypeSupport(
        _INTROSPECTION, c.addressof(members), library.own_handle_if_named, *getters
    )
    callbacks = _Callbacks(
        f"{package}::{folder}".encode(),
        name.encode(),
        _Serialize(lambda *_: False),
        _Serialize(lambda *_: False),
        _Size(lambda _: 0),
        _MaxSize(_unbounded),
    )
    handles = {_INTROSPECTION: c.addressof(introspection)}
    find = _Find(lambda _, identifier: handles.get(identifier))
    support = _TypeSupport(
        _FASTRTPS, c.addressof(callbacks), c.cast(find, c.c_void_p).value, *getters
    )
    handles[_FASTRTPS] = c.addressof(support)
    _kept.append((getters, members, introspection, callbacks, find, support))
    return _dressed(package, folder, name, c.addressof(support))


_INTROSPECTION = b"rosidl_typesupport_introspection_c"
_FASTRTPS = b"rosidl_typesupport_fastrtps_c"

_Getter = c.CFUNCTYPE(c.c_void_p, c.c_void_p)
_Find = c.CFUNCTYPE(c.c_void_p, c.c_void_p, c.c_char_p)
_Serialize = c.CFUNCTYPE(c.c_bool, c.c_void_p, c.c_void_p)
_Size = c.CFUNCTYPE(c.c_uint32, c.c_void_p)
_MaxSize = c.CFUNCTYPE(c.c_size_t, c.c_void_p)

_kept: list[object] = []


class _TypeSupport(c.Structure):
    """``rosidl_message_type_support_t``."""

    _fields_ = (
        ("identifier", c.c_char_p),
        ("data", c.c_void_p),
        ("find", c.c_void_p),
        ("type_hash", _Getter),
        ("description", _Getter),
        ("sources", _Getter),
    )


class _Callbacks(c.Structure):
    """``message_type_support_callbacks_t`` of rosidl_typesupport_fastrtps_c."""

    _fields_ = (
        ("namespace", c.c_char_p),
        ("name", c.c_char_p),
        ("serialize", _Serialize),
        ("deserialize", _Serialize),
        ("size", _Size),
        ("max_size", _MaxSize),
        ("key", c.c_void_p),
    )


class _Members(c.Structure):
    """``rosidl_typesupport_introspection_c__MessageMembers``, of a message without any."""

    _fields_ = (
        ("namespace", c.c_char_p),
        ("name", c.c_char_p),
        ("count", c.c_uint32),
        ("size_of", c.c_size_t),
        ("has_key", c.c_bool),
        ("members", c.c_void_p),
        ("init", c.c_void_p),
        ("fini", c.c_void_p),
    )


class _Hash(c.Structure):
    """``rosidl_type_hash_t``."""

    _fields_ = (("version", c.c_uint8), ("value", c.c_uint8 * 32))


class _Runtime:
    """The few functions of librosidl_runtime_c that are needed."""

    def __init__(self) -> None:
        library = c.CDLL("librosidl_runtime_c.so")
        prefix = "rosidl_runtime_c__type_description__"
        self._create_description = library[f"{prefix}TypeDescription__create"]
        self._create_description.restype = c.c_void_p
        self._create_sources = library[f"{prefix}TypeSource__Sequence__create"]
        self._create_sources.restype = c.c_void_p
        self._create_sources.argtypes = [c.c_size_t]
        self._assign = library.rosidl_runtime_c__String__assign
        self._assign.restype = c.c_bool
        self._assign.argtypes = [c.c_void_p, c.c_char_p]
        self.own_handle_if_named = c.cast(
            library.get_message_typesupport_handle_function, c.c_void_p
        ).value

    def getters(self, full_name: str, type_hash: str) -> tuple[Callable[[int], int], ...]:
        """What gives out the hash, the description (of which only the name is filled in) and the
        sources (none)."""
        hashed = _Hash(1)
        hashed.value[:] = bytes.fromhex(type_hash.removeprefix("RIHS01_"))
        description = self._create_description()
        # The name is the first member of the first member.
        self._assign(description, full_name.encode())
        sources = self._create_sources(0)
        _kept.append(hashed)
        address = c.addressof(hashed)
        return (
            _Getter(lambda _: address),
            _Getter(lambda _: description),
            _Getter(lambda _: sources),
        )


def _unbounded(bounds_info: int) -> int:
    c.c_char.from_address(bounds_info).value = b"\0"
    return 1024


def _dressed(package: str, folder: str, name: str, support: int) -> type[Any]:
    """A class with the attributes that rclpy looks for."""
    new_capsule = c.pythonapi.PyCapsule_New
    new_capsule.restype = c.py_object
    new_capsule.argtypes = [c.c_void_p, c.c_char_p, c.c_void_p]
    converters = dict.fromkeys(
        ("_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE"), 0
    )
    attributes = {"_TYPE_SUPPORT": new_capsule(support, None, None), **converters}
    meta = type(f"Metaclass_{name}", (type,), attributes)
    made: type[Any] = meta(name, (), {"__module__": f"{package}.{folder}", "__slots__": ()})
    return made
