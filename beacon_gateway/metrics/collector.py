"""A gateway's numbers as Prometheus reads them, and OpenTelemetry through its receiver.

Base units and the usual endings (``_total``, ``_bytes``, ``_timestamp_seconds``). Every label has a
bounded number of values, so a flood of invented entities is no flood of series; that is why the
series per entity are behind a switch, and why no words of a hint are in a label.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from beacon_core.clock import Clock
from beacon_core.limits import MAX_STORE_BYTES
from beacon_core.outcome import ACCEPTED, Verdict
from beacon_core.ports.health import Condition
from beacon_core.stored import StoreStats
from beacon_gateway import __version__
from beacon_gateway.gateway import Gateway
from beacon_gateway.listener import Listener

__all__ = ["GatewayCollector", "registry_of", "result_of"]

_RESULTS: Mapping[Verdict, str] = {
    **dict.fromkeys(ACCEPTED, "stored"),
    Verdict.OLDER: "ignored",
    Verdict.BURIED: "ignored",
    Verdict.UNKNOWN: "ignored",
    Verdict.SOURCE_RATE: "rate_limited",
    Verdict.GLOBAL_RATE: "rate_limited",
    Verdict.STORE_FULL: "full",
}

_TOTALS: Mapping[str, tuple[str, Callable[[StoreStats], int]]] = {
    "medkit_beacon_expired": ("Hints that expired.", lambda stats: stats.expired),
    "medkit_beacon_displaced": (
        "Hints that gave way to others in a full store.",
        lambda stats: stats.displaced,
    ),
    "medkit_beacon_restarts": (
        "Times that another process took over an entity.",
        lambda stats: stats.restarts,
    ),
}


def registry_of(gateway: Gateway, *, per_entity: bool = False) -> CollectorRegistry:
    """A registry of its own, so that several gateways fit in one process; with the process's CPU
    and memory."""
    registry = CollectorRegistry()
    registry.register(GatewayCollector(gateway, per_entity=per_entity))
    ProcessCollector(registry=registry)
    return registry


def result_of(verdict: Verdict) -> str:
    """Which of five results a verdict is: stored, ignored, rejected, rate_limited or full."""
    return _RESULTS.get(verdict, "rejected")


class GatewayCollector(Collector):
    """Reads everything when asked; keeps nothing.

    Thread rule: every method may be called from any thread.
    """

    def __init__(self, gateway: Gateway, *, per_entity: bool = False) -> None:
        """``per_entity``: also when each entity was last heard, one series for each."""
        self._gateway = gateway
        self._per_entity = per_entity

    def describe(self) -> Iterable[Metric]:
        """Nothing: a registry that asks need not have everything read for it."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """One family after another, as ``prometheus_client`` wants it."""
        listeners = self._gateway.listeners
        yield _build_info()
        yield from _stores(listeners)
        yield from _messages(listeners)
        yield _conditions(listeners)
        if self._per_entity:
            yield _last_seen(listeners, self._gateway.clock)


def _build_info() -> InfoMetricFamily:
    return InfoMetricFamily(
        "medkit_beacon_build", "Which gateway this is.", value={"version": __version__}
    )


def _stores(listeners: Iterable[Listener]) -> Iterator[Metric]:
    hints = GaugeMetricFamily(
        "medkit_beacon_hints", "Hints kept, by status.", labels=("status", "source")
    )
    conflicts = _gauge("medkit_beacon_conflicts", "Entities that two processes claim.")
    used = _gauge("medkit_beacon_store_used_bytes", "What the hints are accounted for.")
    room = _gauge("medkit_beacon_store_capacity", "Hints that fit in.")
    room_bytes = _gauge("medkit_beacon_store_capacity_bytes", "Bytes of hints that fit in.")
    totals = {name: _counter(name, text) for name, (text, _) in _TOTALS.items()}
    for listener in listeners:
        stats, label = listener.store.stats(), [listener.name]
        for status, count in _by_status(stats).items():
            hints.add_metric([status, listener.name], count)
        conflicts.add_metric(label, stats.conflicts)
        used.add_metric(label, stats.bytes)
        room.add_metric(label, listener.max_hints)
        room_bytes.add_metric(label, MAX_STORE_BYTES)
        for name, (_, count_of) in _TOTALS.items():
            totals[name].add_metric(label, count_of(stats))
    yield from (hints, conflicts, used, room, room_bytes, *totals.values())


def _messages(listeners: Iterable[Listener]) -> Iterator[Metric]:
    received = CounterMetricFamily(
        "medkit_beacon_received", "Messages, by what became of them.", labels=("source", "result")
    )
    tokens = _gauge(
        "medkit_beacon_rate_limit_tokens", "Messages that all senders may send at once."
    )
    senders = _gauge("medkit_beacon_senders", "Senders that are told apart.")
    for listener in listeners:
        results = Counter({result_of(verdict): 0 for verdict in Verdict})
        for verdict, count in listener.intake.totals().items():
            results[result_of(verdict)] += count
        for result, count in results.items():
            received.add_metric([listener.name, result], count)
        tokens.add_metric([listener.name], math.floor(listener.intake.tokens()))
        senders.add_metric([listener.name], listener.intake.source_count())
    yield from (received, tokens, senders)


def _conditions(listeners: Iterable[Listener]) -> GaugeMetricFamily:
    family = GaugeMetricFamily(
        "medkit_beacon_source_condition",
        "1 for the condition that the source is in, 0 for the others.",
        labels=("source", "adapter", "condition"),
    )
    for listener in listeners:
        now = listener.source.health().condition
        for condition in Condition:
            family.add_metric([listener.name, listener.adapter, condition], condition is now)
    return family


def _last_seen(listeners: Iterable[Listener], clock: Clock) -> GaugeMetricFamily:
    family = GaugeMetricFamily(
        "medkit_beacon_last_seen_timestamp_seconds",
        "When the entity was last heard, in seconds since 1970.",
        labels=("entity_id", "source"),
    )
    offset_ns = clock.wall_ns() - clock.monotonic_ns()
    for listener in listeners:
        for stored in listener.store.snapshot():
            label = [stored.entity_id, listener.name]
            family.add_metric(label, (stored.last_seen_ns + offset_ns) / 1e9)
    return family


def _by_status(stats: StoreStats) -> dict[str, int]:
    return {"active": stats.active, "stale": stats.stale, "left": stats.left}


def _gauge(name: str, text: str) -> GaugeMetricFamily:
    return GaugeMetricFamily(name, text, labels=("source",))


def _counter(name: str, text: str) -> CounterMetricFamily:
    return CounterMetricFamily(name, text, labels=("source",))
