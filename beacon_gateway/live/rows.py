"""How the live view writes entities and events: rows that a table can be drawn from.

A row says less than the entity's own endpoint and is bounded, because each change is sent to
everybody. ``full`` adds the rest, for an entity that somebody looks at.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping

from beacon_core.outcome import Refusal, Verdict
from beacon_core.response import build_response
from beacon_core.stored import StoredHint
from beacon_gateway.gateway import Gateway
from beacon_gateway.live.feed import Event, EventType
from beacon_gateway.views import Beacon, View

__all__ = ["Writer", "sse"]

_API_BASE = "/api/v1"

_MAX_DEPENDS_ON = 16
"""Ids in a row. A hint may name 100, of 256 bytes each: nobody should get 25 kB because somebody
changed its name."""

_KNOWN = "manifest"
"""The source of an entity that was there before anything was heard."""

_COLLECTIONS = {"App": "apps", "Component": "components"}
"""By the kind of an entity; hints are about these two."""

_Body = dict[str, object]


def sse(kind: str, data: bytes, event_id: str = "") -> bytes:
    """One event of a stream. ``data`` is JSON, which has no line ends of its own."""
    head = f"id: {event_id}\n" if event_id else ""
    return b"%sevent: %s\ndata: %s\n\n" % (head.encode(), kind.encode(), data)


class Writer:
    """Writes for one gateway.

    Thread rule: every method may be called from any thread.
    """

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._clock = gateway.clock
        self._stores = {listener.name: listener.store for listener in gateway.listeners}

    def event(self, event: Event) -> _Body:
        """An event's body."""
        told: _Body
        kind: object
        if event.type is EventType.EXPECTED:
            told, kind = {"expected": self.expected()}, "gateway"
        elif event.beacon is None:
            told = {"rejected": _rejected(event.name, event.refusals)}
            kind = "source"
        else:
            row = self.row(event.name, event.beacon)
            told, kind = {"beacon": row}, row["type"]
        return {
            "event_type": event.type.value,
            "timestamp": self.timestamp(),
            **told,
            "x-medkit": {"entity_type": kind, "entity_id": event.name},
        }

    def row(self, entity_id: str, beacon: Beacon) -> _Body:
        """One entity, as all sources together have it."""
        now_ns = self._clock.monotonic_ns()
        stored, store = beacon.stored, self._stores[beacon.freshest.source]
        hint = stored.hint
        given = {
            "display_name": hint.display_name,
            "component_id": hint.component_id,
            "transport_type": hint.transport_type,
            "hostname": hint.hostname,
            "process_id": hint.process_id,
            "process_name": hint.process_name,
            "depends_on": list(hint.depends_on[:_MAX_DEPENDS_ON]),
        }
        return {
            "entity_id": entity_id,
            **self.place(entity_id),
            "source": beacon.freshest.source,
            **_account(stored, now_ns),
            "restarts": max(view.stored.restarts for view in beacon.views),
            "conflict": beacon.conflict,
            "ttl_sec": store.ttl_ns / 1e9,
            "expiry_sec": store.expiry_ns / 1e9,
            "sources": [_view(view, now_ns) for view in beacon.views],
            **{key: value for key, value in given.items() if value},
        }

    def full(self, entity_id: str, beacon: Beacon) -> _Body:
        """A row with all that is known: each source's words, every claim, what has happened."""
        now_ns = self._clock.monotonic_ns()
        views = [
            {
                **_view(view, now_ns),
                "sender": view.stored.source,
                "restarts": view.stored.restarts,
                "first_seen_sec": max(0, now_ns - view.stored.first_seen_ns) / 1e9,
                "hint": build_response(view.stored, now_ns),
                "history": self._history(view.stored),
            }
            for view in beacon.views
        ]
        claims = [
            {
                "sender": claim.source,
                "age_sec": max(0, now_ns - claim.last_seen_ns) / 1e9,
                "hostname": claim.hint.hostname,
                "process_id": claim.hint.process_id,
                "process_name": claim.hint.process_name,
                "display_name": claim.hint.display_name,
            }
            for claim in beacon.claims
        ]
        return {**self.row(entity_id, beacon), "sources": views, "claims": claims}

    def sources(self) -> list[_Body]:
        """What there is to listen to, and how much each may hold."""
        configured = self._gateway.config.sources
        return [
            {
                "name": listener.name,
                "adapter": listener.adapter,
                "ttl_sec": listener.store.ttl_ns / 1e9,
                "expiry_sec": listener.store.expiry_ns / 1e9,
                "max_hints": configured[listener.name].max_hints,
            }
            for listener in self._gateway.listeners
        ]

    def expected(self) -> list[_Body]:
        """The apps that are known beforehand, heard or not: one who is missing should be missed.

        Not the components: few of them have a voice of their own.
        """
        return [
            {
                "entity_id": entity.id,
                **self.place(entity.id),
                **({"display_name": entity.name} if entity.name else {}),
                "depends_on": list(entity.depends_on[:_MAX_DEPENDS_ON]),
            }
            for entity in self._gateway.directory.tree().apps.values()
            if entity.source == _KNOWN
        ]

    def place(self, entity_id: str) -> _Body:
        """Its type; and where it is served, unless the tree does not take it in."""
        kind = self._gateway.directory.kind(entity_id)
        if kind is None or kind.value not in _COLLECTIONS:
            return {"type": "app"}
        href = f"{_API_BASE}/{_COLLECTIONS[kind.value]}/{entity_id}"
        return {"type": kind.value.lower(), "href": href}

    def timestamp(self) -> str:
        """Now, in UTC."""
        return _iso(self._clock.wall_ns())

    def _history(self, stored: StoredHint) -> list[_Body]:
        ahead_ns = self._clock.wall_ns() - self._clock.monotonic_ns()
        return [
            {
                "at": _iso(step.at_ns + ahead_ns),
                "status": step.status.value,
                "cause": step.cause.value,
                **({"reason": step.detail} if step.detail else {}),
            }
            for step in stored.history
        ]


def _rejected(source: str, refusals: Mapping[Verdict, Refusal]) -> _Body:
    return {
        "source": source,
        "count": sum(refusal.count for refusal in refusals.values()),
        "reasons": [
            {
                "verdict": verdict.value,
                "count": refusal.count,
                "sender": refusal.source,
                "detail": refusal.detail,
            }
            for verdict, refusal in refusals.items()
        ],
    }


def _view(view: View, now_ns: int) -> _Body:
    return {
        "source": view.source,
        "adapter": view.adapter,
        **_account(view.stored, now_ns),
        "conflict": view.stored.conflict,
    }


def _account(stored: StoredHint, now_ns: int) -> _Body:
    body: _Body = {
        "status": stored.status.value,
        "age_sec": stored.age_ns(now_ns) / 1e9,
        "cause": stored.cause.value,
    }
    return {**body, "reason": stored.detail} if stored.detail else body


def _iso(wall_ns: int) -> str:
    moment = dt.datetime.fromtimestamp(wall_ns // 1_000_000 / 1000, tz=dt.UTC)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
