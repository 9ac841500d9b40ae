"""How the gateway, its sources and its tree are doing."""

from __future__ import annotations

from beacon_gateway.config import Config, EntitiesConfig
from beacon_gateway.gateway import Gateway
from beacon_gateway.http.models.base import Open
from beacon_gateway.http.models.server import (
    GatewayHealth,
    HealthDiscovery,
    HealthDiscoveryLinking,
    HealthStatus,
    SourceHealth,
)
from beacon_gateway.listener import Listener
from beacon_gateway.tree.linker import Linking, Unmanifested
from beacon_gateway.tree.merge import Conflict

__all__ = ["health_of"]

_SHOWN = 100
"""Conflicts that are told; all of them are counted."""


def health_of(gateway: Gateway) -> HealthStatus:
    """Always "healthy", as clients expect; what ails a source is said in its own part."""
    clock = gateway.clock
    return HealthStatus(
        status="healthy",
        timestamp=clock.wall_ns(),
        warning_schema_version=2,
        warnings=[],
        discovery=_discovery(gateway),
        beacon=GatewayHealth(
            uptime_sec=(clock.monotonic_ns() - gateway.started_ns) / 1e9,
            sources=[_source(listener) for listener in gateway.listeners],
        ),
    )


def _discovery(gateway: Gateway) -> HealthDiscovery:
    report = gateway.directory.report()
    # Beacons are always heard, so the question is only whether anything is known beforehand.
    config = gateway.config
    told = bool(config.manifest) or config.entities != EntitiesConfig()
    mode, strategy = ("hybrid", "hybrid") if told else ("runtime_only", "runtime")
    return HealthDiscovery(
        mode=mode,
        strategy=strategy,
        pipeline={
            "layers": report.layers,
            "total_entities": report.total_entities,
            "enriched_count": report.enriched_count,
            "conflict_count": report.conflict_count,
            "conflicts": [_conflict(one) for one in report.conflicts[:_SHOWN]],
            "id_collisions": report.id_collisions,
            # Nothing is guessed from namespaces, so nothing that was guessed is left out.
            "filtered_by_gap_fill": 0,
        },
        linking=None if report.linking is None else _linking(report.linking, config),
    )


def _conflict(conflict: Conflict) -> Open:
    return {
        "entity_id": conflict.entity_id,
        "field_group": conflict.field_group.value,
        "winning_layer": conflict.winning_layer,
        "losing_layer": conflict.losing_layer,
    }


def _linking(linking: Linking, config: Config) -> HealthDiscoveryLinking:
    # Without a manifest there is no policy, and clients expect one: the one that does the same.
    included = Unmanifested.INCLUDE_AS_ORPHAN if config.runtime_nodes else Unmanifested.IGNORE
    return HealthDiscoveryLinking(
        linked_count=linking.linked_count,
        orphan_count=linking.orphan_count,
        binding_conflicts=linking.binding_conflicts,
        unmanifested_policy=linking.policy or included,
    )


def _source(listener: Listener) -> SourceHealth:
    health, intake = listener.source.health(), listener.intake
    stats, silence_ns = listener.store.stats(), intake.silence_ns()
    return SourceHealth(
        name=listener.name,
        adapter=listener.adapter,
        condition=health.condition.value,
        counters=dict(health.counters),
        messages={verdict.value: n for verdict, n in intake.totals().items()},
        senders=intake.source_count(),
        tokens=intake.tokens(),
        hints={
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
        last_message_sec=None if silence_ns is None else silence_ns / 1e9,
        detail=health.detail or None,
    )
