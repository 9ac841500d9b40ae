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


def vendor_endpoints(adapters: Mapping[str, Adapter]) -> dict[str, frozenset[str]]:
    """The endpoints of the configured sources' adapters, each with its adapters' names.

    Several may share one: the same kind of beacon may come over several carriers. ``adapters`` by
    the sources' names. Raises ``ConfigError`` for an endpoint that is no vendor's name, or is ours.
    """
    endpoints: dict[str, frozenset[str]] = {}
    for source, adapter in adapters.items():
        if not adapter.vendor_endpoint:
            continue
        endpoint = adapter.vendor_endpoint
        endpoints[endpoint] = endpoints.get(endpoint, frozenset()) | {adapter.name}
        why = _why_not(endpoint)
        if why:
            raise ConfigError(
                f"$.sources.{source}: the adapter {adapter.name!r} wants to be served at "
                f"{endpoint!r}, {why}"
            )
    return endpoints


def _why_not(endpoint: str) -> str:
    if not _NAME.fullmatch(endpoint):
        return "which must be x- and words of a-z and 0-9 with - between them"
    if endpoint == BEACON:
        return "which is the gateway's own; it needs another name"
    return ""
