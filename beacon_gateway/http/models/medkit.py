"""The ``x-medkit`` blocks: what an entity is besides the standard, and how its beacon is."""

from __future__ import annotations

from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.base import Open

__all__ = [
    "BeaconSummary",
    "DroppedItem",
    "XMedkitApp",
    "XMedkitArea",
    "XMedkitCollection",
    "XMedkitComponent",
    "XMedkitFunction",
    "XMedkitRos2",
]


@attrs.frozen
class XMedkitRos2:
    """What it is in ROS."""

    action: str | None = None
    direction: str | None = None
    kind: str | None = None
    namespace: str | None = None
    node: str | None = None
    service: str | None = None
    topic: str | None = None
    type: str | None = None


@attrs.frozen(kw_only=True)
class BeaconSummary:
    """How an entity's beacon is: enough for a live table. Ours."""

    source: str
    status: str
    age_sec: float
    cause: str
    reason: str | None = None
    restarts: int
    hostname: str | None = None
    process_id: int | None = None
    process_name: str | None = None
    conflict: bool


@attrs.frozen(kw_only=True)
class XMedkitArea:
    """Of an area."""

    contributors: Sequence[str] | None = None
    missing: bool | None = None
    parent_area_id: str | None = None
    ros2: XMedkitRos2 | None = None
    unresolved_component: str | None = None


@attrs.frozen(kw_only=True)
class _Expected:
    """What is expected of an entity, and whether it holds. Ours."""

    expected: bool | None = None
    """Somebody else than its own hint told of it, and it was never heard."""
    never_heard: bool | None = None
    depends_on_active: bool | None = None
    """All that it depends on is active; only where it depends on anything."""
    depends_on_reason: str | None = None
    reason_chain: Sequence[str] | None = None
    """From it to what is not active."""
    functions: Sequence[str] | None = None
    """In which it takes part."""
    beacon: BeaconSummary | None = None


@attrs.frozen(kw_only=True)
class XMedkitComponent(_Expected):
    """Of a component."""

    area: str | None = None
    available: bool | None = None
    capabilities: object | None = None
    contributors: Sequence[str] | None = None
    depends_on: Sequence[str] | None = attrs.field(default=None, metadata={"key": "dependsOn"})
    description: str | None = None
    external: bool | None = None
    identity: Open | None = None
    missing: bool | None = None
    parent_component_id: str | None = attrs.field(
        default=None, metadata={"key": "parentComponentId"}
    )
    ros2: XMedkitRos2 | None = None
    source: str | None = None
    type: str | None = None
    variant: str | None = None


@attrs.frozen(kw_only=True)
class XMedkitApp(_Expected):
    """Of an app."""

    available: bool | None = None
    component_id: str | None = None
    contributors: Sequence[str] | None = None
    external: bool | None = None
    is_online: bool | None = None
    missing: bool | None = None
    ros2: XMedkitRos2 | None = None
    source: str | None = None


@attrs.frozen(kw_only=True)
class XMedkitFunction:
    """Of a function."""

    contributors: Sequence[str] | None = None
    description: str | None = None
    hosts: Sequence[str] | None = None
    ros2: XMedkitRos2 | None = None
    source: str | None = None


@attrs.frozen
class DroppedItem:
    """What a peer sent and could not be used. This gateway has no peers."""

    peer: str
    reason: str
    source_id: str


@attrs.frozen(kw_only=True)
class XMedkitCollection:
    """Of a collection."""

    total_count: int | None = None
    contributors: Sequence[str] | None = None
    failed_peers: Sequence[str] | None = None
    partial: bool | None = None
    peer_dropped_items: Sequence[DroppedItem] | None = None
