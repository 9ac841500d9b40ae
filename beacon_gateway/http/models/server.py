"""The server about itself: overview, health, version; and an error."""

from __future__ import annotations

import enum
from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.base import Open, optional_key
from beacon_gateway.tree.linker import Unmanifested

__all__ = [
    "GatewayHealth",
    "GenericError",
    "HealthDiscovery",
    "HealthDiscoveryLinking",
    "HealthStatus",
    "HealthWarning",
    "RootAuth",
    "RootCapabilities",
    "RootOverview",
    "RootTls",
    "SourceHealth",
    "VersionInfo",
    "VersionInfoEntry",
    "VersionInfoVendor",
    "WarningCode",
    "XMedkitVersionInfo",
]


@attrs.frozen(kw_only=True)
class GenericError:
    """Any answer that is not the one asked for."""

    error_code: str
    message: str
    vendor_code: str | None = None
    parameters: Open | None = None


@attrs.frozen(kw_only=True)
class RootCapabilities:
    """What the server can do; clients need every one of them said."""

    discovery: bool
    data_access: bool
    operations: bool
    async_actions: bool
    configurations: bool
    faults: bool
    logs: bool
    bulk_data: bool
    cyclic_subscriptions: bool
    locking: bool
    triggers: bool
    updates: bool
    authentication: bool
    tls: bool
    scripts: bool
    aggregation: bool
    vendor_extensions: bool


@attrs.frozen(kw_only=True)
class RootAuth:
    """What needs a token, and which algorithm signs it; only there if something does."""

    enabled: bool
    algorithm: str
    require_auth_for: str


@attrs.frozen(kw_only=True)
class RootTls:
    """The oldest version of TLS that is taken; only there if the gateway serves TLS itself."""

    enabled: bool
    min_version: str


@attrs.frozen(kw_only=True)
class RootOverview:
    """Who serves, what there is, and what it can do."""

    name: str
    version: str
    api_base: str
    endpoints: Sequence[str]
    capabilities: RootCapabilities
    auth: RootAuth | None = None
    tls: RootTls | None = None


@attrs.frozen(kw_only=True)
class VersionInfoVendor:
    """Who made the server, and which version of it this is."""

    version: str
    name: str


@attrs.frozen(kw_only=True)
class VersionInfoEntry:
    """One version of the interface, and where it is served."""

    version: str
    base_uri: str
    vendor_info: VersionInfoVendor | None = None


@attrs.frozen(kw_only=True)
class XMedkitVersionInfo:
    """Which other gateways could not be asked; this one asks none."""

    failed_peers: Sequence[str] | None = None
    partial: bool | None = None


@attrs.frozen(kw_only=True)
class VersionInfo:
    """Which version of the interface is spoken here, and by whom."""

    items: Sequence[VersionInfoEntry]
    x_medkit: XMedkitVersionInfo | None = optional_key("x-medkit")


class WarningCode(enum.StrEnum):
    """What a warning is about."""

    LEAF_ID_COLLISION = "leaf_id_collision"
    UNMANIFESTED_NODES = "unmanifested_nodes"


@attrs.frozen(kw_only=True)
class HealthWarning:
    """Something that works, but not as its owner will have meant it."""

    code: WarningCode
    message: str
    entity_ids: Sequence[str]
    ros_node_fqns: Sequence[str]
    peer_names: Sequence[str]


@attrs.frozen(kw_only=True)
class HealthDiscoveryLinking:
    """How the nodes of the ROS graph were bound to the apps of the manifest."""

    linked_count: int
    orphan_count: int
    binding_conflicts: int
    unmanifested_policy: Unmanifested
    warnings: Sequence[str] | None = None


@attrs.frozen(kw_only=True)
class HealthDiscovery:
    """How the tree was made."""

    mode: str
    strategy: str
    pipeline: Open | None = None
    linking: HealthDiscoveryLinking | None = None


@attrs.frozen(kw_only=True)
class SourceHealth:
    """How one source is doing. Ours."""

    name: str
    adapter: str
    condition: str
    counters: Open
    messages: Open
    senders: int
    tokens: float
    """Messages that all senders together may send at once before some are dropped."""
    hints: Open
    last_message_sec: float | None = None
    """Seconds since the last message; ``None`` if none ever came."""
    detail: str | None = None


@attrs.frozen(kw_only=True)
class GatewayHealth:
    """How the gateway is doing. Ours."""

    uptime_sec: float
    sources: Sequence[SourceHealth]


@attrs.frozen(kw_only=True)
class HealthStatus:
    """How the gateway and each of its sources are doing."""

    status: str
    timestamp: int
    """Nanoseconds since 1970."""
    warning_schema_version: int
    warnings: Sequence[HealthWarning]
    discovery: HealthDiscovery | None = None
    entity_cache: Open | None = optional_key("x-medkit-entity-cache")
    data_provider: Open | None = optional_key("x-medkit-data-provider")
    subscription_executor: Open | None = optional_key("x-medkit-subscription-executor")
    peers: object | None = None
    beacon: GatewayHealth | None = optional_key("x-medkit-beacon")
