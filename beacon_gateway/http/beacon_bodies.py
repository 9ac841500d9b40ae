"""A beacon as a body: the 14 keys every client knows, and what else is known."""

from __future__ import annotations

import datetime as dt
from typing import Any

from beacon_core.clock import Clock
from beacon_core.response import build_response
from beacon_core.stored import Claim, StoredHint
from beacon_gateway.http.blocks import Blocks, evidence, process
from beacon_gateway.http.models.beacons import (
    Beacon as BeaconBody,
)
from beacon_gateway.http.models.beacons import (
    BeaconClaim,
    BeaconStep,
    BeaconView,
    CarrierBeacon,
)
from beacon_gateway.tree.entities import App, Component
from beacon_gateway.views import Beacon, View

__all__ = ["beacon_body", "carrier_body", "iso", "left_parameters"]


def beacon_body(entity: App | Component, beacon: Beacon, blocks: Blocks) -> BeaconBody:
    """The freshest source's view, what else is known, and every source's view."""
    clock = blocks.gateway.clock
    now_ns = clock.monotonic_ns()
    stored = beacon.stored
    claims = [_claim(claim, now_ns) for claim in beacon.claims]
    return BeaconBody(
        **_the_14(stored, now_ns),
        **evidence(stored),
        restarts=stored.restarts,
        conflict=beacon.conflict,
        claims=claims or None,
        sources=[_view(view, now_ns) for view in beacon.views],
        history=_history(stored, clock),
        functions=blocks.functions_of(entity.id),
        **blocks.dependencies(entity),
    )


def carrier_body(beacon: Beacon, now_ns: int) -> CarrierBeacon:
    """The 14 keys and no other, as ros2_medkit's plugins answer for their one carrier."""
    return CarrierBeacon(**_the_14(beacon.stored, now_ns))


def left_parameters(beacon: Beacon, clock: Clock) -> dict[str, object]:
    """What is left of an entity that said goodbye."""
    stored = beacon.stored
    hint = stored.hint
    last = stored.history[-1].at_ns if stored.history else stored.last_seen_ns
    given = {"display_name": hint.display_name, "hostname": hint.hostname}
    return {
        "entity_id": hint.entity_id,
        "status": stored.status.value,
        "left_at": _iso(last, clock),
        "left_sec": max(0, clock.monotonic_ns() - last) / 1e9,
        **evidence(stored),
        "source": beacon.freshest.source,
        **{key: text for key, text in given.items() if text},
    }


def _the_14(stored: StoredHint, now_ns: int) -> dict[str, Any]:
    return build_response(stored, now_ns)


def _view(view: View, now_ns: int) -> BeaconView:
    stored = view.stored
    return BeaconView(
        source=view.source,
        adapter=view.adapter,
        sender=stored.source,
        status=stored.status.value,
        age_sec=stored.age_ns(now_ns) / 1e9,
        restarts=stored.restarts,
        conflict=stored.conflict,
        **evidence(stored),
        **process(stored),
    )


def _claim(claim: Claim, now_ns: int) -> BeaconClaim:
    hint = claim.hint
    return BeaconClaim(
        sender=claim.source,
        age_sec=max(0, now_ns - claim.last_seen_ns) / 1e9,
        display_name=hint.display_name,
        process_id=hint.process_id,
        process_name=hint.process_name,
        hostname=hint.hostname,
    )


def _history(stored: StoredHint, clock: Clock) -> list[BeaconStep]:
    return [
        BeaconStep(
            at=_iso(step.at_ns, clock),
            status=step.status,
            cause=step.cause,
            reason=step.detail or None,
        )
        for step in stored.history
    ]


def iso(wall_ns: int) -> str:
    """A time since 1970 as people and machines read it, to the millisecond."""
    moment = dt.datetime.fromtimestamp(wall_ns // 1_000_000 / 1000, tz=dt.UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _iso(at_ns: int, clock: Clock) -> str:
    """A time on the monotonic clock as a wall clock shows it."""
    return iso(clock.wall_ns() - (clock.monotonic_ns() - at_ns))
