"""What docs/relay.md says is so."""

from __future__ import annotations

import re
from pathlib import Path

import attrs
import pytest
import yaml

from beacon_core.relay.ledger import Fate
from beacon_gateway.config import parse_config
from beacon_gateway.relay import config, file
from beacon_gateway.relay.metrics import RelayCollector
from tests.unit.beacon_gateway.relay.plant import Plant, end

RELAY = (Path(__file__).parents[4] / "docs" / "relay.md").read_text()


@pytest.mark.parametrize(
    "cls",
    [
        config.RelayConfig,
        config.EndConfig,
        config.ForwardConfig,
        config.RepublishConfig,
        config.RuleConfig,
        file.RelayFile,
        file.RelayHttp,
    ],
)
def test_every_key_is_documented(cls: type[attrs.AttrsInstance]) -> None:
    missing = [field.name for field in attrs.fields(cls) if f"`{field.name}`" not in RELAY]
    assert missing == []


def test_the_defaults_are_as_documented() -> None:
    shown = dict(re.findall(r"^\| `(\w+)` \| ([\d.]+) (?:MiB )?\|", RELAY, re.MULTILINE))
    forward, republish = config.ForwardConfig(), config.RepublishConfig()
    assert shown["message_bytes"] == str(forward.message_bytes // 2**20)
    assert shown["hold_bytes"] == str(republish.hold_bytes // 2**20)
    assert forward.hold_bytes == republish.hold_bytes
    assert shown["max_routes"] == str(forward.max_routes)
    assert shown["max_hops"] == str(forward.max_hops)
    assert shown["max_origins"] == str(republish.max_origins)
    assert float(shown["gap_s"]) == republish.gap_s
    assert float(shown["match_s"]) == republish.match_s


def test_every_fate_is_documented() -> None:
    assert [fate for fate in Fate if fate.value not in RELAY] == []


def test_every_metric_is_documented(plant: Plant, link: str) -> None:
    relay = plant.relay({"a": end("n", link, forward=[], republish=True)})
    for family in RelayCollector(relay).collect():
        name = family.name.removeprefix("beacon_relay_")
        assert re.search(rf"`(beacon_relay)?_{name}(_total)?`", RELAY), family.name


def test_the_tutorials_configurations_are_configurations() -> None:
    robot, base = re.findall(r"^```yaml\n(.*?)^```", RELAY, re.DOTALL | re.MULTILINE)
    assert list(file.parse_relay_file(yaml.safe_load(robot)).ends) == ["robot"]
    relay = parse_config(yaml.safe_load(base)).config.relay
    assert relay is not None
    assert list(relay.ends) == ["base"]
