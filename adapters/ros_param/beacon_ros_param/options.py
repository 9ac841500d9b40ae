"""What can be configured of the polling."""

from __future__ import annotations

from typing import Any

import attrs

from beacon_core.checks import nanoseconds
from beacon_core.errors import ConfigError
from beacon_core.parameters import polling
from beacon_ros.environment import MAX_DOMAIN

__all__ = ["RosParamOptions"]


def _domain(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None and (type(value) is not int or not 0 <= value <= MAX_DOMAIN):
        raise ConfigError(
            f"{attribute.name}: {value!r} cannot be used; "
            f"write a whole number, 0 to {MAX_DOMAIN}, or leave it out"
        )


def _seconds(_: object, attribute: attrs.Attribute[Any], value: Any) -> None:
    nanoseconds(attribute.name, value)


@attrs.frozen
class RosParamOptions:
    """``adapter: ros_param`` in a configuration, of a source or of an announcer.

    ``ConfigError`` for a value that cannot be. A configuration file's ``interval_s``, ``budget_s``,
    ``timeout_s`` and ``max_in_flight`` are lifted to the least that can be, with a warning. What
    they mean is said in :mod:`beacon_core.parameters.polling`.
    """

    domain_id: int | None = attrs.field(default=None, validator=_domain)
    """``None``: that of the environment, ``ROS_DOMAIN_ID``."""
    targets: tuple[str, ...] = polling.targets()
    interval_s: float = polling.interval_s()
    budget_s: float = polling.budget_s()
    timeout_s: float = polling.timeout_s()
    max_in_flight: int = polling.max_in_flight()
    forget_after_s: float = attrs.field(default=10.0, validator=_seconds)
    """What was needed to ask a node, a quarter of a megabyte, is kept for so long after it has left
    the graph: one that is started again is asked at once."""
    parameter_events: bool = polling.parameter_events()
