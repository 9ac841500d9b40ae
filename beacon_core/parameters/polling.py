"""How asking can be configured: the options that every carrier of parameters offers alike.

An adapter's options are a class of its own, which takes its fields from here, so that names,
defaults and complaints are the same everywhere.
"""

from __future__ import annotations

import re
from typing import Any, Protocol

import attrs

from beacon_core.checks import at_least_one, nanoseconds
from beacon_core.errors import ConfigError

__all__ = [
    "LEAST_S",
    "Polling",
    "budget_s",
    "interval_s",
    "max_in_flight",
    "parameter_events",
    "targets",
    "timeout_s",
]

LEAST_S = 0.1
"""The shortest interval, budget and time-out, in seconds; ros2_medkit has the same."""


class Polling(Protocol):
    """What options must tell an asker. What each means is said in :class:`.PollPlan`."""

    @property
    def interval_s(self) -> float: ...

    @property
    def budget_s(self) -> float: ...

    @property
    def timeout_s(self) -> float: ...

    @property
    def max_in_flight(self) -> int: ...

    @property
    def forget_after_s(self) -> float: ...


def interval_s() -> float:
    """A field: each node is asked once in this time. A source's ``ttl_s`` that is not longer is
    lifted to three times as long, with a warning."""
    return _waiting(5.0, ttl_above=True)


def budget_s() -> float:
    """A field: how long one round of asking may last, should it take longer than the interval."""
    return _waiting(10.0)


def timeout_s() -> float:
    """A field: how long one node may take to answer."""
    return _waiting(2.0)


def max_in_flight() -> int:
    """A field: how many nodes are asked at the same time, at most."""
    found: int = attrs.field(default=128, validator=_cap, metadata={"at_least": 1})
    return found


def targets() -> tuple[str, ...]:
    """A field: the full names of the nodes to ask. None: the nodes of the gateway's apps; and if no
    app has one, every node of the graph whose name does not begin with ``_``."""
    found: tuple[str, ...] = attrs.field(default=(), converter=_tuple, validator=_nodes)
    return found


def parameter_events() -> bool:
    """A field: listen to ``/parameter_events``. A change is then seen at once, not only at the next
    poll."""
    found: bool = attrs.field(default=True, validator=_switch)
    return found


_NODE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def _waiting(default: float, **metadata: Any) -> float:
    found: float = attrs.field(
        default=default, validator=_long_enough, metadata={"at_least": LEAST_S, **metadata}
    )
    return found


def _complain(attribute: attrs.Attribute[Any], value: object, right: str) -> None:
    raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


def _nodes(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    right = "a list of nodes' full names, such as ['/arm/driver']"
    if not isinstance(value, tuple):
        _complain(attribute, value, right)
    for one in value if isinstance(value, tuple) else ():
        if not isinstance(one, str) or not _NODE.fullmatch(one):
            _complain(attribute, one, right)


def _long_enough(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    if nanoseconds(attribute.name, value) < nanoseconds(attribute.name, LEAST_S):
        _complain(attribute, value, f"seconds, at least {LEAST_S}")


def _cap(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    at_least_one(attribute.name, value)


def _switch(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, bool):
        _complain(attribute, value, "true or false")


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
