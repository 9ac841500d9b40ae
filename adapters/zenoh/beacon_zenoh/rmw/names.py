"""ROS names as Zenoh's keys have them.

A key is a row of chunks with ``/`` between them, and a ROS name has ``/`` in it. Where a name must
be one chunk, its ``/`` become ``%``; nothing at all is ``%`` too, as a chunk cannot be empty. A
type's name is that of the C++ type which DDS knows: ``std_msgs/msg/String`` is
``std_msgs::msg::dds_::String_``.
"""

from __future__ import annotations

import re

__all__ = [
    "MAX_NAME_LENGTH",
    "dds_type",
    "is_name",
    "is_namespace",
    "is_node_name",
    "is_type_name",
    "mangled",
    "ros_type",
    "unmangled",
]

MAX_NAME_LENGTH = 255
"""What ROS allows a namespace and a node's name to have together, and a topic's name too."""

_TOKEN = "[A-Za-z_][A-Za-z0-9_]*"  # noqa: S105 - of a name
_NAME = re.compile(rf"(/{_TOKEN})+")
_NODE = re.compile(_TOKEN)
_TYPE = re.compile(r"([A-Za-z]\w*)/(msg|srv|action)/([A-Za-z]\w*)", re.ASCII)
_DDS_TYPE = re.compile(r"([A-Za-z]\w*)::(msg|srv|action)::dds_::([A-Za-z]\w*)_", re.ASCII)


def mangled(name: str) -> str:
    """The name as one chunk of a key."""
    return name.replace("/", "%") or "%"


def unmangled(chunk: str) -> str:
    """The name that was made a chunk; that of nothing is ``/``."""
    return chunk.replace("%", "/")


def dds_type(type_name: str) -> str:
    """How ``package/msg/Name`` is written in keys. Only for what :func:`is_type_name` takes."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(chunk: str) -> str | None:
    """``package/msg/Name`` for a type as written in keys; ``None`` for anything else."""
    found = _DDS_TYPE.fullmatch(chunk)
    return f"{found[1]}/{found[2]}/{found[3]}" if found else None


def is_name(name: str) -> bool:
    """Is it the full name of a topic, a service or a node?"""
    return len(name) <= MAX_NAME_LENGTH and _NAME.fullmatch(name) is not None


def is_namespace(name: str) -> bool:
    """Is it a namespace, or an enclave? ``/`` is the root."""
    return name == "/" or is_name(name)


def is_node_name(name: str) -> bool:
    """Is it the name of a node, without its namespace?"""
    return len(name) <= MAX_NAME_LENGTH and _NODE.fullmatch(name) is not None


def is_type_name(name: str) -> bool:
    """Is it a type, such as ``std_msgs/msg/String``?"""
    return _TYPE.fullmatch(name) is not None
