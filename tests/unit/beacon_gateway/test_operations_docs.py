"""What is said about running a gateway, and the examples for it, fit what there is."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import attrs
import pytest
import yaml

from beacon_gateway import config, reload, server
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.access.options import AuthConfig, ClientEntry, CorsConfig, RateLimitConfig
from beacon_gateway.access.options import TlsConfig as HttpTlsConfig
from beacon_gateway.commands import run as run_command
from beacon_gateway.snapshot import SnapshotConfig

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant

TOP = Path(__file__).parents[3]
OPERATIONS = (TOP / "docs/operations.md").read_text()
CONFIGURATION = (TOP / "docs/configuration.md").read_text()
UNIT = (TOP / "examples/systemd/beacon.service").read_text()
DOCKERFILE = (TOP / "examples/docker/Dockerfile").read_text()
FILE = "/etc/beacon/gateway.yaml"


def runs(words: list[str]) -> None:
    """``beacon run`` understands them."""
    assert words[0] == "run"
    assert str(run_command.parser().parse_args(words[1:]).config) == FILE


def test_the_unit_starts_and_reloads_what_there_is() -> None:
    (line,) = re.findall(r"^ExecStart=\S+/beacon (.*)$", UNIT, re.MULTILINE)
    runs(shlex.split(line))
    assert f"beacon check-config {FILE}\n" in UNIT
    assert "ExecReload=/bin/kill -HUP $MAINPID" in UNIT
    assert "RestartPreventExitStatus=2" in UNIT


def test_the_image_starts_what_there_is_and_asks_whether_it_lives(plant: Plant) -> None:
    (line,) = re.findall(r"^CMD (.*)$", DOCKERFILE, re.MULTILINE)
    runs(yaml.safe_load(line))
    (asked,) = re.findall(r"https://127.0.0.1:8443(/\w+)", DOCKERFILE)
    assert plant.get(asked).status_code == 200


def test_the_image_s_configuration_may_be_open_to_a_network() -> None:
    path = TOP / "examples/docker/gateway.yaml"
    loaded = config.load_config(path)
    assert loaded.corrections == ()
    assert check_exposure(loaded.config.http) == ""
    assert loaded.config.http.port == 8443
    assert re.search(r"^EXPOSE 8443 7447$", DOCKERFILE, re.MULTILINE)
    assert loaded.config.snapshot is not None
    assert f"VOLUME {loaded.config.snapshot.path.parent}\n" in DOCKERFILE


def test_the_snapshot_s_example_is_a_configuration() -> None:
    examples = re.findall(r"^```yaml\n(.*?)^```", OPERATIONS, re.DOTALL | re.MULTILINE)
    (example,) = [one for one in examples if "snapshot:" in one]
    assert config.parse_config(yaml.safe_load(example)).corrections == ()


def test_everything_that_can_change_while_serving_is_named_and_nothing_else() -> None:
    table = OPERATIONS.partition("| changes while serving |")[2].partition("\n\n")[0]
    rows = [row.split("|") for row in table.splitlines()[2:]]
    live = {name for row in rows for name in re.findall(r"`(?:http\.)?(\w+)`", row[1])}
    assert live == reload._LIVE | reload._LIVE_HTTP
    fixed = {name for row in rows for name in re.findall(r"`(?:http\.)?(\w+)`", row[2])}
    fields = {
        field.name for cls in (config.Config, config.HttpConfig) for field in attrs.fields(cls)
    }
    tree = {"http", "strict_upstream_merge", "runtime_nodes", "default_component"}
    assert fixed == fields - live - tree


@pytest.mark.parametrize(
    "cls",
    [AuthConfig, ClientEntry, CorsConfig, RateLimitConfig, HttpTlsConfig, SnapshotConfig],
)
def test_every_key_of_access_is_documented(cls: type[attrs.AttrsInstance]) -> None:
    missing = [field.name for field in attrs.fields(cls) if f"`{field.name}`" not in CONFIGURATION]
    assert missing == []


def test_the_limits_are_those_there_are() -> None:
    assert f"`http.max_streams` + {run_command._OTHER_CONNECTIONS}" in OPERATIONS
    assert server._UNREAD_S == 30
    assert "20 to 30 s" in OPERATIONS
