"""A relay's conduit over Zenoh. See docs/adapters/zenoh_conduit.md.

Making one needs eclipse-zenoh; importing this package does not.
"""

from __future__ import annotations

from beacon_core.errors import ConfigError
from beacon_core.ports.conduit import Conduit
from beacon_core.ports.relaying import ConduitAdapter
from beacon_zenoh.relay.options import RelayOptions

__all__ = ["CONDUIT", "RelayOptions"]


def _conduit(options: RelayOptions) -> Conduit:
    try:
        import zenoh  # noqa: F401, PLC0415 - to see whether it is there
    except ModuleNotFoundError as error:
        raise ConfigError(
            "conduit: 'zenoh' needs eclipse-zenoh; run: pip install 'beacon-core[zenoh]'"
        ) from error
    from beacon_zenoh.relay.conduit import ZenohConduit  # noqa: PLC0415 - needs it

    return ZenohConduit(options)


def _identity(options: RelayOptions) -> str:
    return f"zenoh:{options.prefix}/{options.link}"


CONDUIT = ConduitAdapter("zenoh", RelayOptions, _conduit, _identity)
"""Chosen in a configuration as ``zenoh``."""
