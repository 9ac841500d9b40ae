"""A conduit between relays of one process: ends of one name call each other directly."""

from __future__ import annotations

from beacon_core.ports.relaying import ConduitAdapter
from beacon_local.conduit import LocalConduit
from beacon_local.options import LocalOptions

__all__ = ["CONDUIT", "LocalConduit", "LocalOptions"]


def _conduit(options: LocalOptions) -> LocalConduit:
    return LocalConduit(options.name)


def _identity(options: LocalOptions) -> str:
    return f"local:{options.name}"


CONDUIT = ConduitAdapter("local", LocalOptions, _conduit, _identity)
"""Chosen in a configuration as ``local``."""
