"""What can be configured of a ROS network beside a relay, and of a conduit over ROS topics."""

from __future__ import annotations

import re
from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_ros.environment import MAX_DOMAIN

__all__ = ["DEFAULT_PREFIX", "RosConduitOptions", "RosNetworkOptions"]

DEFAULT_PREFIX = "/beacon_relay"
"""Where the ends of a conduit meet unless something else is said."""

_PREFIX = re.compile(r"(?=.{1,200}$)(/[A-Za-z_][A-Za-z0-9_]*)+")
_MAX_DEPTH = 10_000


def _whole(lowest: int, highest: int) -> Any:
    def check(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
        if type(value) is not int or not lowest <= value <= highest:
            right = f"a whole number, {lowest} to {highest}"
            raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")

    return check


def _prefix(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or not _PREFIX.fullmatch(value):
        right = f"a full name, such as {DEFAULT_PREFIX}"
        raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


@attrs.frozen
class RosNetworkOptions:
    """``network: ros`` of a relay. ``ConfigError`` for a value that cannot be."""

    domain_id: int | None = attrs.field(
        default=None, validator=attrs.validators.optional(_whole(0, MAX_DOMAIN))
    )
    """``None``: that of the environment, ``ROS_DOMAIN_ID``."""
    depth: int = attrs.field(default=10, validator=_whole(1, _MAX_DEPTH))
    """Of a volatile topic at the far end: DDS does not tell what its publishers have. 10 is ROS's
    own default."""
    queue: int = attrs.field(default=100, validator=_whole(1, _MAX_DEPTH))
    """Messages of a topic that wait in DDS at most, to be taken here or to be acknowledged there;
    what comes then pushes the oldest out. Costs memory only while they wait."""


@attrs.frozen
class RosConduitOptions:
    """``conduit: ros_topic`` of a relay. ``ConfigError`` for a value that cannot be."""

    prefix: str = attrs.field(default=DEFAULT_PREFIX, validator=_prefix)
    """Ends with the same prefix and domain hear each other."""
    domain_id: int | None = attrs.field(
        default=None, validator=attrs.validators.optional(_whole(0, MAX_DOMAIN))
    )
    """``None``: that of the environment, ``ROS_DOMAIN_ID``."""
    depth: int = attrs.field(default=100, validator=_whole(1, _MAX_DEPTH))
    """Frames that wait to be acknowledged at most; what comes then pushes the oldest out, and the
    relay asks for it again."""
