"""A beacon in full: the body of the vendor endpoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import attrs

__all__ = ["Beacon", "BeaconClaim", "BeaconStep", "BeaconView", "CarrierBeacon"]


@attrs.frozen(kw_only=True)
class CarrierBeacon:
    """The 14 keys every client knows, each always present."""

    entity_id: str
    status: str
    age_sec: float
    stable_id: str
    display_name: str
    transport_type: str
    negotiated_format: str
    process_id: int
    """0: not given."""
    process_name: str
    hostname: str
    component_id: str
    function_ids: Sequence[str]
    depends_on: Sequence[str]
    metadata: Mapping[str, str]


@attrs.frozen(kw_only=True)
class BeaconClaim:
    """What one of two that speak under the same id says of itself."""

    sender: str
    age_sec: float
    display_name: str
    process_id: int
    process_name: str
    hostname: str


@attrs.frozen(kw_only=True)
class BeaconView:
    """One source's word on the entity: who spoke, when, and as which process."""

    source: str
    adapter: str
    sender: str
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
class BeaconStep:
    """One change of status."""

    at: str
    status: str
    cause: str
    reason: str | None = None


@attrs.frozen(kw_only=True)
class Beacon(CarrierBeacon):
    """The freshest source's view with what else is known, and every source's view."""

    cause: str
    reason: str | None = None
    restarts: int
    conflict: bool
    claims: Sequence[BeaconClaim] | None = None
    sources: Sequence[BeaconView]
    history: Sequence[BeaconStep]
    functions: Sequence[str] | None = None
    """Those of the tree that it takes part in."""
    depends_on_active: bool | None = None
    depends_on_reason: str | None = None
    reason_chain: Sequence[str] | None = None
