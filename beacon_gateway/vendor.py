"""Endpoints beside the standard's own: one for what all sources heard, and those adapters bring."""

from __future__ import annotations

import re
from collections.abc import Mapping

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import Adapter

__all__ = ["BEACON", "vendor_endpoints"]

BEACON = "x-medkit-beacon"
"""The endpoint for what all sources heard, and the vendor keys in other answers."""

_NAME = re.compile(r"x-[a-z0-9]+(-[a-z0-9]+)*")
"""As the standard (SOVD) has vendors name what is theirs."""


def vendor_endpoints(adapters: Mapping[str, Adapter]) -> dict[str, str]:
    """The endpoints of the configured sources' adapters, each with its adapter's name.

    ``adapters`` by the sources' names. Raises ``ConfigError`` for an endpoint that is no vendor's
    name, that is ours, or that another adapter has.
    """
    endpoints: dict[str, str] = {}
    for source, adapter in adapters.items():
        if not adapter.vendor_endpoint:
            continue
        owner = endpoints.setdefault(adapter.vendor_endpoint, adapter.name)
        why = _why_not(adapter, owner)
        if why:
            raise ConfigError(
                f"$.sources.{source}: the adapter {adapter.name!r} wants to be served at "
                f"{adapter.vendor_endpoint!r}, {why}"
            )
    return endpoints


def _why_not(adapter: Adapter, owner: str) -> str:
    if not _NAME.fullmatch(adapter.vendor_endpoint):
        return "which must be x- and words of a-z and 0-9 with - between them"
    if adapter.vendor_endpoint == BEACON:
        return "which is the gateway's own; it needs another name"
    if owner != adapter.name:
        return f"where {owner!r} is; one of the two needs another name"
    return ""
