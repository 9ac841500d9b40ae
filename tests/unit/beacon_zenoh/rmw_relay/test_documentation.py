"""What docs/adapters/zenoh_rmw.md says of the relay is so."""

from __future__ import annotations

import re
from pathlib import Path

import attrs
import yaml

from beacon_core.relay.merging import MAX_DURABLE_DEPTH
from beacon_gateway.config import parse_config
from beacon_zenoh.options import SessionOptions
from beacon_zenoh.rmw_relay import RmwNetworkOptions
from beacon_zenoh.rmw_relay.intake import MOST_WAITING
from beacon_zenoh.rmw_relay.station import MAX_MARKS

PAGE = Path(__file__).parents[4] / "docs" / "adapters" / "zenoh_rmw.md"
_, _, SECTION = PAGE.read_text("utf-8").partition("\n## Beside a relay\n")
SECTION, _, _ = SECTION.partition("\n## ")


def test_every_option_is_documented_with_its_default() -> None:
    shared = {one.name for one in attrs.fields(SessionOptions)}
    shown = dict(re.findall(r"^\| `(\w+)` \| (\d+) \|", SECTION, re.MULTILINE))
    own = [one for one in attrs.fields(RmwNetworkOptions) if one.name not in shared]
    assert shown == {one.name: str(one.default) for one in own}
    assert [name for name in shared if f"`{name}`" not in SECTION] == []


def test_the_numbers_are_ours() -> None:
    assert f"{MAX_DURABLE_DEPTH} at most" in SECTION
    assert f"{MAX_MARKS} marks" in SECTION
    assert f"{MOST_WAITING:,} messages" in SECTION


def test_the_example_is_a_configuration_of_ours() -> None:
    (block,) = re.findall(r"^```yaml\n(.*?)^```", SECTION, re.DOTALL | re.MULTILINE)
    relay = parse_config({"relay": yaml.safe_load(block)}).config.relay
    assert relay is not None
    options = relay.ends["robot"].network.options
    assert options == RmwNetworkOptions(connect=("tcp/127.0.0.1:7447",), domain_id=0)
