"""Access as the ``beacon`` command meets it: making tokens, showing them, and where to serve."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
import pytest

from beacon_gateway import cli
from beacon_gateway.access.api_tokens import ApiTokens, Identity
from beacon_gateway.access.roles import Role
from beacon_gateway.access.secrets import secret_matches
from beacon_gateway.config import parse_config

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

Capture = pytest.CaptureFixture[str]
Serve = Callable[["Plant"], str]


@pytest.fixture(autouse=True)
def _restored() -> Iterator[None]:
    """The command sets up logging for its process, which is that of all tests here."""
    root = logging.getLogger()
    level, handlers = root.level, root.handlers[:]
    yield
    root.setLevel(level)
    root.handlers[:] = handlers


def beacon(*arguments: object) -> int:
    try:
        return cli.main([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)


def test_a_token_and_its_line_fit(tmp_path: Path, capsys: Capture) -> None:
    assert beacon("token", "hmi", "--role", "operator", "--json") == 0
    made = json.loads(capsys.readouterr().out)
    path = tmp_path / "tokens.txt"
    path.write_text(made["line"] + "\n")
    tokens = ApiTokens.read(path)
    assert tokens.owner(made["token"]) == Identity("hmi", Role.OPERATOR)
    assert tokens.owner(made["token"] + "x") is None
    assert made["token"] not in made["line"]


def test_a_client_s_secret_and_its_hash_fit(capsys: Capture) -> None:
    assert beacon("token", "hmi", "--client", "--json") == 0
    made = json.loads(capsys.readouterr().out)
    assert secret_matches(made["secret"], made["secret_hash"])
    auth = {
        "secret_file": "x",
        "clients": [{"id": made["name"], "secret_hash": made["secret_hash"]}],
    }
    parse_config({"http": {"auth": auth}})


@pytest.mark.parametrize("more", [[], ["--client"]])
def test_people_get_two_lines_and_another_secret_each_time(
    capsys: Capture, more: list[str]
) -> None:
    said = []
    for _ in range(2):
        assert beacon("token", "hmi", *more) == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) == 2
        said.append(lines[0])
    assert said[0] != said[1]


@pytest.mark.parametrize("name", ["", "a:b", "a b", "a\n", "ä", "x" * 65])
def test_a_name_is_no_riddle_to_the_tokens_file(capsys: Capture, name: str) -> None:
    assert beacon("token", name) == 2
    assert "is no name" in capsys.readouterr().err


def test_the_command_shows_the_token_of_the_environment(
    make_plant: PlantMaker,
    serve: Serve,
    capsys: Capture,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    beacon("token", "me", "--json")
    made = json.loads(capsys.readouterr().out)
    path = tmp_path / "tokens.txt"
    path.write_text(made["line"])
    plant = make_plant(http={"auth": {"tokens_file": str(path)}})
    plant.announce("lidar")
    url = serve(plant)
    assert beacon("get", "--url", url) == 1
    assert capsys.readouterr().err == (
        f"beacon: the gateway at {url} wants a token that may read (HTTP 401); "
        "put it into the variable BEACON_TOKEN\n"
    )
    monkeypatch.setenv("BEACON_TOKEN", made["token"])
    assert beacon("get", "lidar", "--url", url) == 0
    assert httpx.get(f"{url}/api/v1/apps").status_code == 401


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    def write(http: str) -> Path:
        path = tmp_path / "gateway.yaml"
        path.write_text(f"sources: {{a: {{adapter: fake}}}}\nhttp: {http}\n")
        return path

    return write


def test_serving_elsewhere_without_tls_is_wrong_usage(
    file: Callable[[str], Path], capsys: Capture
) -> None:
    assert beacon("run", "-c", file("{port: 0}"), "--host", "0.0.0.0") == 2  # noqa: S104
    said = capsys.readouterr().err
    assert said.startswith("beacon: $.http.host: serving on 0.0.0.0 needs TLS")
    assert "--allow-insecure" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("http", "said"),
    [
        ("{port: 0, auth: {tokens_file: nowhere}}", "nowhere: No such file"),
        ("{port: 0, tls: {certificate: a, key: b}}", "a: no such file"),
    ],
)
def test_files_that_are_not_there_are_wrong_configuration(
    file: Callable[[str], Path], capsys: Capture, http: str, said: str
) -> None:
    path = file(http)
    assert beacon("run", "-c", path) == 2
    error = capsys.readouterr().err
    assert f"{path.parent}/{said}" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("http", "said"),
    [
        ("{host: 192.0.2.1}", "serving on 192.0.2.1 needs TLS"),
        ("{host: 192.0.2.1, allow_insecure: true}", "whoever reaches it can read everything"),
        ("{host: 127.0.0.2}", ""),
    ],
)
def test_check_config_says_beforehand_what_would_be_refused(
    file: Callable[[str], Path], capsys: Capture, http: str, said: str
) -> None:
    assert beacon("check-config", file(http)) == 0
    warned = capsys.readouterr().err
    assert said in warned
    assert warned.count("warning: $.http.host: ") == bool(said)
    assert beacon("check-config", file(http), "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["warnings"]) == bool(said)
