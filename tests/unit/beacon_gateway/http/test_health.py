"""How the gateway says that it, its sources and its tree are doing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import attrs
import pytest

from beacon_core.clock import ManualClock
from beacon_fake import ADAPTER, FakeNetwork, FakeSource
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http.health import health_of

if TYPE_CHECKING:
    from pathlib import Path

    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker


def source(plant: Plant) -> Any:
    return plant.ok("/health")["x-medkit-beacon"]["sources"][0]


def test_a_source_tells_how_long_it_has_been_silent(make_plant: PlantMaker) -> None:
    plant = make_plant()
    assert "last_message_sec" not in source(plant)
    plant.announce("a")
    plant.wait(2.5)
    assert source(plant)["last_message_sec"] == 2.5
    plant.gateway.listeners[0].intake.offer(b"no hint", "fool")
    assert source(plant)["last_message_sec"] == 0.0


def test_a_source_tells_how_much_it_would_take_at_once(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"global_rate": 50}})
    assert source(plant)["tokens"] == 50.0
    for number in range(3):
        plant.announce(f"a{number}")
    assert 47 <= source(plant)["tokens"] < 48
    plant.wait(10)
    assert source(plant)["tokens"] == 50.0


class Seeing(FakeSource):
    """A source whose carrier shows the ROS graph."""

    def nodes(self) -> frozenset[str]:
        return frozenset({"/driver"})


@pytest.mark.parametrize(
    ("written", "runtime_nodes", "told"),
    [
        ("", False, "ignore"),
        ("", True, "include_as_orphan"),
        ("{}", True, "warn"),
        ("{unmanifested_nodes: error}", False, "error"),
    ],
)
def test_what_becomes_of_nodes_that_nobody_wrote_down_is_told_as_it_is(
    tmp_path: Path, written: str, *, runtime_nodes: bool, told: str
) -> None:
    adapter = attrs.evolve(ADAPTER, source=lambda _: Seeing(FakeNetwork(ManualClock())))
    document: dict[str, Any] = {
        "sources": {"ros": {"adapter": "fake", "options": {"network": "none"}}},
        "runtime_nodes": runtime_nodes,
    }
    if written:
        document["manifest"] = "manifest.yaml"
        (tmp_path / "manifest.yaml").write_text(f'manifest_version: "1.0"\nconfig: {written}\n')
    config = parse_config(document, lambda _: adapter, folder=tmp_path).config
    gateway = Gateway(config, lookup=lambda _: adapter)
    discovery = health_of(gateway).discovery
    assert discovery is not None
    assert discovery.linking is not None
    assert discovery.linking.unmanifested_policy == told
    assert discovery.linking.orphan_count == 1
    shown = "driver" in gateway.directory.tree().apps
    assert shown == runtime_nodes
