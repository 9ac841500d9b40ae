"""Metrics, liveness and readiness of a gateway on simulated carriers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.ports.health import Condition, Health
from beacon_gateway import __version__
from beacon_gateway.metrics.collector import GatewayCollector, result_of

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker


def samples(plant: Plant) -> dict[str, dict[tuple[tuple[str, str], ...], float]]:
    """Name -> labels -> value, as Prometheus reads it."""
    answer = plant.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/plain")
    found: dict[str, dict[tuple[tuple[str, str], ...], float]] = {}
    for family in text_string_to_metric_families(answer.text):
        for sample in family.samples:
            labels = tuple(sorted(sample.labels.items()))
            found.setdefault(sample.name, {})[labels] = sample.value
    return found


def by(found: dict[tuple[tuple[str, str], ...], float], label: str) -> dict[str, float]:
    return {dict(labels)[label]: value for labels, value in found.items()}


def test_hints_are_counted_by_status_and_source(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"ttl_s": 5}, "plant": {"max_hints": 7}})
    plant.announce("silent")
    plant.wait(6)
    plant.announce("well")
    plant.announce("other", source="plant")
    plant.announce("gone").close()
    plant.settle()
    found = samples(plant)
    hints = found["medkit_beacon_hints"]
    assert hints[(("source", "robots"), ("status", "active"))] == 1
    assert hints[(("source", "robots"), ("status", "stale"))] == 1
    assert hints[(("source", "robots"), ("status", "left"))] == 1
    assert hints[(("source", "plant"), ("status", "active"))] == 1
    assert by(found["medkit_beacon_store_capacity"], "source") == {"robots": 10_000, "plant": 7}
    assert by(found["medkit_beacon_store_used_bytes"], "source")["plant"] > 0


def test_messages_are_counted_by_what_became_of_them(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"max_hints": 1, "source_rate": 20}})
    plant.announce("a")
    plant.announce("b")
    intake = plant.gateway.listeners[0].intake
    intake.offer(b"no hint", "stranger")
    for _ in range(30):
        intake.offer(b"{}", "loud")
    received = by(samples(plant)["medkit_beacon_received_total"], "result")
    assert received["stored"] == 1
    assert received["full"] == 1
    assert received["ignored"] == 0
    assert received["rejected"] >= 2
    assert received["rate_limited"] >= 10
    assert sum(received.values()) == sum(intake.totals().values())


@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_is_one_of_five_results(verdict: Verdict) -> None:
    known = {"stored", "ignored", "rejected", "rate_limited", "full"}
    assert result_of(verdict) in known
    rejected = {Verdict.TOO_LARGE, Verdict.MALFORMED, Verdict.INVALID, Verdict.FAULT}
    assert (result_of(verdict) == "rejected") == (verdict in rejected)


def test_tokens_that_are_left_can_be_seen(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"global_rate": 50}})
    assert by(samples(plant)["medkit_beacon_rate_limit_tokens"], "source") == {"robots": 50}
    plant.announce("a")
    assert by(samples(plant)["medkit_beacon_rate_limit_tokens"], "source") == {"robots": 49}


def test_conflicts_restarts_and_expiries_are_counted(plant: Plant) -> None:
    plant.announce("old")
    plant.wait(301)
    plant.announce("again", process_id=1)
    plant.announce("again", process_id=2)
    plant.announce("torn", hostname="one")
    plant.announce("torn", hostname="two")
    found = samples(plant)
    assert by(found["medkit_beacon_expired_total"], "source") == {"robots": 1}
    assert by(found["medkit_beacon_restarts_total"], "source") == {"robots": 1}
    assert by(found["medkit_beacon_conflicts"], "source") == {"robots": 1}


def test_the_build_and_the_condition_of_each_source_are_said(plant: Plant) -> None:
    found = samples(plant)
    assert found["medkit_beacon_build_info"] == {(("version", __version__),): 1}
    condition = by(found["medkit_beacon_source_condition"], "condition")
    assert condition == {one: float(one == "up") for one in Condition}
    assert found["process_resident_memory_bytes"][()] > 1e6


def test_entities_are_no_series_unless_asked_for(make_plant: PlantMaker) -> None:
    plain, full = make_plant(), make_plant(http={"metrics_per_entity": True})
    for plant in (plain, full):
        plant.announce("lidar", metadata={"secret": "x"})
    assert "lidar" not in plain.get("/metrics").text
    seen = samples(full)["medkit_beacon_last_seen_timestamp_seconds"]
    labels = (("entity_id", "lidar"), ("source", "robots"))
    assert seen[labels] == pytest.approx(full.clock.wall_ns() / 1e9, abs=1)
    assert "secret" not in full.get("/metrics").text


def test_openmetrics_is_spoken_where_it_is_asked_for(
    plant: Plant, serve: Callable[[Plant], str]
) -> None:
    accept = {"accept": "application/openmetrics-text; version=1.0.0"}
    answer = httpx.get(f"{serve(plant)}/metrics", headers=accept)
    assert answer.headers["content-type"].startswith("application/openmetrics-text")
    assert answer.text.endswith("# EOF\n")


def test_every_family_says_what_it_is_and_has_a_usual_name(plant: Plant) -> None:
    for family in GatewayCollector(plant.gateway, per_entity=True).collect():
        assert family.name.startswith("medkit_beacon_")
        assert family.documentation.endswith(".")
        assert not family.name.endswith("_total")
    assert list(GatewayCollector(plant.gateway).describe()) == []


def test_two_gateways_do_not_share_their_numbers(make_plant: PlantMaker) -> None:
    one, other = make_plant(), make_plant()
    one.announce("a")
    hints = (("source", "robots"), ("status", "active"))
    assert samples(one)["medkit_beacon_hints"][hints] == 1
    assert samples(other)["medkit_beacon_hints"][hints] == 0


# alive and ready


def test_a_gateway_at_work_is_alive_and_ready(plant: Plant) -> None:
    for path in ("/livez", "/readyz"):
        answer = plant.get(path)
        assert (answer.status_code, answer.json()) == (200, {"status": "ok"})


def test_a_closed_gateway_is_neither_and_says_why(plant: Plant) -> None:
    plant.gateway.close()
    live, ready = plant.get("/livez"), plant.get("/readyz")
    assert (live.status_code, ready.status_code) == (503, 503)
    assert live.json()["reasons"] == ["the sweeper does not turn"]
    assert ready.json()["reasons"] == ["the gateway is not started, or is closed"]


@pytest.mark.parametrize(
    ("condition", "status"),
    [
        (Condition.STARTING, 503),
        (Condition.UP, 200),
        (Condition.DEGRADED, 200),
        (Condition.DOWN, 200),
        (Condition.CLOSED, 503),
    ],
)
def test_ready_is_who_has_begun_on_every_source(
    plant: Plant, monkeypatch: pytest.MonkeyPatch, condition: Condition, status: int
) -> None:
    source: Any = plant.gateway.listeners[0].source
    monkeypatch.setattr(source, "health", lambda: Health(condition))
    answer = plant.get("/readyz")
    assert answer.status_code == status
    if status == 503:
        assert answer.json()["reasons"] == [f"the source robots is {condition}"]


def test_a_sweeper_that_hangs_is_not_alive(
    make_plant: PlantMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = make_plant(sources={"robots": {"ttl_s": 0.1}})
    released = threading.Event()
    store: Any = plant.gateway.listeners[0].store
    monkeypatch.setattr(store, "sweep", lambda: released.wait(30))
    monkeypatch.setattr("beacon_gateway.gateway._SWEEPER_LATE_S", 0.05)
    deadline = threading.Event()
    for _ in range(500):
        if plant.get("/livez").status_code == 503:
            break
        deadline.wait(0.02)
    assert plant.get("/livez").status_code == 503
    released.set()
    plant.announcer("x").announce(BeaconHint("x"))
