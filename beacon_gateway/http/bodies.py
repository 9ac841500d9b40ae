"""The answers' bodies. A field that is not given is left out, never null."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable

from beacon_core.clock import Clock
from beacon_core.entities import App, Component
from beacon_core.response import build_response
from beacon_core.stored import Claim, StoredHint
from beacon_gateway import __version__
from beacon_gateway.directory import Found
from beacon_gateway.gateway import Gateway
from beacon_gateway.listener import Listener
from beacon_gateway.vendor import BEACON
from beacon_gateway.views import Beacon, View

__all__ = [
    "API_BASE",
    "carrier_beacon",
    "detail",
    "health",
    "item",
    "items",
    "left_parameters",
    "vendor_beacon",
    "version_info",
]

API_BASE = "/api/v1"
"""What every path begins with, as clients of ros2_medkit expect."""

_Body = dict[str, object]

_RESOURCES = (
    "status",
    "data",
    "operations",
    "configurations",
    "faults",
    "logs",
    "bulk-data",
    "cyclic-subscriptions",
    "triggers",
)
"""Addresses clients find in every detail, whether or not something answers there."""


def items(found: Iterable[Found], clock: Clock) -> _Body:
    """A collection."""
    listed = [item(one, clock) for one in found]
    return {"items": listed, "x-medkit": {"total_count": len(listed)}}


def item(found: Found, clock: Clock) -> _Body:
    """One line of a collection."""
    entity = found.entity
    return {
        "id": entity.id,
        "name": entity.name or entity.id,
        "href": _href(entity),
        "type": _type(entity),
        "x-medkit": _x_medkit(found, clock),
    }


def detail(found: Found, clock: Clock, vendor_endpoints: Iterable[str] = ()) -> _Body:
    """One app or component; ``vendor_endpoints`` are those there are beside our own."""
    entity = found.entity
    href = _href(entity)
    body: _Body = {
        "id": entity.id,
        "name": entity.name or entity.id,
        "type": _type(entity),
        **{name: f"{href}/{name}" for name in _RESOURCES},
        "capabilities": [
            {"name": name, "href": f"{href}/{name}"} for name in (BEACON, *vendor_endpoints)
        ],
        "_links": {"self": href, "collection": f"{API_BASE}/{_type(entity)}s"},
        "x-medkit": _x_medkit(found, clock),
    }
    if isinstance(entity, Component):
        body |= {name: f"{href}/{name}" for name in ("subcomponents", "hosts")}
    elif entity.component_id:
        host = f"{API_BASE}/components/{entity.component_id}"
        body |= {"is-located-on": host, "belongs-to": f"{href}/belongs-to"}
        body["_links"] = {"self": href, "collection": f"{API_BASE}/apps", "is-located-on": host}
    return body


def vendor_beacon(beacon: Beacon, clock: Clock) -> _Body:
    """The 14 keys every client knows, of the freshest source; and what else is known."""
    now_ns = clock.monotonic_ns()
    stored = beacon.stored
    return {
        **build_response(stored, now_ns),
        **_evidence(stored),
        "restarts": stored.restarts,
        "conflict": beacon.conflict,
        **_claims(beacon, now_ns),
        "sources": [_view(view, now_ns) for view in beacon.views],
        "history": _history(stored, clock),
    }


def carrier_beacon(beacon: Beacon, clock: Clock) -> _Body:
    """The same 14 keys and no other, as ros2_medkit's plugins answer for their one carrier."""
    return build_response(beacon.stored, clock.monotonic_ns())


def left_parameters(beacon: Beacon, clock: Clock) -> _Body:
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
        **_evidence(stored),
        "source": beacon.freshest.source,
        **{key: text for key, text in given.items() if text},
    }


def version_info(vendor_name: str) -> _Body:
    """Which version of the interface is spoken here, and by whom."""
    vendor = {"version": __version__, "name": vendor_name}
    return {"items": [{"version": "1.0.0", "base_uri": API_BASE, "vendor_info": vendor}]}


