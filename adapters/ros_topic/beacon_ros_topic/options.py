"""What can be configured of a topic."""

from __future__ import annotations

import re
from typing import Any, Literal

import attrs

from beacon_core.errors import ConfigError
from beacon_ros.environment import MAX_DOMAIN

__all__ = ["DEFAULT_TOPIC", "Durability", "Reliability", "RosTopicOptions"]

DEFAULT_TOPIC = "/ros2_medkit/discovery"
"""Where ros2_medkit's gateways listen too."""

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]

_TOPIC = re.compile(r"(?=.{1,247}$)(/[A-Za-z_][A-Za-z0-9_]*)+")
"""ROS takes 247 characters at most."""

_MAX_DEPTH = 1_000_000


def _complain(attribute: attrs.Attribute[Any], value: object, right: str) -> None:
    raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


def _topic(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or not _TOPIC.fullmatch(value):
        _complain(attribute, value, f"a full topic name, such as {DEFAULT_TOPIC}")


def _one_of(*words: str) -> Any:
    def check(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
        if value not in words:
            _complain(attribute, value, f"one of {', '.join(words)}")

    return check


def _whole(lowest: int, highest: int) -> Any:
    def check(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
        if type(value) is not int or not lowest <= value <= highest:
            _complain(attribute, value, f"a whole number, {lowest} to {highest}")

    return check


@attrs.frozen
class RosTopicOptions:
    """``adapter: ros_topic`` in a configuration, of a source or of an announcer.

    ``ConfigError`` for a value that cannot be.
    """

    topic: str = attrs.field(default=DEFAULT_TOPIC, validator=_topic)
    domain_id: int | None = attrs.field(
        default=None, validator=attrs.validators.optional(_whole(0, MAX_DOMAIN))
    )
    """``None``: that of the environment, ``ROS_DOMAIN_ID``."""
    reliability: Reliability = attrs.field(
        default="reliable", validator=_one_of("reliable", "best_effort")
    )
    """A reliable source does not hear best-effort publishers; a best-effort one hears all, and may
    lose some."""
    durability: Durability = attrs.field(
        default="volatile", validator=_one_of("volatile", "transient_local")
    )
    """A transient-local source hears transient-local publishers only, and of those also what they
    said before it came."""
    depth: int = attrs.field(default=10_000, validator=_whole(1, _MAX_DEPTH))
    """Messages that wait to be read (or, of an announcer, to be acknowledged) at most; what comes
    then pushes the oldest out. Costs memory only while they wait."""
