"""From the type of a route to what ROS makes a publisher or a subscription of."""

from __future__ import annotations

import re
from typing import Any

from beacon_core.errors import ConfigError
from beacon_core.relay.values import TopicType
from beacon_ros.environment import why_no_raw_types
from beacon_ros.rawtype import message_type, raw_type

__all__ = ["type_for"]

_NAME = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Za-z][A-Za-z0-9_]*")
_HASH = re.compile(r"RIHS01_[0-9a-f]{64}")


def type_for(of: TopicType) -> type[Any]:
    """A class for raw bytes of this type; ``ConfigError`` with the reason if there can be none.

    One made at run time, with exactly this hash, wherever that is possible: what is installed under
    the name may be of another version. Thread rule: any thread.
    """
    if not _NAME.fullmatch(of.name):
        raise ConfigError(
            f"{of.name!r} is no name of a ROS message type, such as std_msgs/msg/Int8"
        )
    if not _HASH.fullmatch(of.digest):
        raise ConfigError(
            f"{of.digest!r} is no hash of a ROS type: RIHS01_ and 64 hexadecimal digits"
        )
    if why_no_raw_types():
        return message_type(of.name, of.digest)
    return raw_type(of.name, of.digest)