def health(gateway: Gateway) -> _Body:
    """How the gateway and each of its sources are doing."""
    clock = gateway.clock
    return {
        "status": "healthy",
        "timestamp": clock.wall_ns(),
        "warning_schema_version": 2,
        "warnings": [],
        BEACON: {
            "uptime_sec": (clock.monotonic_ns() - gateway.started_ns) / 1e9,
            "sources": [_source_health(listener) for listener in gateway.listeners],
        },
    }


def _source_health(listener: Listener) -> _Body:
    health = listener.source.health()
    stats = listener.store.stats()
    body: _Body = {
        "name": listener.name,
        "adapter": listener.adapter,
        "condition": health.condition.value,
        "counters": dict(health.counters),
        "messages": {verdict.value: n for verdict, n in listener.intake.totals().items()},
        "senders": listener.intake.source_count(),
        "hints": {
            "active": stats.active,
            "stale": stats.stale,
            "left": stats.left,
            "conflicts": stats.conflicts,
            "bytes": stats.bytes,
            "expired": stats.expired,
            "displaced": stats.displaced,
            "refused": stats.refused,
            "restarts": stats.restarts,
        },
    }
    return {**body, "detail": health.detail} if health.detail else body


def _x_medkit(found: Found, clock: Clock) -> _Body:
    entity, beacon = found.entity, found.beacon
    body: _Body = {"source": entity.source}
    if isinstance(entity, App):
        body["is_online"] = beacon is not None and beacon.online
        if entity.component_id:
            body["component_id"] = entity.component_id
    if beacon is not None:
        body["beacon"] = _summary(beacon, clock.monotonic_ns())
    return body


def _summary(beacon: Beacon, now_ns: int) -> _Body:
    """The beacon block of an item: enough for a live table."""
    return {
        "source": beacon.freshest.source,
        **_account(beacon.stored, now_ns),
        "conflict": beacon.conflict,
    }


def _account(stored: StoredHint, now_ns: int) -> _Body:
    hint = stored.hint
    given: _Body = {
        "hostname": hint.hostname,
        "process_id": hint.process_id,
        "process_name": hint.process_name,
    }
    return {
        "status": stored.status.value,
        "age_sec": stored.age_ns(now_ns) / 1e9,
        **_evidence(stored),
        "restarts": stored.restarts,
        **{key: value for key, value in given.items() if value},
    }


def _view(view: View, now_ns: int) -> _Body:
    """One source's word on the entity: who spoke, when, and as which process."""
    return {
        "source": view.source,
        "adapter": view.adapter,
        "sender": view.stored.source,
        **_account(view.stored, now_ns),
        "conflict": view.stored.conflict,
    }


def _evidence(stored: StoredHint) -> _Body:
    cause = {"cause": stored.cause.value}
    return {**cause, "reason": stored.detail} if stored.detail else dict(cause)


def _claims(beacon: Beacon, now_ns: int) -> _Body:
    return {"claims": [_claim(claim, now_ns) for claim in beacon.claims]} if beacon.conflict else {}


def _claim(claim: Claim, now_ns: int) -> _Body:
    hint = claim.hint
    return {
        "sender": claim.source,
        "age_sec": max(0, now_ns - claim.last_seen_ns) / 1e9,
        "display_name": hint.display_name,
        "process_id": hint.process_id,
        "process_name": hint.process_name,
        "hostname": hint.hostname,
    }


def _history(stored: StoredHint, clock: Clock) -> list[_Body]:
    steps: list[_Body] = []
    for step in stored.history:
        body: _Body = {"at": _iso(step.at_ns, clock), "status": step.status, "cause": step.cause}
        steps.append({**body, "reason": step.detail} if step.detail else body)
    return steps


def _iso(at_ns: int, clock: Clock) -> str:
    """A time on the monotonic clock as a wall clock shows it."""
    wall_ns = clock.wall_ns() - (clock.monotonic_ns() - at_ns)
    moment = dt.datetime.fromtimestamp(wall_ns // 1_000_000 / 1000, tz=dt.UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _type(entity: App | Component) -> str:
    return "app" if isinstance(entity, App) else "component"


def _href(entity: App | Component) -> str:
    return f"{API_BASE}/{_type(entity)}s/{entity.id}"
