"""A relay's numbers for Prometheus: each message in exactly one of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from beacon_core.relay.forwarding import RouteState
from beacon_core.relay.lane import LaneState
from beacon_core.relay.ledger import Fate
from beacon_gateway.relay.end import State
from beacon_gateway.relay.relay import Relay

__all__ = ["RelayCollector"]

_BOTH = ("end", "side")


class RelayCollector(Collector):
    """Reads everything when asked; keeps nothing. Thread rule: any thread."""

    def __init__(self, relay: Relay) -> None:
        self._relay = relay

    def describe(self) -> Iterable[Metric]:
        """Nothing: a registry that asks need not have everything read for it."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """One family after another, as ``prometheus_client`` wants it."""
        told = self._relay.states()
        states = {name: state for name, state in told.items() if state is not None}
        yield _links(told)
        yield from _books(states)
        yield from _topics(states)


def _links(states: Mapping[str, State | None]) -> Metric:
    """One that is stuck counts as down, and tells nothing else."""
    family = GaugeMetricFamily(
        "beacon_relay_link_up", "1 if frames may get through.", labels=["end"]
    )
    for name, state in states.items():
        family.add_metric([name], state is not None and state.linked)
    return family


def _books(states: Mapping[str, State]) -> Iterator[Metric]:
    entered = CounterMetricFamily(
        "beacon_relay_messages", "Messages that a side took charge of.", labels=_BOTH
    )
    ended = CounterMetricFamily(
        "beacon_relay_ended", "Messages that ended, by how.", labels=(*_BOTH, "fate")
    )
    held = GaugeMetricFamily("beacon_relay_held", "Messages that are held.", labels=_BOTH)
    held_bytes = GaugeMetricFamily(
        "beacon_relay_held_bytes", "What is held, with overhead.", labels=_BOTH
    )
    missing = GaugeMetricFamily(
        "beacon_relay_missing", "Messages announced that have not come.", labels=["end"]
    )
    for name, state in states.items():
        for side, stats in (("forward", state.forwarder), ("republish", state.republisher)):
            if stats is None:
                continue
            entered.add_metric([name, side], stats.entered)
            held.add_metric([name, side], stats.held)
            held_bytes.add_metric([name, side], stats.held_bytes)
            for fate in Fate:
                ended.add_metric([name, side, fate.value], stats.fates.get(fate, 0))
        if state.republisher is not None:
            missing.add_metric([name], state.republisher.missing)
    yield from (entered, ended, held, held_bytes, missing)


def _topics(states: Mapping[str, State]) -> Iterator[Metric]:
    routes = GaugeMetricFamily(
        "beacon_relay_routes", "Topics that are forwarded, by state.", labels=("end", "state")
    )
    lanes = GaugeMetricFamily(
        "beacon_relay_topics", "Topics that are published, by state.", labels=("end", "state")
    )
    for name, state in states.items():
        if state.forwarder is not None:
            for route_state in RouteState:
                count = sum(one.state is route_state for one in state.routes)
                routes.add_metric([name, route_state.value], count)
        if state.republisher is not None:
            for lane_state in LaneState:
                count = sum(one.state is lane_state for one in state.lanes)
                lanes.add_metric([name, lane_state.value], count)
    yield from (routes, lanes)
