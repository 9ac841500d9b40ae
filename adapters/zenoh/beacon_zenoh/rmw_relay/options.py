"""What can be configured of a network of rmw_zenoh beside a relay, beside the session."""

from __future__ import annotations

from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_zenoh.options import SessionOptions
from beacon_zenoh.rmw.keys import MAX_DOMAIN

__all__ = ["RmwNetworkOptions"]

_MAX_DEPTH = 10_000


def _whole(lowest: int, highest: int) -> Any:
    def check(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
        if type(value) is not int or not lowest <= value <= highest:
            right = f"a whole number, {lowest} to {highest}"
            raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")

    return check


@attrs.frozen
class RmwNetworkOptions(SessionOptions):
    """``network: zenoh_rmw`` of a relay. ``ConfigError`` for a value that cannot be.

    Without a ``mode`` it is a client of the router that rmw_zenoh's nodes have: ``rmw_zenohd``
    listens at port 7447.
    """

    domain_id: int = attrs.field(default=0, validator=_whole(0, MAX_DOMAIN))
    """``ROS_DOMAIN_ID`` of the nodes. The environment is not looked at."""
    depth: int = attrs.field(default=10, validator=_whole(1, _MAX_DEPTH))
    """At the far end, of a topic whose publishers keep all: of the others the depth is known. 10 is
    ROS's own default."""
