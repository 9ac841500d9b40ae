"""What can be configured of ROS 2 over Zenoh, beside the session."""

from __future__ import annotations

from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_zenoh.options import SessionOptions
from beacon_zenoh.rmw.keys import MAX_DOMAIN
from beacon_zenoh.rmw.names import is_name, is_namespace

__all__ = ["DEFAULT_TOPIC", "RmwOptions", "RmwSessionOptions"]

DEFAULT_TOPIC = "/ros2_medkit/discovery"
"""Where ros2_medkit's gateways listen too."""

_MAX_DOMAINS = 256


def _complain(attribute: attrs.Attribute[Any], value: object, right: str) -> None:
    raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


def _domains(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    right = f"a list of 1 to {_MAX_DOMAINS} domains such as [0, 7], each 0 to {MAX_DOMAIN}"
    if not isinstance(value, tuple) or not 1 <= len(value) <= _MAX_DOMAINS:
        _complain(attribute, value, right)
        return
    for one in value:
        if type(one) is not int or not 0 <= one <= MAX_DOMAIN or value.count(one) > 1:
            _complain(attribute, one, f"{right}, and each once")


def _topic(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or not is_name(value):
        _complain(attribute, value, f"a full topic name, such as {DEFAULT_TOPIC}")


def _namespaces(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    right = "a list of namespaces such as ['/fleet']"
    if not isinstance(value, tuple):
        _complain(attribute, value, right)
        return
    for one in value:
        if not isinstance(one, str) or not is_namespace(one):
            _complain(attribute, one, right)


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


@attrs.frozen
class RmwSessionOptions(SessionOptions):
    """Where robots are that run rmw_zenoh, and which of them are meant; for topics and parameters.

    Without a ``mode`` sources and announcers are clients, of the router that rmw_zenoh's nodes
    have: ``rmw_zenohd`` listens at port 7447. ``ConfigError`` for a value that cannot be.
    """

    ros_domain_ids: tuple[int, ...] = attrs.field(
        default=(0,), converter=_tuple, validator=_domains
    )
    """``ROS_DOMAIN_ID`` of those to be heard, or spoken to; several at once."""
    namespaces: tuple[str, ...] = attrs.field(default=(), converter=_tuple, validator=_namespaces)
    """Only nodes in these, or below them, are heard. Empty: all nodes. A node is known by its
    token, so then publishers without one are not heard."""
    except_namespaces: tuple[str, ...] = attrs.field(
        default=(), converter=_tuple, validator=_namespaces
    )
    """Nodes in these, or below them, are not heard, though ``namespaces`` may hold them."""

    @property
    def restricted(self) -> bool:
        """Are there nodes that are not to be heard?"""
        return bool(self.namespaces or self.except_namespaces)

    def admits(self, namespace: str) -> bool:
        """Are the nodes of this namespace to be heard?"""
        wanted = not self.namespaces or any(_within(namespace, one) for one in self.namespaces)
        return wanted and not any(_within(namespace, one) for one in self.except_namespaces)


@attrs.frozen
class RmwOptions(RmwSessionOptions):
    """``adapter: zenoh_rmw`` in a configuration, of a source or of an announcer."""

    topic: str = attrs.field(default=DEFAULT_TOPIC, validator=_topic)


def _within(namespace: str, outer: str) -> bool:
    return outer in ("/", namespace) or namespace.startswith(f"{outer}/")
