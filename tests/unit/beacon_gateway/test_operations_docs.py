"""What is said about running a gateway, and the examples for it, fit what there is."""

from __future__ import annotations

import configparser
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import attrs
import pytest
import yaml

from beacon_gateway import cli, config, reload, server
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.access.options import AuthConfig, ClientEntry, CorsConfig, RateLimitConfig
from beacon_gateway.access.options import TlsConfig as HttpTlsConfig
from beacon_gateway.commands import run as run_command
from beacon_gateway.console.exits import Exit
from beacon_gateway.snapshot import SnapshotConfig

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant

TOP = Path(__file__).parents[3]
OPERATIONS = (TOP / "docs/operations.md").read_text()
CONFIGURATION = (TOP / "docs/configuration.md").read_text()
UNIT = (TOP / "examples/systemd/beacon.service").read_text()
DOCKERFILE = (TOP / "examples/docker/Dockerfile").read_text()
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text())
FILE = "/etc/beacon/gateway.yaml"


def runs(words: list[str]) -> None:
    """``beacon run`` understands them."""
    assert words[0] == "run"
    assert str(run_command.parser().parse_args(words[1:]).config) == FILE


def understood(words: list[str]) -> None:
    """There is such a command, and it knows each word."""
    program, command, *rest = words
    assert program == "/opt/beacon/bin/beacon"
    assert command in cli.COMMANDS
    cli._load(command).parser().parse_args(rest)


def test_the_unit_calls_commands_that_there_are_with_words_that_they_know() -> None:
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    unit.read_string(UNIT)
    assert {*unit.sections()} == {"Unit", "Service", "Install"}
    service = unit["Service"]
    for key in ("ExecStartPre", "ExecStart"):
        understood(shlex.split(service[key]))
    assert service["ExecReload"].split()[0] == "/bin/kill"
    assert int(service["RestartPreventExitStatus"]) == Exit.USAGE
    assert_installs(re.findall(r"^# Once:.* install '([^']+)'$", UNIT, re.MULTILINE)[0])


def test_the_image_is_made_of_what_there_is() -> None:
    steps = [
        line.split(None, 1)
        for line in re.sub(r"\\\n", "", DOCKERFILE).splitlines()
        if line and not line.startswith("#")
    ]
    said: dict[str, list[str]] = {}
    for word, rest in steps:
        said.setdefault(word, []).append(rest)
    # Both stages run the same Python, so the folder can go from one to the other.
    assert len({one.split()[0] for one in said["FROM"]}) == 1
    copied, (source, target) = said["COPY"][0].split(), said["COPY"][1].split()[1:]
    assert (copied, source, target) == ([".", "/src"], "/opt/beacon", "/opt/beacon")
    made, pip = (shlex.split(one) for one in said["RUN"][0].split("&&"))
    assert made == ["python", "-m", "venv", target]
    assert (pip[0], pip[1]) == (f"{target}/bin/pip", "install")
    assert pip[-1].startswith("/src[")
    assert_installs(pip[-1].replace("/src", "beacon-core"))
    understood([*yaml.safe_load(said["ENTRYPOINT"][0]), *yaml.safe_load(said["CMD"][0])])
    python, flag, program = yaml.safe_load(said["HEALTHCHECK"][0].partition("CMD ")[2])
    assert (python, flag) == (f"{target}/bin/python", "-c")
    compile(program, "HEALTHCHECK", "exec")


def test_the_image_is_given_all_that_it_is_made_of() -> None:
    ignored = (TOP / "examples/docker/Dockerfile.dockerignore").read_text()
    given = set(re.findall(r"^!(\S+)$", ignored, re.MULTILINE))
    packages = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    needed = {one.partition("/")[0] for one in packages} | {"pyproject.toml", "README.md"}
    assert needed <= given
    assert all((TOP / one).exists() for one in given)


def assert_installs(requirement: str) -> None:
    """The package, with extras that it has."""
    name, _, extras = requirement.rstrip("]").partition("[")
    assert name == PROJECT["project"]["name"]
    assert {*extras.split(",")} <= {*PROJECT["project"]["optional-dependencies"]}


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd is not installed")
def test_systemd_has_nothing_to_say_of_the_unit(tmp_path: Path) -> None:
    unit = tmp_path / "beacon.service"
    unit.write_text(UNIT.replace("/opt/beacon/bin/beacon", "/bin/true"))
    command = ["systemd-analyze", "verify", "--man=no", str(unit)]
    found = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert (found.returncode, found.stdout + found.stderr) == (0, "")


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
