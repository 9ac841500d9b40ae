"""How a relay is, as plain data: for JSON, the page and the terminal alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs

from beacon_core.clock import Clock
from beacon_core.relay.forwarding import ForwarderStats, RouteStatus
from beacon_core.relay.ledger import Fate
from beacon_core.relay.names import Ruling
from beacon_core.relay.republishing import LaneStatus, RepublisherStats
from beacon_core.relay.values import Mode
from beacon_gateway.relay.end import State
from beacon_gateway.relay.relay import EndName, Relay

__all__ = ["explained", "report"]


def report(relay: Relay) -> dict[str, Any]:
    """All ends, with their routes and their books; of one that is stuck, only that it is."""
    return {
        "ends": [
            _end(name, relay.names[name], state, relay.clock)
            for name, state in relay.states().items()
        ]
    }


def explained(relay: Relay, topic: str) -> dict[str, Any]:
    """Of each end that forwards: what its rules say of a topic, and what became of it.

    ``TimeoutError`` if one is stuck.
    """
    ends = []
    for name, end in relay.ends.items():
        found = end.explain(topic)
        if found is not None:
            routes = [_route(one) for one in found.routes]
            ends.append({"end": name, **_ruling(found.ruling), "routes": routes})
    return {"topic": topic, "ends": ends}


def _end(name: str, who: EndName, state: State | None, clock: Clock) -> dict[str, Any]:
    told: dict[str, Any] = {
        "name": name,
        "network": who.network,
        "conduit": who.conduit,
        "origin": f"{who.origin:016x}",
        "epoch": who.epoch,
    }
    if state is None:
        return {**told, "link": "stuck", "link_since_sec": 0.0}
    told["link"] = "up" if state.linked else "down"
    told["link_since_sec"] = _seconds_since(state.linked_since_ns, clock)
    if state.forwarder is not None:
        told["forward"] = _forward(state.forwarder, state)
    if state.republisher is not None:
        told["republish"] = _republish(state.republisher, state, clock)
    return told


def _forward(stats: ForwarderStats, state: State) -> dict[str, Any]:
    return {
        "messages": stats.entered,
        "held": stats.held,
        "held_bytes": stats.held_bytes,
        "ended": _ended(stats.fates),
        "frames": {"malformed": stats.malformed, "foreign": stats.foreign},
        "routes": [_route(one) for one in state.routes],
    }


def _republish(stats: RepublisherStats, state: State, clock: Clock) -> dict[str, Any]:
    return {
        "messages": stats.entered,
        "held": stats.held,
        "held_bytes": stats.held_bytes,
        "missing": stats.missing,
        "pending": stats.pending,
        "ended": _ended(stats.fates),
        "origins": stats.origins,
        "frames": attrs.asdict(stats.frames),
        "topics": [_lane(one, clock) for one in state.lanes],
    }


def _route(one: RouteStatus) -> dict[str, Any]:
    return {
        "topic": one.topic,
        "name": one.name,
        "state": one.state.value,
        "reason": one.reason,
        "route": one.route,
        "mode": _mode(one.mode),
        "messages": one.next,
        "held": one.held,
        "held_bytes": one.held_bytes,
        "ended": _ended(one.fates),
    }


def _lane(one: LaneStatus, clock: Clock) -> dict[str, Any]:
    return {
        "name": one.name,
        "origin": f"{one.origin:016x}",
        "type": one.type.name if one.type else "",
        "type_hash": one.type.digest if one.type else "",
        "mode": _mode(one.mode),
        "state": one.state.value,
        "reason": one.reason,
        "since_sec": _seconds_since(one.since_ns, clock),
        "waiting": one.waiting,
        "missing": one.missing,
    }


def _ruling(ruling: Ruling) -> dict[str, Any]:
    return {
        "allowed": ruling.allowed,
        "name": ruling.name,
        "rule": ruling.rule,
        "reason": ruling.reason,
        "mode": _mode(ruling.mode),
    }


def _ended(fates: Mapping[Fate, int]) -> dict[str, int]:
    return {fate.value: fates[fate] for fate in Fate if fates.get(fate)}


def _mode(mode: Mode | None) -> str:
    return "" if mode is None else mode.name.lower()


def _seconds_since(at_ns: int, clock: Clock) -> float:
    return round((clock.monotonic_ns() - at_ns) / 1e9, 3)
