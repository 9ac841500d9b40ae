"""What can be configured of the polling."""

from __future__ import annotations

import re
from typing import Any

import attrs

from beacon_core.checks import at_least_one, nanoseconds
from beacon_core.errors import ConfigError
from beacon_ros.environment import MAX_DOMAIN

__all__ = ["LEAST_S", "RosParamOptions"]

LEAST_S = 0.1
"""The shortest interval, budget and time-out, in seconds; ros2_medkit has the same."""

_NODE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def _complain(attribute: attrs.Attribute[Any], value: object, right: str) -> None:
    raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


def _domain(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None and (type(value) is not int or not 0 <= value <= MAX_DOMAIN):
        _complain(attribute, value, f"a whole number, 0 to {MAX_DOMAIN}, or leave it out")


def _nodes(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    right = "a list of nodes' full names, such as ['/arm/driver']"
    if not isinstance(value, tuple):
        _complain(attribute, value, right)
    for one in value if isinstance(value, tuple) else ():
        if not isinstance(one, str) or not _NODE.fullmatch(one):
            _complain(attribute, one, right)


def _seconds(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    nanoseconds(attribute.name, value)


def _waiting(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if nanoseconds(attribute.name, value) < nanoseconds(attribute.name, LEAST_S):
        _complain(attribute, value, f"seconds, at least {LEAST_S}")


def _cap(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    at_least_one(attribute.name, value)


def _switch(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, bool):
        _complain(attribute, value, "true or false")


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


@attrs.frozen
class RosParamOptions:
    """``adapter: ros_param`` in a configuration, of a source or of an announcer.

    ``ConfigError`` for a value that cannot be. A configuration file's ``interval_s``, ``budget_s``,
    ``timeout_s`` and ``max_in_flight`` are lifted to the least that can be, with a warning.
    """

    domain_id: int | None = attrs.field(default=None, validator=_domain)
    """``None``: that of the environment, ``ROS_DOMAIN_ID``."""
    targets: tuple[str, ...] = attrs.field(default=(), converter=_tuple, validator=_nodes)
    """The full names of the nodes to ask. None: the nodes of the gateway's apps; and if no app has
    one, every node of the graph whose name does not begin with ``_``."""
    interval_s: float = attrs.field(
        default=5.0, validator=_waiting, metadata={"at_least": LEAST_S, "ttl_above": True}
    )
    """Each node is asked once in this time. A source's ``ttl_s`` that is not longer is lifted to
    three times as long, with a warning."""
    budget_s: float = attrs.field(default=10.0, validator=_waiting, metadata={"at_least": LEAST_S})
    """How long one round of asking may last, should it take longer than the interval."""
    timeout_s: float = attrs.field(default=2.0, validator=_waiting, metadata={"at_least": LEAST_S})
    """How long one node may take to answer."""
    max_in_flight: int = attrs.field(default=128, validator=_cap, metadata={"at_least": 1})
    """How many nodes are asked at the same time, at most."""
    forget_after_s: float = attrs.field(default=60.0, validator=_seconds)
    """What was needed to ask a node is kept for so long after the node has left the graph."""
    parameter_events: bool = attrs.field(default=True, validator=_switch)
    """Listen to ``/parameter_events``: a change is then seen at once, not only at the next poll."""
